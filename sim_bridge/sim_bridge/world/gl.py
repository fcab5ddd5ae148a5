"""Choose MuJoCo's GL back end before MuJoCo is imported.

MuJoCo fixes it at import and dies with an unhelpful error when the library is missing, so each
candidate is tried in a subprocess once; the choice is inherited by child processes through
``MUJOCO_GL``.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys

from cfnav_core.command import need

CANDIDATES = ("egl", "osmesa")
PROBE = """
import mujoco
context = mujoco.GLContext(8, 8)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_50)
"""


NARROWING = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "MUJOCO_EGL_DEVICE_ID")
"""Variables that narrow the choice, perhaps to one that cannot draw here."""


class NoGraphicsError(ImportError):
    """No GL back end can draw; the message has the cause of each that was tried, and a remedy."""


def choose_backend() -> str:
    """Set ``MUJOCO_GL`` to the first back end that can draw, and return it.

    Raises:
        ModuleNotFoundError: there is no MuJoCo.
        NoGraphicsError: the one asked for cannot draw here, or neither EGL nor OSMesa can.
    """
    need("mujoco")
    # llvmpipe threads fight with the one-core-per-process layout of every caller
    os.environ.setdefault("LP_NUM_THREADS", "0")
    asked = os.environ.get("MUJOCO_GL")
    causes = []
    for name in (asked,) if asked else CANDIDATES:
        probe = subprocess.run(
            [sys.executable, "-c", PROBE], env={**os.environ, "MUJOCO_GL": name},
            capture_output=True, check=False, text=True, errors="replace",
        )  # fmt: skip
        if probe.returncode == 0:
            os.environ["MUJOCO_GL"] = name
            return name
        causes.append(f"{name}: {cause_of(probe)}")
    narrowed = [f"{name}={os.environ[name]}" for name in NARROWING if os.environ.get(name)]
    remedy = "install OSMesa with 'apt-get install libosmesa6'"
    if narrowed:
        names = " ".join(setting.split("=")[0] for setting in narrowed)
        remedy = f"'unset {names}' (found {', '.join(narrowed)}) and if that is not enough {remedy}"
    raise NoGraphicsError(
        f"found no GL back end that can draw rooms ({'; '.join(causes)}); {remedy}"
    )


def cause_of(probe: subprocess.CompletedProcess[str]) -> str:
    """Why a probe failed: the first error that it told of; those after it follow from it."""
    told = re.search(r"\b\w*(?:Error|Exception): .*", probe.stderr)
    return told[0].strip() if told else f"ended with code {probe.returncode} and no error"


if "mujoco" not in sys.modules and os.environ.get("CFNAV_GL_CHOSEN") != "1":
    choose_backend()
    os.environ["CFNAV_GL_CHOSEN"] = "1"
