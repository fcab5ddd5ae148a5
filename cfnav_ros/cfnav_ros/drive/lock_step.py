"""In lock-step a simulator stands at each moment until the node has answered it. Pure.

Then an episode depends on nothing but its seed: not on the speed of the machine, and not on the
order in which messages of different topics arrive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cfnav_ros.drive.inputs import SensorInputs
from cfnav_ros.robot.stamps import NEVER, seconds

REPEAT_S = 1.0
"""Real time after which an answer is given again, should the simulator not have heard it."""

BEGIN_NS = 1_000 * 1_000_000_000
"""Time of an episode at its first moment, nanoseconds: stamps of older messages stay positive."""

LOST_S = 3.0
"""Real time after which messages of a moment are taken for lost, as those are that were sent before
the node listened."""

SAME_S = 1e-6
"""Stamps closer than this are the same one, seconds; they have passed through floating point."""


@dataclass(frozen=True)
class Moment:
    """Simulated time, and the stamps of the newest messages then, nanoseconds; 0 for none yet."""

    stamp_ns: int
    image_ns: int = 0
    """Of what the policy looks at: the picture, or what a detector says."""
    scan_ns: int = 0
    odometry_ns: int = 0


@dataclass(frozen=True)
class Answer:
    """What the simulator is told: time may go on, or stands while ``idle``."""

    stamp_ns: int
    idle: bool


class LockStep:
    """The moment that waits for an answer, and whether the inputs that belong to it are there."""

    def __init__(self, lidar: bool, tilt: bool) -> None:
        """Wait for moments.

        Args:
            lidar: whether the estimate made of the moment's scan is needed.
            tilt: whether the camera's tilt at the moment's odometry, or later, is needed.
        """
        self._lidar, self._tilt = lidar, tilt
        self.moment: Moment | None = None
        self.zero_ns: int | None = None
        """Simulated time from which the episode's times count, nanoseconds."""
        self._presented, self._came_ns = SensorInputs(), dict[str, int]()
        self._waiting_from: float | None = None
        self._acted_at = 0.0
        self._last: Answer | None = None
        self._told_at = 0.0

    def begin(self, moment: Moment) -> None:
        """Take up a moment; one that was answered already is answered again."""
        done = self._last and not self._last.idle and self._last.stamp_ns == moment.stamp_ns
        if done:
            self._told_at = 0.0
        else:
            self.moment, self._waiting_from = moment, None

    def complete(self, inputs: SensorInputs) -> bool:
        """Whether there is a moment, and all that belongs to it has arrived."""
        return self.moment is not None and not self.missing(inputs)

    def missing(self, inputs: SensorInputs) -> list[str]:
        """What belongs to the moment and has not arrived, as fields of ``SensorInputs``."""
        moment = self.moment
        if moment is None:
            return []
        pairs = [
            ("frame", seconds(inputs.frame.stamp_ns), moment.image_ns),
            ("odometry", inputs.odometry.stamp, moment.odometry_ns),
        ]
        if self._lidar:
            pairs.append(("estimate", seconds(inputs.estimate.stamp_ns), moment.scan_ns))
        left = [name for name, stamp, ns in pairs if ns and abs(stamp - seconds(ns)) >= SAME_S]
        if self._tilt and moment.odometry_ns and inputs.tilt.stamp < seconds(moment.odometry_ns):
            left.append("tilt")
        return left

    def restart(self, real: float) -> None:
        """An episode begins: its times count from the next moment that is acted on.

        Args:
            real: monotonic real time, seconds.
        """
        self.zero_ns, self._acted_at = None, real

    def silence(self, real: float) -> float:
        """Real time since the episode began or a moment was acted on, seconds.

        Args:
            real: monotonic real time, seconds.
        """
        return real - self._acted_at

    def present(self, inputs: SensorInputs) -> tuple[float, SensorInputs]:
        """Time and inputs as the episode gets them.

        Both count from its first moment, exact to the nanosecond, so that an episode does not
        depend on when it was begun. What the simulator has not sent yet since it began anew is
        left out. A message counts as arrived at the moment at which it is first presented.

        Args:
            inputs: the newest messages.

        Returns:
            Time, seconds, and inputs whose stamps are of that time.
        """
        moment, none = self.moment, SensorInputs()
        assert moment is not None
        if self.zero_ns is None:
            self.zero_ns = moment.stamp_ns - BEGIN_NS
            self._presented, self._came_ns = none, {}
        for name in inputs.arrived:
            if getattr(inputs, name) is not getattr(self._presented, name):
                self._came_ns[name] = moment.stamp_ns
        self._presented = inputs
        frame, estimate = inputs.frame, inputs.estimate
        odometry, tilt = inputs.odometry, inputs.tilt
        frame = replace(frame, stamp_ns=frame.stamp_ns - self.zero_ns)
        estimate = replace(estimate, stamp_ns=estimate.stamp_ns - self.zero_ns)
        odometry = replace(odometry, stamp=self._since_zero(odometry.stamp))
        tilt = replace(tilt, stamp=self._since_zero(tilt.stamp))
        inputs = replace(
            inputs,
            frame=frame if moment.image_ns else none.frame,
            estimate=estimate if moment.scan_ns else none.estimate,
            odometry=odometry if moment.odometry_ns else none.odometry,
            tilt=tilt if moment.odometry_ns else none.tilt,
            bumped_at=self._since_zero(inputs.bumped_at),
            arrived={name: (ns - self.zero_ns) * 1e-9 for name, ns in self._came_ns.items()},
        )
        return (moment.stamp_ns - self.zero_ns) * 1e-9, inputs

    def _since_zero(self, stamp: float) -> float:
        if stamp == NEVER:
            return NEVER
        return (round(stamp * 1e9) - (self.zero_ns or 0)) * 1e-9

    def lost(self, real: float) -> bool:
        """Whether the moment has been waited for in vain since the first call for it.

        Args:
            real: monotonic real time, seconds.
        """
        if self.moment is None:
            return False
        if self._waiting_from is None:
            self._waiting_from = real
        return real - self._waiting_from > LOST_S

    def act(self, real: float) -> Answer:
        """The moment's inputs were acted on: time may go on.

        Args:
            real: monotonic real time, seconds.
        """
        self._acted_at = real
        return self.answer(real)

    def answer(self, real: float) -> Answer:
        """Nothing more is waited for in this moment: time may go on.

        Args:
            real: monotonic real time, seconds.
        """
        assert self.moment is not None
        self._last, self._told_at = Answer(self.moment.stamp_ns, idle=False), real
        self.moment = None
        return self._last

    def say_idle(self, real: float) -> Answer | None:
        """No goal is served: the moment is kept for the next one. None when that was said.

        Args:
            real: monotonic real time, seconds.
        """
        if self.moment is None:
            return self.repeat(real)
        told = Answer(self.moment.stamp_ns, idle=True)
        if told == self._last:
            return self.repeat(real)
        self._last, self._told_at = told, real
        return told

    def repeat(self, real: float) -> Answer | None:
        """The last answer again after ``REPEAT_S`` without a new moment; else None."""
        if self._last is None or real - self._told_at < REPEAT_S:
            return None
        self._told_at = real
        return self._last
