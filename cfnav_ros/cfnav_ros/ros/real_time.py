"""When an episode goes on in real time: at the rate of velocities, and watched by a clock."""

from __future__ import annotations

import time
from concurrent.futures import Future
from typing import TYPE_CHECKING

from rclpy.clock import Clock, ClockType

from cfnav_ros.drive.clock_watch import Alarm, ClockWatch
from cfnav_ros.drive.episode import Episode
from cfnav_ros.drive.inputs import SensorInputs
from cfnav_ros.drive.motion import STOP
from cfnav_ros.drive.phases import Phase
from cfnav_ros.drive.policy_parameters import PolicyParameters

if TYPE_CHECKING:
    from cfnav_ros.ros.policy_node import PolicyNode

GUARD_PERIOD_S = 0.1
"""Real time between looks at whether node time still runs."""


class RealTime:
    """Updates the node's episode by a timer on node time, and stops the robot when that fails."""

    zero_ns = 0
    """Node time from which an episode's times count, nanoseconds."""

    def __init__(self, node: PolicyNode, settings: PolicyParameters) -> None:
        self._node = node
        self._clock_watch = ClockWatch(settings.clock_timeout, settings.episode.preflight_timeout)
        self._timer = node.create_timer(1.0 / settings.rate, self._tick, autostart=False)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(GUARD_PERIOD_S, self._watch_clock, clock=steady)
        self._answered = node.create_guard_condition(self.wake)

    @property
    def now_ns(self) -> int:
        """Node time, nanoseconds."""
        return self._node.get_clock().now().nanoseconds

    def present(self, inputs: SensorInputs) -> tuple[float, SensorInputs]:
        """Time, seconds, and inputs as the episode gets them: as they are."""
        return self.now_ns * 1e-9, inputs

    def begin(self) -> None:
        """An episode begins."""
        self._clock_watch.restart(time.monotonic())
        self._timer.reset()

    def end(self) -> None:
        """The episode is over."""
        self._timer.cancel()

    def follow(self, answer: Future) -> None:
        """Go on when the policy, in its own thread, has answered."""
        answer.add_done_callback(lambda _: self._answered.trigger())

    def wake(self) -> None:
        """Go on at once where the episode waits for what has just come; turns keep to the timer."""
        episode = self._node.episode
        if episode and episode.phase in (Phase.OBSERVE, Phase.THINK):
            self._tick()

    def _tick(self) -> None:
        episode = self._node.episode
        if episode is not None and not self._check_time(episode):
            self._node.update(episode)

    def _watch_clock(self) -> None:
        if self._node.episode is not None:
            self._check_time(self._node.episode)

    def _check_time(self, episode: Episode) -> bool:
        """Stop the robot when node time stands or jumps, which misleads every other watch.

        Returns:
            Whether that ended the episode for good.
        """
        watch = self._clock_watch
        alarm = watch.look(time.monotonic(), self.now_ns)
        if alarm >= Alarm.STOP:
            self._node.velocity.send(STOP)
        if alarm >= Alarm.FAIL:
            episode.fail(watch.reason)
            self._timer.reset()  # after a jump back it would sleep until the old time comes again
        if alarm >= Alarm.END:
            self._node.end(episode)
        return alarm >= Alarm.END
