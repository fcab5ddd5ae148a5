"""SIGINT, SIGTERM and SIGHUP: a KeyboardInterrupt that is never lost."""

from __future__ import annotations

import signal
from types import FrameType


def ending_signals() -> list[signal.Signals]:
    """Signals that end a process: that of a terminal that closes, too, unless ``nohup`` says no."""
    hangs_up = signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
    return [signal.SIGINT, signal.SIGTERM, *[signal.SIGHUP] * hangs_up]


class Interrupt:
    """Signals that end a process as ``KeyboardInterrupt``, once; what follows is clean-up.

    Raised inside a destructor or a foreign callback it would be printed and forgotten, so loops
    call ``check``, which raises it again.
    """

    def __init__(self) -> None:
        self._came = False

    def catch(self) -> None:
        """From now on the process can be interrupted."""
        self._came = False
        for number in ending_signals():
            signal.signal(number, self._handle)

    def check(self) -> None:
        """Raise KeyboardInterrupt when a signal came."""
        if self._came:
            raise KeyboardInterrupt

    def _handle(self, number: int, _: FrameType | None) -> None:
        # A second signal must not tear the clean-up in two.
        for other in ending_signals():
            signal.signal(other, signal.SIG_IGN)
        self._came = True
        raise KeyboardInterrupt


INTERRUPT = Interrupt()
"""Of this process, as signals are."""
