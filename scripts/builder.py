"""The steps that build the environment: packages, cfnav itself, the workspace, what tests need."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from environment import (
    PACKAGES,
    REQUIREMENTS,
    ROOT,
    ROS_FILE,
    VENV,
    WHEELS,
    WORKSPACE,
    clean,
    clear_venv,
    clear_workspace,
    venv_works,
)
from steps import Step, write_whole

TORCH = "2.13.0"
VERSION = f"{sys.version_info[0]}.{sys.version_info[1]}"
PYTHON = str(VENV / "bin/python")


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
        return self._demo_steps() + (self._test_steps() if test else [])

    @property
    def _base(self) -> list[str]:
        """What every step depends on: an environment works in one place, for one Python and ROS."""
        return [str(ROOT), VERSION, self.ros]

    def _demo_steps(self) -> list[Step]:
        locks = [REQUIREMENTS / "demo.txt", REQUIREMENTS / "ros.txt"]
        locks.append(ROOT / "scripts/mend_wheels.py")
        shims = [ROOT / p / f for p in PACKAGES for f in ("package.xml", "setup.py", "setup.cfg")]
        sources = [WORKSPACE / name for name in ("src", "fallback", "colcon_defaults.yaml")]
        with_ros = " with ROS 2 Jazzy" if self.ros == WHEELS else ""
        return [
            Step(
                "venv",
                f"Virtual environment .venv (Python {VERSION})",
                VENV / "bin/pip",
                self._base,
                self.make_venv,
                clear_venv,
            ),
            Step(
                "packages",
                f"Python packages{with_ros} (1 to 3 minutes)",
                ROS_FILE,
                [*self._base, *locks],
                self.install_packages,
                clear_venv,
            ),
            Step(
                "project",
                "cfnav itself",
                VENV / "bin/cfnav",
                [*self._base, ROOT / "pyproject.toml"],
                self.install_project,
                clear_venv,
            ),
            Step(
                "workspace",
                "ROS interfaces and packages with colcon (1 to 2 minutes)",
                WORKSPACE / "install/local_setup.bash",
                [*self._base, *locks, *shims, *sources],
                self.build_workspace,
                clear_workspace,
            ),
        ]

    def _test_steps(self) -> list[Step]:
        return [
            Step(
                "test",
                "Packages for tests and training",
                VENV / "bin/mypy",
                [*self._base, REQUIREMENTS / "test.txt"],
                self.install_test_packages,
                clear_venv,
            ),
            Step(
                "torch",
                f"torch {TORCH} (1 to 2 minutes)",
                VENV / f"lib/python{VERSION}/site-packages/torch/__init__.py",
                [*self._base, TORCH],
                self.install_torch,
                clear_venv,
            ),
        ]

    def make_venv(self) -> None:
        """Makes `.venv`, or keeps it when it is good."""
        if venv_works(self.ros):
            return
        clear_venv()
        # The Python modules of a ROS from apt (lark, catkin_pkg) lie in the system's site-packages.
        options = [] if self.ros == WHEELS else ["--system-site-packages"]
        command = [sys.executable, "-m", "venv", *options, str(VENV)]
        self.run(command, "Could not make the virtual environment .venv")

    def pip(self, *arguments: str) -> None:
        """Installs with pip, from wherever pip is configured to look."""
        command = [PYTHON, "-m", "pip", "install", "--no-input", "--progress-bar", "off"]
        self.run([*command, *arguments], "pip could not install the packages")

    def install_packages(self) -> None:
        """Installs the locked packages and, where the system has none, ROS."""
        files = ["-r", str(REQUIREMENTS / "demo.txt")]
        if self.ros == WHEELS:
            files += ["-r", str(REQUIREMENTS / "ros.txt")]
        self.pip(*files)
        if self.ros == WHEELS:
            mend = [PYTHON, str(ROOT / "scripts/mend_wheels.py")]
            self.run(mend, "Could not mend the CMake files of the ROS wheels")
        write_whole(ROS_FILE, self.ros + "\n")

    def install_project(self) -> None:
        """Installs cfnav so that its sources are what runs."""
        self.pip("--no-deps", "--no-build-isolation", "-e", str(ROOT))

    def build_workspace(self) -> None:
        """Builds interfaces and packages, and the message packages that this ROS lacks."""
        share = (VENV if self.ros == WHEELS else Path(self.ros)) / "share"
        fallback = sorted(p.parent.name for p in WORKSPACE.glob("fallback/*/package.xml"))
        lacking = [name for name in fallback if not (share / name / "package.xml").exists()]
        paths = ["src", *(f"../{p}" for p in PACKAGES), *(f"fallback/{p}" for p in lacking)]
        colcon = [PYTHON, "-m", "colcon", "build", "--cmake-clean-cache", "--base-paths", *paths]
        self.run(self.in_ros(colcon), "colcon could not build ros_ws", WORKSPACE)

    def in_ros(self, command: Sequence[str]) -> list[str]:
        """The command, run where this ROS is found."""
        if self.ros == WHEELS:
            names = ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "VIRTUAL_ENV")
            return ["env", *(f"{name}={VENV}" for name in names), *command]
        return ["bash", "-c", 'source "$0/setup.bash" && exec "$@"', self.ros, *command]

    def install_test_packages(self) -> None:
        """Installs what tests and training need, torch apart."""
        self.pip("-r", str(REQUIREMENTS / "test.txt"))

    def install_torch(self) -> None:
        """Installs torch, its CPU build where pip finds one."""
        cpu = f"torch=={TORCH}+cpu"
        look = [PYTHON, "-m", "pip", "install", "--no-deps", "--dry-run", "-q", cpu]
        if subprocess.run(look, env=clean(os.environ), capture_output=True).returncode == 0:
            self.pip("--no-deps", cpu)
            return
        self.tell(
            f"pip finds no CPU build of torch {TORCH} for Python {VERSION}: taking the default "
            "build, with several GB of CUDA libraries. PIP_EXTRA_INDEX_URL or PIP_FIND_LINKS can "
            "name a place with CPU builds."
        )
        self.pip("-c", str(REQUIREMENTS / "test.txt"), f"torch=={TORCH}")
