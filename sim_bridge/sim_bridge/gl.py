"""Choose MuJoCo's GL back end before MuJoCo is imported.

MuJoCo fixes it at import and dies with an unhelpful error when the library is missing, so each
candidate is tried in a subprocess once; the choice is inherited by child processes through
``MUJOCO_GL``.
"""

from __future__ import annotations

import os
import subprocess
import sys

CANDIDATES = ("egl", "osmesa")
PROBE = """
import mujoco
context = mujoco.GLContext(8, 8)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_50)
"""


class NoGraphicsError(ImportError):
    """No usable GL library; the message names the package to install."""


def choose_backend() -> str:
    """Set ``MUJOCO_GL`` to the first back end that can draw, and return it.

    Raises:
        NoGraphicsError: neither EGL nor OSMesa works here.
    """
    # llvmpipe threads fight with the one-core-per-process layout of every caller
    os.environ.setdefault("LP_NUM_THREADS", "0")
    asked = os.environ.get("MUJOCO_GL")
    for name in (asked,) if asked else CANDIDATES:
        probe = subprocess.run(
            [sys.executable, "-c", PROBE], env={**os.environ, "MUJOCO_GL": name},
            capture_output=True, check=False,
        )  # fmt: skip
        if probe.returncode == 0:
            os.environ["MUJOCO_GL"] = name
            return name
    raise NoGraphicsError(
        f"found no working GL library (tried {asked or ', '.join(CANDIDATES)}); rooms are drawn "
        "with OSMesa or EGL: install one with 'apt-get install libosmesa6'"
    )


if "mujoco" not in sys.modules and os.environ.get("CFNAV_GL_CHOSEN") != "1":
    choose_backend()
    os.environ["CFNAV_GL_CHOSEN"] = "1"
