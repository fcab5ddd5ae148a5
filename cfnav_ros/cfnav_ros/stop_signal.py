"""SIGINT and SIGTERM: a flag for nodes, a KeyboardInterrupt that is never lost for clients."""

from __future__ import annotations

import signal
from types import FrameType


class StopSignal:
    """True once the process was told to end; a second signal changes nothing.

    rclpy's own handlers shut the context down at once, after which no zero velocity can be sent.
    """

    def __init__(self) -> None:
        self._number = 0
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._handle)

    def _handle(self, number: int, _: FrameType | None) -> None:
        self._number = number

    def ignore(self) -> None:
        """From now on nothing disturbs the end: while Python ends, a signal would kill it."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)

    def __bool__(self) -> bool:
        return self._number != 0


class Interrupt:
    """SIGINT and SIGTERM as ``KeyboardInterrupt``, once; what follows is clean-up.

    Raised inside a destructor or a foreign callback it would be printed and forgotten, so loops
    call ``check``, which raises it again.
    """

    def __init__(self) -> None:
        self._came = False

    def catch(self) -> None:
        """From now on the process can be interrupted."""
        self._came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._handle)

    def check(self) -> None:
        """Raise KeyboardInterrupt when a signal came."""
        if self._came:
            raise KeyboardInterrupt

    def _handle(self, number: int, _: FrameType | None) -> None:
        # A second signal must not tear the clean-up in two.
        for other in (signal.SIGINT, signal.SIGTERM):
            signal.signal(other, signal.SIG_IGN)
        self._came = True
        raise KeyboardInterrupt


INTERRUPT = Interrupt()
"""Of this process, as signals are."""
