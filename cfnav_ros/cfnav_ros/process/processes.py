"""The processes of the graph: started with a log, watched, ended by their id. Knows no ROS."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, MutableMapping, Sequence
from importlib.resources import files
from pathlib import Path

from cfnav_core.command import CannotError

_LIBC = ctypes.CDLL(None)  # here, as nothing may be loaded between fork and exec
_PR_SET_PDEATHSIG = 1

ENDS_WITH_PARENT = "setpriv --pdeathsig INT"
"""What starts a program so that it is interrupted when its parent dies, even by SIGKILL: for the
nodes of a launch, which does not end them then. A ``Child`` ends so by itself."""

DISCOVERY_S = 4.0
"""Wall seconds after which everybody in the domain has been heard of: a participant that misses
our first announcement is heard at its own next one, and Fast DDS repeats them every 3 s."""

_ELSEWHERE = ("ROS_DISCOVERY_SERVER", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_SUPER_CLIENT")
"""Settings of the surroundings that could reach beyond this machine."""


class GraphError(CannotError):
    """The graph did not run; the text is one sentence that says what to do or look at."""


class Child:
    """A running process whose output goes to a log file."""

    def __init__(
        self, name: str, command: Sequence[str], log: Path, env: Mapping[str, str]
    ) -> None:
        """Start it in a session of its own, so that Ctrl-C reaches only the parent.

        Args:
            name: how it is called in sentences.
            command: program and arguments.
            log: file that takes standard output and error.
            env: its whole environment.
        """
        self.name = name
        self.log = log
        with log.open("wb") as output:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=dict(env),
                start_new_session=True,
                preexec_fn=_end_with_parent,
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def ended(self) -> str | None:
        """Return a sentence when the process has ended, else None."""
        code = self._process.poll()
        if code is None:
            return None
        lines = self.log.read_text(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "no output")
        return f"{self.name} ended with code {code}: {last} (log: {self.log})"

    def stop(self, patience_s: float = 8.0) -> int:
        """End it: SIGINT, then SIGTERM, then SIGKILL; returns its exit code."""
        for sign in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            if self._process.poll() is None:
                self._process.send_signal(sign)
            try:
                return self._process.wait(patience_s)
            except subprocess.TimeoutExpired:
                continue
        return self._process.wait()


def node_command(package: str, executable: str) -> list[str]:
    """Return how to start a node: the installed executable, or else its module.

    Args:
        package: package name.
        executable: name of the executable, and of its module in the package's ``ros``.
    """
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        program = Path(prefix) / "lib" / package / executable
        if prefix and os.access(program, os.X_OK):
            return [str(program)]
    return [sys.executable, "-m", f"{package}.ros.{executable}"]


def keep_local(environment: MutableMapping[str, str], logs: Path | None = None) -> None:
    """Change an environment so that its graph stays on this machine and its pictures whole.

    Args:
        environment: of the nodes.
        logs: folder for their logs; where it was when None.
    """
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    environment["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(files("cfnav_ros") / "config/fastdds.xml")
    if logs is not None:
        environment["ROS_LOG_DIR"] = str(logs / "ros")
    for name in _ELSEWHERE:
        environment.pop(name, None)


def _end_with_parent() -> None:
    """Ask Linux to interrupt this process when its parent dies, even by SIGKILL."""
    # a shell starts background jobs with SIGINT ignored, and what is ignored is inherited
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
