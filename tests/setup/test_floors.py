"""The lower bounds of pyproject.toml: tests pass with the oldest versions that it allows.

What is named there is at its floor, and what that needs is the newest. Those of ROS, of the build
and of Ray are not tried.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.conftest import ROOT

PARTS = (
    *(f"tests/core/{part}" for part in ("files", "knowledge", "models", "policy", "published")),
    *(f"tests/core/{part}" for part in ("robot", "scenes", "task")),
    *(f"tests/core/learn/test_{part}.py" for part in ("env", "gym_env", "small", "train")),
    *(f"tests/ros/{part}" for part in ("drive", "lidar", "live/test_report.py")),
    "tests/bags", "tests/cfnav", "tests/sim", "tests/test_python.py",
)  # fmt: skip
"""What needs no ROS, and every dependency somewhere, in minutes."""

HIDES_ROS = "tests/cfnav/test_command.py::test_what_is_not_installed_is_one_sentence"
"""Takes a ROS away, of which there is none."""


@pytest.mark.long
def test_the_oldest_versions_allowed_will_do(
    commands: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    made = [f"{sys.base_prefix}/bin/python{version}", "-m", "venv", str(tmp_path / "floors")]
    subprocess.run(made, check=True, env=commands.variables())
    python = str(tmp_path / "floors/bin/python")
    monkeypatch.setattr(commands, "PYTHON", python)
    monkeypatch.setattr(commands, "LOG", commands.VENV / "cfnav/floors.log")
    commands.install(
        *("--resolution", "lowest-direct", "--requirements", "pyproject.toml"),
        *("--extra", "train", "--extra", "sb3", "--group", "test"),
    )
    sources = os.pathsep.join(str(ROOT / part) for part in ("", "sim_bridge", "cfnav_ros"))
    environment = {**commands.variables(), "PYTHONPATH": sources}
    environment.pop("CFNAV_REQUIRE_ROS", None)
    tests = [python, "-m", "pytest", "-q", "-n", "2", "--dist", "loadgroup"]
    tests += ["-m", "not ros and not long", "--deselect", HIDES_ROS]
    log = tmp_path / "tests.log"
    with log.open("w") as output:
        code = subprocess.call(
            [*tests, *PARTS], cwd=ROOT, env=environment, stdout=output, stderr=output
        )
    assert code == 0, log.read_text()[-6000:]
