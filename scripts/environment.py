"""Where the environment lies, which ROS it uses, and what is good or half-done of it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from steps import SetupError

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMPS = VENV / "cfnav"
WORKSPACE = ROOT / "ros_ws"
ROS_FILE = STAMPS / "ros"  # "wheels", or the prefix of the ROS that was sourced
REQUIREMENTS = ROOT / "requirements"
PACKAGES = ("cfnav_core", "cfnav_ros", "sim_bridge")
WHEELS = "wheels"

# Variables of another environment that would lead pip or colcon astray.
_FOREIGN = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
_ROS_PATHS = ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH", "LD_LIBRARY_PATH")


def clean(variables: Mapping[str, str]) -> dict[str, str]:
    """The caller's variables, less those of other environments: what set-up commands get."""
    kept = {k: v for k, v in variables.items() if k not in (*_FOREIGN, *_ROS_PATHS)}
    kept["PATH"] = f"{VENV / 'bin'}{os.pathsep}{variables.get('PATH', os.defpath)}"
    kept["PIP_DISABLE_PIP_VERSION_CHECK"] = "1"
    return kept


def find_ros(variables: Mapping[str, str]) -> str:
    """Which ROS to use: the sourced one, the one used at the last set-up, or the wheels.

    Args:
        variables: The caller's environment.

    Returns:
        "wheels", or the prefix of a ROS installation, such as /opt/ros/jazzy.

    Raises:
        SetupError: Another distribution than Jazzy is sourced.
    """
    for prefix in filter(None, variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        path = Path(prefix)
        # A virtual environment with the wheels (a sourced scripts/env.sh) is no ROS installation.
        if not (path / "share/rclpy/package.xml").exists() or (path / "pyvenv.cfg").exists():
            continue
        distribution = variables.get("ROS_DISTRO", "unknown")
        if distribution != "jazzy":
            raise SetupError(
                f"Found ROS '{distribution}' sourced from {prefix}; cfnav needs 'jazzy'. Source "
                "that one, or run from a shell without ROS and cfnav installs its own."
            )
        return prefix
    if ROS_FILE.exists():
        recorded = ROS_FILE.read_text().strip()
        if Path(recorded, "setup.bash").exists():
            return recorded
    return WHEELS


def venv_works(ros: str) -> bool:
    """Whether `.venv` is a virtual environment of this Python, in this place, for this ROS."""
    recorded = ROS_FILE.read_text().strip() if ROS_FILE.exists() else WHEELS
    script = "import sys, pip; print(sys.prefix, *sys.version_info[:2])"
    try:
        answer = subprocess.run(
            [VENV / "bin/python", "-c", script],
            capture_output=True,
            text=True,
            env=clean(os.environ),
        )
    except OSError:
        return False
    expected = f"{VENV} {sys.version_info[0]} {sys.version_info[1]}"
    return answer.stdout.strip() == expected and recorded == ros


def clear_venv() -> None:
    """Empties `.venv`, stamps first; the marker of a step under way stays."""
    for stamp in (*STAMPS.glob("*.stamp"), ROS_FILE):
        stamp.unlink(missing_ok=True)
    for entry in VENV.iterdir() if VENV.exists() else ():
        if entry.is_dir() and not entry.is_symlink():
            if entry != STAMPS:
                shutil.rmtree(entry)
        else:
            entry.unlink()


def clear_workspace() -> None:
    """Removes what colcon built."""
    for name in ("install", "build", "log"):
        shutil.rmtree(WORKSPACE / name, ignore_errors=True)
