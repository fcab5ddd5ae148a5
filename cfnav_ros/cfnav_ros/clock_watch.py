"""Node time that stands still: it stops every other watch. Pure: real time is an argument too."""

from __future__ import annotations

from enum import IntEnum

GRACE_S = 0.5
"""Node time that stands still this long means zero velocity, real seconds."""


class Standstill(IntEnum):
    """What node time calls for; each value includes those before it."""

    NONE = 0
    """It runs, or has not stood for long."""

    STOP = 1
    """Send zero velocity."""

    FAIL = 2
    """Fail the episode."""

    END = 3
    """End the episode without waiting for it: its own updates may never come."""


class ClockWatch:
    """Compares what node time reads with how much real time passes."""

    def __init__(self, timeout: float, start_timeout: float) -> None:
        """Watch node time.

        Args:
            timeout: node time that stands this long fails an episode, real seconds.
            start_timeout: the same while it reads 0, as before the first /clock.
        """
        self._timeout, self._start_timeout = timeout, start_timeout
        self._read_ns, self._moved_at = 0, 0.0

    def restart(self, real: float) -> None:
        """Forget how long node time has stood until now (real time, seconds)."""
        self._moved_at = real

    def look(self, real: float, read_ns: int) -> Standstill:
        """Judge what node time reads.

        Args:
            real: monotonic real time, seconds.
            read_ns: node time, nanoseconds.
        """
        if read_ns != self._read_ns:
            self._read_ns, self._moved_at = read_ns, real
            return Standstill.NONE
        stood = real - self._moved_at
        patience = self._timeout if read_ns else self._start_timeout
        if stood > patience + GRACE_S:
            return Standstill.END
        if stood > patience:
            return Standstill.FAIL
        return Standstill.STOP if stood > GRACE_S else Standstill.NONE
