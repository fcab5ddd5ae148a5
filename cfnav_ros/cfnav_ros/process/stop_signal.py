"""SIGINT, SIGTERM and SIGHUP as a flag, for nodes."""

from __future__ import annotations

import signal
from types import FrameType

from cfnav_core.command.interrupt import ending_signals


class StopSignal:
    """True once the process was told to end; a second signal changes nothing.

    rclpy's own handlers shut the context down at once, after which no zero velocity can be sent.
    """

    def __init__(self) -> None:
        self._number = 0
        for number in ending_signals():
            signal.signal(number, self._handle)

    def _handle(self, number: int, _: FrameType | None) -> None:
        self._number = number

    def ignore(self) -> None:
        """From now on nothing disturbs the end: while Python ends, a signal would kill it."""
        for number in ending_signals():
            signal.signal(number, signal.SIG_IGN)

    def __bool__(self) -> bool:
        return self._number != 0
