"""Builds the environment that cfnav runs in; a second call starts nothing and takes a moment.

    python3 scripts/set_up.py          what the demo needs
    python3 scripts/set_up.py --test   and what the tests need, torch too

Uses the standard library only. The environment is `.venv` with the locked packages, ROS 2 Jazzy
(the sourced one where there is one, otherwise from wheels) and the built `ros_ws/install`.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

sys.path.insert(0, str(Path(__file__).parent))

import environment
import system
from builder import Builder
from environment import ROOT, STAMPS
from steps import SetupError, Stamps

LOG = STAMPS / "set_up.log"
_started = time.monotonic()


def tell(line: str) -> None:
    """Shows the user one line, with the seconds since the start."""
    print(f"[set-up {time.monotonic() - _started:4.0f} s] {line}", flush=True)


def run_in_group(command: Sequence[str], cwd: Path, log: BinaryIO) -> int:
    """Runs a command in a process group of its own and returns its exit code.

    When this program is interrupted, the whole group is ended: nothing goes on alone.
    """
    variables = environment.clean(os.environ)
    process = subprocess.Popen(
        command,
        cwd=cwd,
        env=variables,
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        process_group=0,
    )
    try:
        return process.wait()
    except BaseException:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
        raise


def run(command: Sequence[str], failure: str, cwd: Path = ROOT) -> None:
    """Runs a command with its output in the log.

    Args:
        command: Program and arguments.
        failure: What it means for the user when the command fails, without a full stop.
        cwd: Where to run it.

    Raises:
        SetupError: It failed; its last lines have been shown.
    """
    LOG.parent.mkdir(parents=True, exist_ok=True)
    with LOG.open("ab+") as log:
        log.write(f"\n$ {' '.join(command)}\n".encode())
        log.flush()
        start = log.tell()
        code = run_in_group(command, cwd, log)
        if code == 0:
            return
        log.seek(start)
        lines = log.read().decode(errors="replace").strip().splitlines()
    print("\n".join(lines[-20:]), file=sys.stderr)
    raise SetupError(f"{failure} (all of its output: {LOG.relative_to(ROOT)}).")


def set_up(test: bool) -> bool:
    """Goes through the steps that are not done yet.

    Args:
        test: Also install what tests and training need.

    Returns:
        Whether anything was done.

    Raises:
        SetupError: A step could not be done.
    """
    system.check_python(sys.version_info[:2])
    system.install_missing(run, tell)
    builder = Builder(environment.find_ros(os.environ), run, tell)
    stamps = Stamps(STAMPS)
    interrupted = stamps.recover(builder.steps(test=True))
    if interrupted is not None:
        tell(f"An earlier run was interrupted during: {interrupted.title}. Starting that afresh.")
    ran = [stamps.ensure(step, tell) for step in builder.steps(test)]
    return any(ran)


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
            if set_up(arguments.test):
                tell("Ready.")
        except SetupError as error:
            print(f"Set-up failed: {error}", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print(
                "Set-up interrupted; the next run starts the interrupted step afresh.",
                file=sys.stderr,
            )
            return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
