"""When an episode goes on in lock-step: once a moment of a simulator, which stands until then."""

from __future__ import annotations

import time
from concurrent.futures import Future, wait
from typing import TYPE_CHECKING

from cfnav_interfaces.msg import Moment, MomentDone
from rclpy.clock import Clock, ClockType

from cfnav_core.robot.topics import TOPICS
from cfnav_ros.drive.episode import Episode
from cfnav_ros.drive.inputs import DETECTIONS, SensorInputs
from cfnav_ros.drive.lock_step import LOST_S, Answer, LockStep
from cfnav_ros.drive.motion import STOP
from cfnav_ros.drive.phases import Phase
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.ros import conversions
from cfnav_ros.ros.topics import publisher, quality

if TYPE_CHECKING:
    from cfnav_ros.ros.policy_node import PolicyNode

LOOK_PERIOD_S = 0.1
"""Real time between looks at a moment for which nothing comes."""


class Moments:
    """Updates the node's episode when all that belongs to a moment has come, and answers it."""

    def __init__(self, node: PolicyNode, settings: PolicyParameters) -> None:
        self._node = node
        self._lock_step = LockStep(settings.episode.lidar, settings.episode.has_tilt)
        self._preflight_timeout = settings.episode.preflight_timeout
        self._begun_at, self._missed = 0.0, list[str]()
        moment, steady = TOPICS["moment"], Clock(clock_type=ClockType.STEADY_TIME)
        self._done = publisher(node, TOPICS["moment_done"])
        node.create_subscription(Moment, moment.name, self._on_moment, quality(moment))
        node.create_timer(LOOK_PERIOD_S, self.wake, clock=steady)
        self._all_here = node.create_guard_condition(self._act)

    @property
    def zero_ns(self) -> int:
        """Simulated time from which the episode's times count, nanoseconds."""
        return self._lock_step.zero_ns or 0

    @property
    def now_ns(self) -> int:
        """Time of the moment that is acted on, otherwise node time; nanoseconds."""
        moment = self._lock_step.moment
        return moment.stamp_ns if moment else self._node.get_clock().now().nanoseconds

    def present(self, inputs: SensorInputs) -> tuple[float, SensorInputs]:
        """Time, seconds, and inputs as the episode gets them: see ``LockStep.present``."""
        return self._lock_step.present(inputs)

    def begin(self) -> None:
        """An episode begins."""
        self._begun_at, self._missed = time.monotonic(), []
        self._lock_step.restart(self._begun_at)

    def end(self) -> None:
        """The episode is over; moments come all the same."""

    def follow(self, answer: Future) -> None:
        """Wait for the policy: no time passes meanwhile."""
        wait([answer])

    def wake(self) -> None:
        """Act on the moment once all that belongs to it has come, base and publisher included."""
        node, step, real = self._node, self._lock_step, time.monotonic()
        episode = node.episode
        if episode is None:
            self._tell(step.say_idle(real))
            return
        node.check_base()
        patient = real - self._begun_at < self._preflight_timeout
        settled = not patient or node.senses.inputs.base.fault or node.velocity.matched
        if settled and step.complete(node.senses.inputs):
            # Triggered, not called: what else has arrived (bumps, states) is taken in first.
            self._all_here.trigger()
        elif step.silence(real) > self._patience(episode):
            self._give_up(episode)
        elif settled and step.lost(real):
            self._missed = step.missing(node.senses.inputs)
            node.get_logger().warning("Messages of a moment were lost: going on without them.")
            node.velocity.send(STOP)
            self._tell(step.answer(real))
        else:
            self._tell(step.repeat(real))

    def _on_moment(self, message: Moment) -> None:
        of_detections = self._node.senses.inputs.view == DETECTIONS
        self._lock_step.begin(conversions.moment_from_message(message, of_detections))
        self.wake()

    def _act(self) -> None:
        node, episode = self._node, self._node.episode
        if episode is None or not self._lock_step.complete(node.senses.inputs):
            return
        node.update(episode)
        if episode.phase is Phase.THINK:
            node.update(episode)  # the answer is there: ``follow`` waited for it
        self._missed = []
        self._tell(self._lock_step.act(time.monotonic()))

    def _give_up(self, episode: Episode) -> None:
        """End an episode for which the simulator's time does not go on."""
        senses = self._node.senses
        missing = self._lock_step.missing(senses.inputs) or self._missed
        topics = ", ".join(senses.topic(name) for name in missing)
        patience = self._patience(episode)
        self._node.heed_cancel(episode)
        episode.fail(
            f"No moment of a simulator came whole for {patience:g} s, as {topics} did not come: "
            "see what its sender says."
            if topics
            else f"No moment of a simulator came whole for {patience:g} s: has it ended, or is "
            "lock_step set on a robot?"
        )
        self._node.velocity.send(STOP)
        self._node.end(episode)

    def _patience(self, episode: Episode) -> float:
        """How long an episode waits for a moment, real seconds."""
        ending = episode.outcome or self._node.goals.canceled
        return LOST_S if ending else self._preflight_timeout

    def _tell(self, answer: Answer | None) -> None:
        if answer is not None:
            stamp = conversions.ns_to_stamp(answer.stamp_ns)
            self._done.publish(MomentDone(stamp=stamp, idle=answer.idle))
