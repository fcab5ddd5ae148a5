"""Which ROS domain a graph has: one graph at a time, by a lock file for each domain.

A process loses its locks with its life.
"""

from __future__ import annotations

import fcntl
import random
import tempfile
from collections.abc import MutableMapping
from contextlib import suppress
from pathlib import Path
from typing import IO

from cfnav_ros.process.processes import GraphError, keep_local

DOMAINS = range(1, 102)
"""Domain ids whose ports are free of the system's own on Linux, without the default 0."""


class Domain:
    """A ROS domain that no other graph of ours has on this machine, until it is released.

    Attributes:
        number: its id.
    """

    def __init__(self, number: int | None = None) -> None:
        """Take a free one.

        Args:
            number: take this one: where it is locked, that is whoever named it, such as a test.

        Raises:
            GraphError: none is free.
        """
        if number is not None:
            self.number, self._lock = number, _lock(number)
            return
        for self.number in random.SystemRandom().sample(DOMAINS, len(DOMAINS)):
            self._lock = _lock(self.number)
            if self._lock is not None:
                return
        raise GraphError(
            f"other graphs on this machine have all ROS domains from 1 to {DOMAINS[-1]}; end some"
        )

    def release(self) -> None:
        """Let others have it."""
        if self._lock is not None:
            self._lock.close()

    def __enter__(self) -> int:
        """Its id."""
        return self.number

    def __exit__(self, *_: object) -> None:
        """Let others have it."""
        self.release()


def _lock(number: int) -> IO | None:
    """The locked file of a domain, None while another has it."""
    folder = Path(tempfile.gettempdir(), "cfnav-domains")
    folder.mkdir(exist_ok=True)
    try:
        file = (folder / str(number)).open("a")
    except PermissionError:  # another user's, made under a mask that shares nothing
        return None
    for path, mode in ((folder, 0o777), (folder / str(number), 0o666)):
        with suppress(PermissionError):  # so that all users of the machine share the locks
            path.chmod(mode)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    return file


def stay_apart(environment: MutableMapping[str, str], domain: str) -> int:
    """Keep a replay away from every robot: on this machine, in a domain of its own.

    Args:
        environment: of the shell; that of the replay when this returns.
        domain: of the replay.

    Returns:
        The domain.

    Raises:
        GraphError: the domain is none, or that of the shell, where a robot may be.
    """
    live = environment.get("ROS_DOMAIN_ID") or "0"
    fits = domain.isascii() and domain.isdecimal() and int(domain) <= DOMAINS[-1]
    if not fits or domain.lstrip("0") == live.lstrip("0"):
        raise GraphError(
            f"domain is {domain!r}, expected 0 to {DOMAINS[-1]} but not {live}, the domain of this "
            "shell: nodes of a robot there would take the recording for its sensors."
        )
    environment["ROS_DOMAIN_ID"] = domain
    keep_local(environment)
    return int(domain)
