"""Which GL back end draws, and what is said when none can."""

import os
import re
import subprocess
import sys

import pytest
from sim_bridge.world.gl import CANDIDATES, cause_of

SETTINGS = ("CFNAV_GL_CHOSEN", "MUJOCO_GL", "PYOPENGL_PLATFORM", "MUJOCO_EGL_DEVICE_ID", "DISPLAY")


def chosen(**settings: str) -> subprocess.CompletedProcess[str]:
    """What a process of its own chooses under these settings."""
    variables = {name: value for name, value in os.environ.items() if name not in SETTINGS}
    return subprocess.run(
        [sys.executable, "-c", "import os, sim_bridge.world.gl; print(os.environ['MUJOCO_GL'])"],
        env=variables | settings, capture_output=True, text=True, timeout=120,
    )  # fmt: skip


def test_without_settings_one_is_found():
    assert chosen().stdout.strip() in CANDIDATES


@pytest.mark.parametrize(
    ("settings", "cause"),
    [
        ({"MUJOCO_GL": "glfw"}, "glfw: GLFWError: .*(DISPLAY environment variable is missing|X11)"),
        ({"MUJOCO_GL": "nonsense"}, "nonsense: RuntimeError: invalid value for .* MUJOCO_GL"),
        (
            {"PYOPENGL_PLATFORM": "glx"},
            "egl: ImportError: .*; osmesa: ImportError: .*PYOPENGL",
        ),
    ],
)
def test_a_setting_that_cannot_draw_is_named_with_its_cause(settings, cause):
    found = chosen(**settings)
    (name,), (value,) = settings, settings.values()
    assert found.returncode == 1
    line = found.stderr.strip().splitlines()[-1]
    assert re.search(cause, line), line
    assert f"'unset {name}' (found {name}={value})" in line


def test_a_probe_that_died_without_a_word_is_told_by_its_code():
    died = subprocess.run(
        [sys.executable, "-c", "import os; os.abort()"], capture_output=True, text=True
    )
    assert cause_of(died) == f"ended with code {died.returncode} and no error"
