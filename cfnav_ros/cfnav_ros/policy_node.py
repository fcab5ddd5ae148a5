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
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import rclpy
from cfnav_interfaces.msg import CollisionEstimate, EpisodeStatus, PolicyDecision
from diagnostic_msgs.msg import DiagnosticArray
from irobot_create_msgs.msg import DockStatus, HazardDetectionVector, WheelStatus
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Float64

from cfnav_core.policy import BundleError, Policy
from cfnav_ros import conversions
from cfnav_ros.clock_watch import Alarm, ClockWatch
from cfnav_ros.diagnostics import (
    Rate,
    Stopwatch,
    base_report,
    episode_report,
    inference_report,
    input_reports,
)
from cfnav_ros.episode import Episode, Phase, StepRecord
from cfnav_ros.goals import Goal, Goals
from cfnav_ros.inputs import Inputs
from cfnav_ros.motion import STOP
from cfnav_ros.parameters import PolicyParameters, declare
from cfnav_ros.picture_watch import PictureWatch
from cfnav_ros.preflight import explain_silence
from cfnav_ros.stop_signal import StopSignal
from cfnav_ros.velocity import Velocity

GUARD_PERIOD_S = 0.1
"""Real time between looks at whether node time still runs."""

DIAGNOSTICS_S = 1.0
"""Real time between two messages on /diagnostics."""

BURST_S = 0.6
"""How long zeros are sent before the process ends: a base may miss single ones."""


class PolicyNode(Node):
    """Serves ``navigate_to_object`` and ``policy/goal`` with one policy on one base.

    A plain node, not a lifecycle one: it does nothing to the base before a goal comes, so an
    "inactive" state would only add two calls to what a user must do first.
    """

    def __init__(self) -> None:
        super().__init__("policy_node", automatically_declare_parameters_from_overrides=True)
        settings = self._settings = declare(self, PolicyParameters)
        self._policy = Policy.load(settings.bundle or None)
        self._worker = ThreadPoolExecutor(1, "policy")
        self._episode: Episode | None = None
        self._inputs = Inputs()
        self._heard: set[str] = set()
        self._velocity = Velocity(self, settings)
        self._pictures = PictureWatch(settings.frozen_picture_time)
        self._clock_watch = ClockWatch(settings.clock_timeout, settings.episode.preflight_timeout)
        self._create_publishers()
        self._create_subscriptions()
        self._timer = self.create_timer(1.0 / settings.rate, self._tick, autostart=False)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._guard = self.create_timer(
            GUARD_PERIOD_S, self._watch_clock, clock=steady, autostart=False
        )
        self._rates = {name: Rate() for name in self._listeners}
        self._inferences = Stopwatch()
        self.create_timer(DIAGNOSTICS_S, self._diagnose, clock=steady)
        self._answered = self.create_guard_condition(self._poke)
        self._goals = Goals(self, self._begin, self._preempt)
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

    def _create_subscriptions(self) -> None:
        subscribe, newest = self.create_subscription, qos_profile_sensor_data
        only_newest = QoSProfile(depth=1, reliability=newest.reliability)
        image_topic = self._settings.image_topic
        self._listeners = {
            "frame": subscribe(Image, image_topic, self._on_image, only_newest),
            "estimate": subscribe(CollisionEstimate, "collision/estimate", self._on_estimate, 5),
            "odometry": subscribe(Odometry, "odom", self._on_odometry, newest),
            "tilt": subscribe(JointState, "joint_states", self._on_joints, newest),
        }
        subscribe(HazardDetectionVector, "hazard_detection", self._on_hazards, newest)
        subscribe(DockStatus, "dock_status", self._on_dock, newest)
        subscribe(WheelStatus, "wheel_status", self._on_wheels, newest)

    def _announce(self) -> None:
        episode = self._settings.episode
        probability = "collision/estimate" if episode.lidar else "the bundle's own predictor"
        veto = "on" if episode.lidar and episode.veto else "off"
        self.get_logger().info(
            f"Bundle {self._policy.name} drives. Pictures from "
            f"{self._listeners['frame'].topic_name}, collision probability from {probability}, "
            f"LiDAR veto {veto}, velocities to {self._velocity.topic}. "
            f"Goals: {', '.join(self._policy.goals)}."
        )

    def _on_image(self, message: Image) -> None:
        self._take("frame", conversions.frame_from_message, message)
        inputs = self._inputs
        picture = self._pictures.look(inputs.frame, inputs.odometry, inputs.tilt)
        self._inputs = replace(inputs, picture=picture)
        self._poke()

    def _on_estimate(self, message: CollisionEstimate) -> None:
        self._take("estimate", conversions.estimate_from_message, message)
        self._poke()

    def _on_odometry(self, message: Odometry) -> None:
        self._take("odometry", conversions.odometry_from_message, message)

    def _on_joints(self, message: JointState) -> None:
        self._take("tilt", conversions.tilt_from_message, message, self._settings.tilt_joint)

    def _on_hazards(self, message: HazardDetectionVector) -> None:
        self._take("bumped_at", conversions.bump_from_message, message)
        self._take("front_bumped_at", conversions.front_bump_from_message, message)

    def _on_dock(self, message: DockStatus) -> None:
        self._inputs = replace(self._inputs, docked=message.is_docked)

    def _on_wheels(self, message: WheelStatus) -> None:
        self._inputs = replace(self._inputs, powered=message.wheels_enabled)

    def _take(self, name: str, convert: Callable[..., Any], *message: Any) -> None:
        """Keep a message; one that makes no sense is left out, so that its input grows old."""
        inputs, notes = self._inputs, {**self._inputs.notes}
        notes.pop(name, None)
        self._heard.add(name)
        if name in self._rates:
            self._rates[name].note(time.monotonic())
        try:
            value = convert(*message)
        except ValueError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=2.0)
            notes[name] = str(error).rstrip(".")
            self._inputs = replace(inputs, notes=notes)
            return
        if value is not None:  # None: it speaks of something else
            arrived = {**inputs.arrived, name: self.get_clock().now().nanoseconds * 1e-9}
            self._inputs = replace(inputs, **{name: value}, arrived=arrived, notes=notes)

    def _explain_silence(self) -> dict[str, str]:
        """The notes on inputs, with what the graph says about those that have never come."""
        notes, names = {**self._inputs.notes}, ()
        for name, listener in self._listeners.items():
            if name in self._heard:
                continue
            topic, expected = listener.topic_name, conversions.type_name(listener.msg_type)
            names = names or [name for name, _ in self.get_topic_names_and_types()]
            sources = conversions.sources(self.get_publishers_info_by_topic(topic), listener)
            below = [name for name in names if name.startswith(f"{topic}/")]
            notes[name] = explain_silence(topic, expected, sources, below)
        return notes

    # Goals

    def _begin(self, goal: Goal) -> None:
        limits = self._settings.episode
        if goal.max_steps:
            limits = replace(limits, max_steps=goal.max_steps)
        self._episode = Episode(
            goal.name, self._policy, self._submit, limits, time_limit=goal.time_limit
        )
        self._clock_watch.restart(time.monotonic())
        self._velocity.restart()
        self._timer.reset()
        self._guard.reset()
        self._publish_status(self._episode, EpisodeStatus.STARTED)
        self.get_logger().info(f"Looking for {goal.name}.")

    def _preempt(self, reason: str) -> None:
        if self._episode is not None:
            self._episode.finish("preempted", reason)

    def _end(self, episode: Episode) -> None:
        """Tell everybody how the episode ended and take the next goal, if any."""
        self._timer.cancel()
        self._guard.cancel()
        self._episode = None
        self._publish_status(episode, EpisodeStatus.ENDED)
        self.get_logger().info(
            f"{episode.goal}: {episode.outcome} after {episode.steps} decisions. {episode.message}"
        )
        self._goals.end(conversions.result(episode))

    # Driving

    def _submit(self, function: Any, *args: Any) -> Future:
        future = self._worker.submit(self._inferences.timed(function), *args)
        future.add_done_callback(lambda _: self._answered.trigger())
        return future

    def _poke(self) -> None:
        """Go on at once where the episode waits for what has just come; turns keep to the timer."""
        if self._episode and self._episode.phase in (Phase.OBSERVE, Phase.THINK):
            self._tick()

    def _tick(self) -> None:
        episode = self._episode
        if episode is None:
            return
        self._check_time(episode)
        base = self._velocity.check()
        if base is not None:
            self._inputs = replace(self._inputs, base=base, notes=self._explain_silence())
        output = episode.update(self.get_clock().now().nanoseconds * 1e-9, self._inputs)
        canceled = self._goals.canceled
        if canceled:  # after the update: what goes wrong in the same moment is said first
            episode.finish("canceled", "The goal was canceled.")
        self._velocity.send(STOP if canceled else output.command)
        if output.tilt is not None:
            self._tilts.publish(Float64(data=output.tilt))
        if output.record is not None:
            self._report(episode, output.record)
        if episode.ended:
            self._end(episode)

    def _watch_clock(self) -> None:
        if self._episode is not None:
            self._check_time(self._episode)

    def _check_time(self, episode: Episode) -> None:
        """Stop the robot when node time stands still or leaps, which misleads every other watch."""
        watch = self._clock_watch
        alarm = watch.look(time.monotonic(), self.get_clock().now().nanoseconds)
        if alarm >= Alarm.STOP:
            self._velocity.send(STOP)
        if alarm >= Alarm.FAIL:
            episode.fail(watch.reason)
        if alarm >= Alarm.END:
            self._end(episode)

    # Reports

    def _report(self, episode: Episode, record: StepRecord) -> None:
        """Publish a decision before it is executed."""
        now = self.get_clock().now().to_msg()
        self._decisions.publish(conversions.decision(record, episode.goal, now))
        goal = self._goals.current
        if goal is not None:
            goal.tell(conversions.feedback(record, episode.track.path_length))

    def _publish_status(self, episode: Episode, phase: int) -> None:
        now = self.get_clock().now().to_msg()
        self._episodes.publish(conversions.status(episode, phase, self._policy.name, now))

    def _diagnose(self) -> None:
        now, real, limits = self.get_clock().now(), time.monotonic(), self._settings.episode
        rates = {name: rate.hz(real) for name, rate in self._rates.items()}
        velocity, inputs = self._velocity, self._inputs
        reports = (
            *input_reports(
                now.nanoseconds * 1e-9, inputs, limits.ages, rates, limits.lidar, limits.has_tilt
            ),
            episode_report(self._episode),
            inference_report(*self._inferences.percentiles_ms(), limits.think_timeout),
            base_report(
                inputs, velocity.topic, velocity.type, velocity.largest_gap, bool(self._episode)
            ),
        )
        name = self.get_fully_qualified_name()
        self._diagnostics.publish(conversions.diagnostics(reports, name, now.to_msg()))

    # The end

    def shut_down(self, wait: Callable[[float], None]) -> None:
        """Send zeros for long enough to arrive, end a running episode, and let the policy finish.

        Args:
            wait: spends at most so many seconds, if possible serving what is still asked for.
        """
        self._velocity.send(STOP)
        self._goals.close()
        end = time.monotonic() + BURST_S
        if self._episode is not None:
            self._episode.fail("The policy node was stopped.")
            self._end(self._episode)
        while self._velocity.speaks and time.monotonic() < end:
            self._velocity.send(STOP)
            try:
                wait(0.05)
            except Exception:  # another callback fails: the robot must be stopped all the same
                traceback.print_exc()
                wait = time.sleep
        self._worker.shutdown(wait=True, cancel_futures=True)


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; the robot's last command is zero in any case.

    Args:
        args: command line, ``sys.argv`` when None.

    Returns:
        0 when told to end, 1 when a callback failed, 2 when bundle or parameters cannot be used.
    """
    stop = StopSignal()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = PolicyNode()
    except (ValueError, RuntimeError, BundleError) as error:
        print(f"policy_node: {error}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    wait: Callable[[float], None] = executor.spin_once
    try:
        while not stop:
            executor.spin_once(timeout_sec=0.1)
        return 0
    except Exception:
        traceback.print_exc()
        wait = time.sleep
        return 1
    finally:
        node.shut_down(wait)
        rclpy.try_shutdown()


if __name__ == "__main__":
    sys.exit(main())
