"""Picture, collision estimate and odometry -> velocities: the policy on a robot.

Run it with ``python -m cfnav_ros.policy_node``; its parameters are those of
``parameters.PolicyParameters``. Everything that decides is in ``episode``; this node converts,
calls and publishes. One thread runs all callbacks, a second one only the policy, so that a slow
inference never delays a velocity.
"""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import replace
from typing import Any

from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import EpisodeStatus, Moment, MomentDone, PolicyDecision
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64

from cfnav_core.policy import Policy
from cfnav_ros import conversions
from cfnav_ros.clock_watch import Alarm, ClockWatch
from cfnav_ros.diagnostics import (
    Stopwatch,
    base_report,
    episode_report,
    inference_report,
    input_reports,
    status_reports,
)
from cfnav_ros.episode import Episode, Phase, StepRecord
from cfnav_ros.goals import Goal, Goals
from cfnav_ros.lock_step import LOST_S, Answer, LockStep
from cfnav_ros.motion import STOP
from cfnav_ros.node_process import run_node
from cfnav_ros.parameters import declare
from cfnav_ros.policy_parameters import PolicyParameters
from cfnav_ros.senses import Senses
from cfnav_ros.velocity import Velocity

GUARD_PERIOD_S = 0.1
"""Real time between looks at whether node time still runs."""

DIAGNOSTICS_S = 1.0
"""Real time between two messages on /diagnostics."""

CANCELED = "The goal was canceled."

BURST_S = 0.6
"""How long zeros are sent before the process ends: a base may miss single ones."""


class PolicyNode(Node):
    """Serves ``navigate_to_object`` and ``policy/goal`` with one policy on one base.

    A plain node, not a lifecycle one: it does nothing to the base before a goal comes, so an
    "inactive" state would only add two calls to what a user must do first.
    """

    def __init__(self) -> None:
        super().__init__("policy_node", automatically_declare_parameters_from_overrides=True)
        settings = self._settings = declare(self, PolicyParameters, self._adopt)
        sample_seed = None if settings.sample_seed < 0 else settings.sample_seed
        self._policy = Policy.load(settings.bundle or None, settings.backend, sample_seed)
        self._worker = ThreadPoolExecutor(1, "policy")
        self._episode: Episode | None = None
        self._begun_at = 0.0
        self._velocity = Velocity(self, settings)
        self._lock_step = (
            LockStep(settings.episode.lidar, settings.episode.has_tilt)
            if settings.lock_step
            else None
        )
        self._senses = Senses(self, settings, self._poke)
        self._clock_watch = ClockWatch(settings.clock_timeout, settings.episode.preflight_timeout)
        self._create_publishers()
        self._timer = self.create_timer(1.0 / settings.rate, self._tick, autostart=False)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        watch = self._advance if self._lock_step else self._watch_clock
        self.create_timer(GUARD_PERIOD_S, watch, clock=steady)
        self._inferences = Stopwatch()
        self.create_timer(DIAGNOSTICS_S, self._diagnose, clock=steady)
        self._answered = self.create_guard_condition(self._poke)
        self._all_here = self.create_guard_condition(self._act_on_moment)
        self._goals = Goals(self, self._begin, self._preempt, self._tell_unserved)
        self._announce()
        if settings.goal:
            self._goals.add(Goal(settings.goal))

    # Topics

    def _create_publishers(self) -> None:
        self._decisions = self.create_publisher(PolicyDecision, "policy/decision", 50)
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._episodes = self.create_publisher(EpisodeStatus, "policy/episode", latched)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._tilts = self.create_publisher(Float64, "camera_tilt/command", 10)
        if self._lock_step:
            latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self._moments_done = self.create_publisher(MomentDone, "simulator/moment_done", latched)
            self.create_subscription(Moment, "simulator/moment", self._on_moment, latched)

    def _announce(self) -> None:
        episode = self._settings.episode
        probability = {
            "lidar": "collision/estimate", "own": "the bundle's own predictor",
            "both": "the larger of collision/estimate and the bundle's own predictor",
            "zero": "nowhere (zero)", "shuffled": "collision/estimate of any decision so far",
        }[episode.p_hat]  # fmt: skip
        veto = "on" if episode.veto else "off"
        seed = self._settings.sample_seed
        drawn = "" if seed < 0 else f", actions drawn with seed {seed}"
        self.get_logger().info(
            f"Bundle {self._policy.name} drives, run by {self._settings.backend}{drawn}. "
            f"Pictures from {self._senses.image_topic}, collision probability from "
            f"{probability}, LiDAR veto {veto}, velocities to {self._velocity.topic}. "
            f"Goals: {', '.join(self._policy.goals)}."
        )

    # Goals

    def _adopt(self, settings: PolicyParameters) -> None:
        """Take changed parameters at once."""
        self._settings = settings
        if self._episode is not None:
            self._episode.adopt(settings.episode)

    def _begin(self, goal: Goal) -> None:
        limits = self._settings.episode
        if goal.max_steps:
            limits = replace(limits, max_steps=goal.max_steps)
        self._episode = Episode(
            goal.name, self._policy, self._submit, limits, time_limit=goal.time_limit
        )
        self._begun_at = time.monotonic()
        self._clock_watch.restart(self._begun_at)
        self._velocity.restart()
        if self._lock_step:
            self._lock_step.restart(self._begun_at)
        else:
            self._timer.reset()
        self._publish_status(self._episode, EpisodeStatus.STARTED)
        self.get_logger().info(f"Looking for {goal.name}.")

    def _preempt(self, reason: str) -> None:
        if self._episode is not None:
            self._episode.finish("preempted", reason)

    def _tell_unserved(self, goal: Goal, given_up: NavigateToObject.Result) -> None:
        now = conversions.ns_to_stamp(self._now_ns())
        self._episodes.publish(conversions.unserved(goal.name, given_up, self._policy.name, now))

    def _end(self, episode: Episode) -> None:
        """Tell everybody how the episode ended and take the next goal, if any."""
        self._timer.cancel()
        self._episode = None
        self._publish_status(episode, EpisodeStatus.ENDED)
        self.get_logger().info(
            f"{episode.goal}: {episode.outcome} after {episode.steps} decisions. {episode.message}"
        )
        self._goals.end(conversions.result(episode))

    # Driving

    def _submit(self, function: Any, *args: Any) -> Future:
        future = self._worker.submit(self._inferences.timed(function), *args)
        if self._lock_step:
            wait([future])
        else:
            future.add_done_callback(lambda _: self._answered.trigger())
        return future

    def _poke(self) -> None:
        """Go on at once where the episode waits for what has just come; turns keep to the timer."""
        if self._lock_step:
            self._advance()
        elif self._episode and self._episode.phase in (Phase.OBSERVE, Phase.THINK):
            self._tick()

    def _tick(self) -> None:
        if self._episode is not None and not self._check_time(self._episode):
            self._update(self._episode)

    def _update(self, episode: Episode) -> None:
        self._check_base()
        t, inputs = self._now_ns() * 1e-9, self._senses.inputs
        if self._lock_step:
            t, inputs = self._lock_step.present(inputs)
        begins = episode.phase is Phase.PREFLIGHT
        output = episode.update(t, inputs)
        if begins and episode.phase is not Phase.PREFLIGHT and not episode.ended:
            self._warn_of_hazards()
        canceled = self._goals.canceled
        if canceled:  # after the update: what goes wrong in the same moment is said first
            episode.finish("canceled", CANCELED)
        self._velocity.send(STOP if canceled else output.command)
        if output.tilt is not None:
            self._tilts.publish(Float64(data=output.tilt))
        if output.record is not None:
            self._report(episode, output.record)
        if episode.ended:
            self._end(episode)

    def _warn_of_hazards(self) -> None:
        if "hazards" not in self._senses.heard:
            self.get_logger().warning(
                f"{self.resolve_topic_name('hazard_detection')}: not heard. The robot drives "
                "without its bumper, and the result counts no bumps. On a TurtleBot 4 enable it in "
                "the republisher's list."
            )

    def _check_base(self) -> None:
        base = self._velocity.check()
        if base is not None:
            self._senses.notice_base(base)

    def _watch_clock(self) -> None:
        if self._episode is not None:
            self._check_time(self._episode)

    def _check_time(self, episode: Episode) -> bool:
        """Stop the robot when node time stands or jumps, which misleads every other watch.

        Returns:
            Whether that ended the episode for good.
        """
        watch = self._clock_watch
        alarm = watch.look(time.monotonic(), self.get_clock().now().nanoseconds)
        if alarm >= Alarm.STOP:
            self._velocity.send(STOP)
        if alarm >= Alarm.FAIL:
            episode.fail(watch.reason)
            self._timer.reset()  # after a jump back it would sleep until the old time comes again
        if alarm >= Alarm.END:
            self._end(episode)
        return alarm >= Alarm.END

    def _now_ns(self) -> int:
        moment = self._lock_step.moment if self._lock_step else None
        return moment.stamp_ns if moment else self.get_clock().now().nanoseconds

    # Lock-step: the simulator stands until its moment is answered

    def _on_moment(self, message: Moment) -> None:
        self._lock_step.begin(conversions.moment_from_message(message))
        self._advance()

    def _advance(self) -> None:
        """Act on the moment once all that belongs to it has come, base and publisher included."""
        step, real = self._lock_step, time.monotonic()
        if self._episode is None:
            self._tell(step.say_idle(real))
            return
        self._check_base()
        patient = real - self._begun_at < self._settings.episode.preflight_timeout
        settled = not patient or self._senses.inputs.base.fault or self._velocity.matched
        if settled and step.complete(self._senses.inputs):
            # Triggered, not called: what else has arrived (bumps, states) is taken in first.
            self._all_here.trigger()
        elif step.silence(real) > self._patience(self._episode):
            self._give_up(self._episode)
        elif settled and step.lost(real):
            self.get_logger().warning("Messages of a moment were lost: going on without them.")
            self._velocity.send(STOP)
            self._tell(step.answer(real))
        else:
            self._tell(step.repeat(real))

    def _act_on_moment(self) -> None:
        step, episode = self._lock_step, self._episode
        if episode is None or not step.complete(self._senses.inputs):
            return
        self._update(episode)
        if episode.phase is Phase.THINK:
            self._update(episode)  # the answer is there: _submit waited for it
        self._tell(step.act(time.monotonic()))

    def _give_up(self, episode: Episode) -> None:
        """End an episode for which the simulator's time does not go on."""
        if self._goals.canceled:
            episode.finish("canceled", CANCELED)
        episode.fail(
            f"No moment of a simulator came whole for {self._patience(episode):g} s: has it ended, "
            "or is lock_step set on a robot?"
        )
        self._velocity.send(STOP)
        self._end(episode)

    def _patience(self, episode: Episode) -> float:
        """How long an episode in lock-step waits for a moment, real seconds."""
        ending = episode.outcome or self._goals.canceled
        return LOST_S if ending else self._settings.episode.preflight_timeout

    def _tell(self, answer: Answer | None) -> None:
        if answer is not None:
            stamp = conversions.ns_to_stamp(answer.stamp_ns)
            self._moments_done.publish(MomentDone(stamp=stamp, idle=answer.idle))

    # Reports

    def _report(self, episode: Episode, record: StepRecord) -> None:
        """Publish a decision before it is executed."""
        now = conversions.ns_to_stamp(self._now_ns())
        zero_ns = (self._lock_step.zero_ns or 0) if self._lock_step else 0
        frame = self._settings.base_frame
        self._decisions.publish(conversions.decision(record, episode.goal, now, zero_ns, frame))
        goal = self._goals.current
        if goal is not None:
            goal.tell(conversions.feedback(record, episode.track.path_length))

    def _publish_status(self, episode: Episode, phase: int) -> None:
        now = conversions.ns_to_stamp(self._now_ns())
        self._episodes.publish(conversions.status(episode, phase, self._policy.name, now))

    def _diagnose(self) -> None:
        now, limits = self.get_clock().now(), self._settings.episode
        velocity, inputs, t = self._velocity, self._senses.inputs, now.nanoseconds * 1e-9
        needed = (limits.lidar, limits.has_tilt)
        reports = (
            *input_reports(t, inputs, limits.ages, self._senses.rates(), *needed),
            *status_reports(self._senses.heard),
            episode_report(self._episode),
            inference_report(*self._inferences.percentiles_ms(), limits.think_timeout),
            base_report(
                inputs, velocity.topic, velocity.type, velocity.largest_gap, bool(self._episode)
            ),
        )
        name = self.get_fully_qualified_name()
        self._diagnostics.publish(conversions.diagnostics(reports, name, now.to_msg()))

    # The end

    def shut_down(self, executor: Executor) -> None:
        """Send zeros for long enough to arrive, end a running episode, and let the policy finish.

        Args:
            executor: serves what is still asked for meanwhile.
        """
        spend: Callable[[float], None] = executor.spin_once
        self._velocity.send(STOP)
        owed = self._velocity.speaks or self._goals.current is not None  # zeros, or a result
        self._goals.close()
        end = time.monotonic() + BURST_S
        if self._episode is not None:
            self._episode.fail("The policy node was stopped.")
            self._end(self._episode)
        while owed and time.monotonic() < end:
            self._velocity.send(STOP)
            try:
                spend(0.05)
            except Exception:  # another callback fails: the robot must be stopped all the same
                traceback.print_exc()
                spend = time.sleep
        self._worker.shutdown(wait=True, cancel_futures=True)


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; the robot's last command is zero in any case.

    Args:
        args: command line, ``sys.argv`` when None.

    Returns:
        0 when told to end, 1 when a callback failed, 2 when bundle or parameters cannot be used.
    """
    return run_node("policy_node", PolicyNode, args, PolicyNode.shut_down)


if __name__ == "__main__":
    sys.exit(main())
