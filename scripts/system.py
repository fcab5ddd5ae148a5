"""What the machine itself brings: its Python, a sourced ROS, a compiler, an OpenGL library.

Installs what is missing through apt where this user may; otherwise says in one line what to do.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from steps import SetupError

PYTHON_VERSIONS = ((3, 11), (3, 12))


@dataclass(frozen=True)
class Need:
    """One thing the machine must have, and the Debian package that brings it."""

    what: str
    package: str
    present: Callable[[], bool]
    required: bool = True


def loads(*libraries: str) -> bool:
    """Whether any of these shared libraries can be loaded."""
    for library in libraries:
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return True
    return False


def needs() -> list[Need]:
    """What cfnav needs of the machine, for the running Python."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    headers = Path(sysconfig.get_path("include"), "Python.h")
    return [
        Need("a C++ compiler", "g++", lambda: shutil.which("g++") is not None),
        Need(f"Python {version} headers", f"libpython{version}-dev", headers.exists),
        Need(
            "Python's venv module",
            f"python{version}-venv",
            lambda: importlib.util.find_spec("ensurepip") is not None,
        ),
        Need(
            "an OpenGL library for rendering without a screen",
            "libosmesa6",
            lambda: loads("libOSMesa.so.8", "libOSMesa.so.6", "libEGL.so.1"),
        ),
        # A libEGL alone may find no driver; OSMesa renders anywhere.
        Need("OSMesa", "libosmesa6", lambda: loads("libOSMesa.so.8", "libOSMesa.so.6"), False),
    ]


def apt_prefix() -> list[str] | None:
    """How to call apt-get here: [] as root, [sudo, -n] with sudo, None when neither works."""
    if shutil.which("apt-get") is None:
        return None
    if os.geteuid() == 0:
        return []
    if (
        shutil.which("sudo")
        and subprocess.run(["sudo", "-n", "true"], capture_output=True).returncode == 0
    ):
        return ["sudo", "-n"]
    return None


def how_to_install(missing: Sequence[Need]) -> str:
    """One sentence: what is missing and how to get it."""
    what = ", ".join(need.what for need in missing)
    packages = " ".join(dict.fromkeys(need.package for need in missing))
    how = f"Run `sudo apt-get install {packages}`"
    if shutil.which("apt-get") is None:
        how = (
            "There is no apt-get here: install them with your system's package manager (in Debian "
            f"they are {packages})"
        )
    return f"Missing on this machine: {what}. {how}, then the same command again."


def check_python(version: tuple[int, int]) -> None:
    """Refuses a Python that the ROS wheels do not exist for.

    Raises:
        SetupError: Not Python 3.11 or 3.12.
    """
    if version not in PYTHON_VERSIONS:
        raise SetupError(
            f"Found Python {version[0]}.{version[1]}; cfnav needs 3.11 or 3.12. Name one on the "
            "command line, as in `make demo PYTHON=python3.12`."
        )


def install_missing(run: Callable[[Sequence[str], str], None], tell: Callable[[str], None]) -> None:
    """Installs what the machine lacks.

    Args:
        run: Runs a command; its second argument says in words what failed if it does.
        tell: Gets a line to show the user before anything is installed.

    Raises:
        SetupError: Something required is missing and cannot be installed from here.
    """
    missing = [need for need in needs() if not need.present()]
    if not missing:
        return
    required = [need for need in missing if need.required]
    prefix = apt_prefix()
    if prefix is None:
        if required:
            raise SetupError(how_to_install(required))
        return
    packages = list(dict.fromkeys(need.package for need in missing))
    tell(f"System packages through apt: {' '.join(packages)}")
    apt = [*prefix, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-q"]
    try:
        run([*apt, "update"], "apt-get update failed")
        run(
            [*apt, "install", "-y", "--no-install-recommends", *packages],
            "apt-get install failed. " + how_to_install(missing),
        )
    except SetupError as error:
        if required:
            raise
        tell(f"It goes on without them, as they are not required: {error}")
    still = [need for need in required if not need.present()]
    if still:
        raise SetupError(how_to_install(still))


def find_ros(variables: Mapping[str, str], record: Path) -> Path:
    """Which ROS to use: the sourced one, the one used at the last set-up, or the wheels.

    Args:
        variables: The caller's environment.
        record: File in `.venv/cfnav` that names the ROS of the last set-up.

    Returns:
        Its prefix, such as /opt/ros/jazzy; that of the wheels is `.venv`.

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
        return path
    recorded = Path(record.read_text().strip()) if record.exists() else None
    if recorded and (recorded / "setup.bash").exists():
        return recorded
    return record.parent.parent
