"""Which message is due at which simulated time, and how far that time may run ahead of the wall.

Pure: both times are arguments.
"""

from __future__ import annotations

from collections.abc import Callable

MAX_LAG_S = 0.5
"""A loop that was held up catches up with the wall clock after at most this; the rest is lost."""


class Every:
    """Tells when something with a period is due; the mean rate is exact on any grid of steps.

    Args:
        period: s of simulated time.
        action: what is to be done then.
    """

    def __init__(self, period: float, action: Callable[[], None]) -> None:
        self.action = action
        self._period = period
        self._next = 0.0

    def restart(self, t: float) -> None:
        """Be due at simulated time t, s, and every period from there on."""
        self._next = t

    def due(self, t: float) -> bool:
        """Whether the time has come; True once for each period."""
        if t < self._next - 1e-9:
            return False
        self._next += self._period
        return True


class Pacer:
    """Holds simulated time back to a multiple of real time.

    Args:
        speed: times real time; 0 never waits.
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._t = self._wall = 0.0

    def restart(self, t: float, wall: float) -> None:
        """Begin anew at simulated time ``t`` and wall time ``wall``, s."""
        self._t, self._wall = t, wall

    def ahead(self, t: float, wall: float, at_most: bool = False) -> float:
        """How far simulated time runs ahead of the wall clock.

        Args:
            t: simulated time, s.
            wall: steady wall time, s.
            at_most: no faster than real time, whatever the speed.

        Returns:
            Wall seconds to wait. Below zero, the loop lags; beyond ``MAX_LAG_S`` the lag is
            forgiven and counting begins anew.
        """
        speed = min(self._speed or 1.0, 1.0) if at_most else self._speed
        if speed == 0:
            return 0.0
        ahead = (t - self._t) / speed - (wall - self._wall)
        if ahead < -MAX_LAG_S:
            self.restart(t, wall)
        return ahead
