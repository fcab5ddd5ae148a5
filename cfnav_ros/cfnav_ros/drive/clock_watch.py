"""Node time that stands still, leaps or jumps back: it misleads every other watch.

Pure: real time is an argument too.
"""

from __future__ import annotations

from enum import IntEnum

GRACE_S = 0.5
"""Node time that stands still this long means zero velocity, real seconds."""

LEAP_S, MOST_SPEED = 1.0, 20.0
"""Node time that moves on by more than the first, beyond the second times the real time for which
it stood, was set: no simulation on one machine is that fast."""


class Alarm(IntEnum):
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
        self._read_ns: int | None = None
        self._moved_at = self._looked_at = 0.0
        self.reason = ""
        """One sentence on what the last look found."""

    def restart(self, real: float) -> None:
        """Forget what node time did until now (real time, seconds)."""
        self._read_ns, self._moved_at, self._looked_at = None, real, real

    def look(self, real: float, read_ns: int) -> Alarm:
        """Judge what node time reads.

        Args:
            real: monotonic real time, seconds.
            read_ns: node time, nanoseconds.
        """
        before, self._read_ns = self._read_ns, read_ns
        hung, self._looked_at = real - self._looked_at > GRACE_S, real
        if before is not None and read_ns != before:
            advance, passed = (read_ns - before) * 1e-9, real - self._moved_at
            self._moved_at = real
            if advance < 0:
                self.reason = "Node time jumped back."
                return Alarm.FAIL
            if before and advance > LEAP_S + MOST_SPEED * passed:
                self.reason = f"Node time leapt ahead by {advance:.1f} s: was the clock set?"
                return Alarm.FAIL
            return Alarm.NONE
        if hung:  # this process stood, and has not heard yet what time it is
            self._moved_at = real
            return Alarm.STOP
        self.reason = "Node time stands still: is /clock published?"
        stood = real - self._moved_at
        patience = self._timeout if read_ns else self._start_timeout
        if stood > patience + GRACE_S:
            return Alarm.END
        if stood > patience:
            return Alarm.FAIL
        return Alarm.STOP if stood > GRACE_S else Alarm.NONE
