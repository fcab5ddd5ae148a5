"""How every command ends, be it ``cfnav``, an executable of ``ros2 run`` or a ``python -m``.

0: done. 1: done in part, or judged unfavourably. 2: could not, because of bad input or of something
that is not installed. 130: told to stop. What went wrong is one sentence on standard error.

May import: nothing of the project.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cfnav_core.command.interrupt import INTERRUPT
from cfnav_core.command.streams import prepare_streams

DONE, PARTLY, COULD_NOT, STOPPED = 0, 1, 2, 130

TRAIN = "install it with pip install 'cfnav[train]'"
ROS = (
    "it is part of ROS 2 Jazzy or of the workspace: run 'make setup' in a checkout of cfnav and "
    "then 'source scripts/env.sh', or source both where they are installed"
)
INSTALL = {
    "torch": TRAIN, "gymnasium": TRAIN, "h5py": TRAIN, "onnx": TRAIN, "tensorboard": TRAIN,
    "ray": "install it with pip install 'cfnav[cluster]'",
    "stable_baselines3": "install it with pip install 'cfnav[sb3]'",
    "studies": "it is only in a checkout of cfnav: run this there",
}  # fmt: skip
"""What to do about a package that not everybody has."""

ROS_PACKAGE = re.compile(r"rclpy|rosbag2_py|ament_index_python|\w+_interfaces|\w+_msgs|std_srvs")


class CannotError(Exception):
    """What was asked for cannot be done; the text is one sentence."""


def need(package: str) -> None:
    """Look for a package before something is begun that cannot say what it lacks.

    Raises:
        ModuleNotFoundError: it is not installed.
    """
    if find_spec(package) is None:
        raise ModuleNotFoundError(f"No module named {package!r}", name=package)


def missing(error: ImportError) -> str:
    """Say in one sentence what is not installed, and what to do about it."""
    if not isinstance(error, ModuleNotFoundError) or not error.name:
        return str(error)
    package = error.name.partition(".")[0]
    by_pip = f"install it with pip install {package}"
    remedy = ROS if ROS_PACKAGE.fullmatch(package) else INSTALL.get(package, by_pip)
    return f"found no {package}, which this needs; {remedy}"


def ending(name: str, work: Callable[[], int | None]) -> int:
    """Do the work of a command.

    SIGTERM ends it as Ctrl-C does, once: what follows is clean-up.

    Args:
        name: begins the sentence about what went wrong.
        work: gives the exit code; None is 0.

    Returns:
        The exit code, see the module.
    """
    INTERRUPT.catch()
    prepare_streams()
    try:
        return work() or DONE
    except KeyboardInterrupt as stop:
        sentence, code = str(stop) or "interrupted; every process was ended", STOPPED
    except ImportError as error:
        sentence, code = missing(error), COULD_NOT
    except (CannotError, ValueError, OSError) as error:
        sentence, code = str(error), COULD_NOT
    print(f"{name}: {sentence}", file=sys.stderr)
    return code


def read_options(prog: str, options: Any, arguments: Sequence[str] | None = None) -> Any:
    """Read a command line into a dataclass.

    Args:
        prog: as somebody types it.
        options: a dataclass, or a union of such; it holds help and defaults.
        arguments: the command line after ``prog``, that of the process when None.

    Raises:
        SystemExit: help was asked for (0), or the arguments make no sense (2).
    """
    import tyro

    return tyro.cli(options, prog=prog, args=arguments, config=(tyro.conf.OmitArgPrefixes,))


def run_options(
    prog: str, options: Any, work: Callable[[Any], int | None] = lambda asked: asked.run_command()
) -> int:
    """Read the command line of this process and do what it asks for.

    Args:
        prog: as for ``read_options``; it begins the sentence about what went wrong.
        options: as for ``read_options``.
        work: is given the options and gives the exit code; None is 0.

    Returns:
        The exit code, see the module.
    """
    return ending(prog, lambda: work(read_options(prog, options)))


def command_line() -> str:
    """The command that runs, as somebody would type it again."""
    program, spec = Path(sys.argv[0]), getattr(sys.modules["__main__"], "__spec__", None)
    start = [program.name]
    if spec is not None and program.suffix == ".py":
        start = ["python", "-m", spec.name]
    return shlex.join([*start, *sys.argv[1:]])
