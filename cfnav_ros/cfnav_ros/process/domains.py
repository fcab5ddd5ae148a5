"""Which ROS domain a graph has: one graph at a time, by the name of a socket for each domain.

Such a name reaches as far as localhost does: users, and containers that share the host's network,
see each other's. A process loses its names with its life.
"""

from __future__ import annotations

import errno
import random
import socket
from collections.abc import MutableMapping

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


def _lock(number: int) -> socket.socket | None:
    """The socket that has a domain's name, None while another has it."""
    lock = socket.socket(socket.AF_UNIX)
    try:
        lock.bind(f"\0cfnav domain {number}")  # Linux's abstract names are of no file
    except OSError as error:
        lock.close()
        if error.errno != errno.EADDRINUSE:
            raise
        return None
    return lock


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
