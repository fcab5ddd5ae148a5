"""What the robot's clock shows, given simulated time. Pure."""

from __future__ import annotations

JUMP_S = 10.0
"""How far ``clock_ahead`` and ``clock_back`` are off, s; a clock that shows less jumps back to zero
and runs on from there."""


class RobotClock:
    """The clock that stamps the robot's messages; broken by the faults named clock_*.

    Attributes:
        epoch: s; what a true clock shows at simulated time zero.
    """

    def __init__(self) -> None:
        self.epoch = 0.0
        self.stopped_at: float | None = None
        """What it shows while it stands; None while it runs."""
        self._jump = self._offset = 0.0

    def true(self, t: float) -> float:
        """What a clock that works shows at simulated time t, s."""
        return self.epoch + t

    def __call__(self, t: float) -> float:
        """What the robot's clock shows at simulated time t, s; never less than zero."""
        if self.stopped_at is not None:
            return self.stopped_at
        return max(0.0, self.true(t) + self._offset)

    def take_faults(self, faults: frozenset[str], t: float) -> None:
        """Take the faults that hold from simulated time t on."""
        shown = self(t)
        jump = JUMP_S * (("clock_ahead" in faults) - ("clock_back" in faults))
        if jump != self._jump:
            self._jump, self._offset = jump, max(jump, -self.true(t))
        if "clock_stop" not in faults:
            self.stopped_at = None
        elif self.stopped_at is None:
            self.stopped_at = shown
