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
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import rclpy
from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import CollisionEstimate, EpisodeStatus, PolicyDecision
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import HazardDetectionVector
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Float64

from cfnav_core.policy import BundleError, Policy
from cfnav_ros import conversions
from cfnav_ros.clock_watch import ClockWatch, Standstill
from cfnav_ros.episode import Episode, Phase, StepRecord
from cfnav_ros.inputs import Inputs
from cfnav_ros.motion import STOP, Command
from cfnav_ros.parameters import PolicyParameters, declare
from cfnav_ros.preflight import STAMPED, check_base
from cfnav_ros.stop_signal import StopSignal

GUARD_PERIOD_S = 0.1
"""Real time between looks at whether node time still runs."""

BASE_CHECK_S = 0.5
"""Real time between looks at who else is on cmd_vel."""

BURST_S = 0.6
"""How long zeros are sent before the process ends: a base may miss single ones."""


@dataclass(frozen=True)
class Run:
    """The goal that is being served and its episode."""

    goal: ServerGoalHandle
    episode: Episode


class PolicyNode(Node):
    """Serves ``navigate_to_object`` with one policy on one base."""

    def __init__(self) -> None:
        super().__init__("policy_node", automatically_declare_parameters_from_overrides=True)
        self._settings = declare(self, PolicyParameters)
        self._policy = Policy.load(self._settings.bundle or None)
        self._worker = ThreadPoolExecutor(1, "policy")
        self._run: Run | None = None
        self._next: ServerGoalHandle | None = None
        self._inputs = Inputs()
        self._velocity: Publisher | None = None
        self._closing = False
        self._base_checked_at = 0.0
        self._clock_watch = ClockWatch(
            self._settings.clock_timeout, self._settings.episode.preflight_timeout
        )
        self._create_publishers()
        self._create_subscriptions()
        self._timer = self.create_timer(1.0 / self._settings.rate, self._tick, autostart=False)
        self._guard = self.create_timer(
            GUARD_PERIOD_S, self._watch_clock, clock=Clock(clock_type=ClockType.STEADY_TIME),
            autostart=False,
        )  # fmt: skip
        self._answered = self.create_guard_condition(self._poke)
        self._server = ActionServer(
            self,
            NavigateToObject,
            "navigate_to_object",
            execute_callback=self._settle_goal,
            goal_callback=self._admit,
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
        self._announce()

    # Topics

    def _create_publishers(self) -> None:
        self._decisions = self.create_publisher(PolicyDecision, "policy/decision", 50)
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._episodes = self.create_publisher(EpisodeStatus, "policy/episode", latched)
        self._tilts = self.create_publisher(Float64, "camera_tilt/command", 10)

    def _create_subscriptions(self) -> None:
        newest = qos_profile_sensor_data
        only_newest = QoSProfile(depth=1, reliability=newest.reliability)
        image_topic = self._settings.image_topic
        self._images = self.create_subscription(Image, image_topic, self._on_image, only_newest)
        self.create_subscription(CollisionEstimate, "collision/estimate", self._on_estimate, 5)
        self.create_subscription(Odometry, "odom", self._on_odometry, newest)
        self.create_subscription(JointState, "joint_states", self._on_joints, newest)
        self.create_subscription(
            HazardDetectionVector, "hazard_detection", self._on_hazards, newest
        )

    def _announce(self) -> None:
        episode = self._settings.episode
        probability = "collision/estimate" if episode.lidar else "the bundle's own predictor"
        self.get_logger().info(
            f"Bundle {self._policy.name} drives. Pictures from {self._images.topic_name}, "
            f"collision probability from {probability}, LiDAR veto "
            f"{'on' if episode.lidar and episode.veto else 'off'}, velocities to "
            f"{self.resolve_topic_name('cmd_vel')}. "
            f"Goals: {', '.join(self._policy.goals)}."
        )

    def _on_image(self, message: Image) -> None:
        self._take("frame", conversions.frame_from_message, message)
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

    def _take(self, name: str, convert: Callable[..., Any], *message: Any) -> None:
        """Keep a message; one that makes no sense is left out, so that its input grows old."""
        try:
            value = convert(*message)
        except ValueError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=2.0)
        else:
            if value is not None:  # None: it speaks of something else
                self._inputs = replace(self._inputs, **{name: value})

    # Goals

    def _admit(self, _: NavigateToObject.Goal) -> GoalResponse:
        # A goal that cannot be met is accepted and then refused: only a result carries a sentence.
        return GoalResponse.REJECT if self._closing else GoalResponse.ACCEPT

    def _accept(self, goal: ServerGoalHandle) -> None:
        if self._run is None:
            self._begin(goal)
            return
        self._run.episode.finish("preempted", "A newer goal came.")
        if self._next is not None:
            self._resolve(self._next, NavigateToObject.Result(
                outcome="preempted", message="A newer goal came."))  # fmt: skip
        self._next = goal

    def _begin(self, goal: ServerGoalHandle) -> None:
        request, limits = goal.request, self._settings.episode
        if request.max_steps:
            limits = replace(limits, max_steps=request.max_steps)
        episode = Episode(
            request.goal, self._policy, self._submit, limits, time_limit=request.time_limit
        )
        self._run = Run(goal, episode)
        self._clock_watch.restart(time.monotonic())
        self._base_checked_at = 0.0
        self._timer.reset()
        self._guard.reset()
        self._publish_status(episode, EpisodeStatus.STARTED)
        self.get_logger().info(f"Looking for {request.goal}.")

    def _end(self, run: Run) -> None:
        """Tell everybody how the episode ended and take the next goal, if any."""
        episode = run.episode
        self._timer.cancel()
        self._guard.cancel()
        self._publish_status(episode, EpisodeStatus.ENDED)
        self.get_logger().info(
            f"{episode.goal}: {episode.outcome} after {episode.steps} decisions. {episode.message}"
        )
        self._resolve(run.goal, conversions.result(episode))
        self._run = None
        if self._next is not None:
            goal, self._next = self._next, None
            self._begin(goal)

    def _resolve(self, goal: ServerGoalHandle, result: NavigateToObject.Result) -> None:
        # Executed only now that the result is known: a coroutine that waits for it would keep
        # rclpy's executor spinning, a blocking callback would cost a thread.
        goal.execute(partial(self._settle_goal, result=result))

    def _settle_goal(
        self, goal: ServerGoalHandle, result: NavigateToObject.Result
    ) -> NavigateToObject.Result:
        if result.outcome == "done":
            goal.succeed()
        elif result.outcome == "canceled":
            goal.canceled()
        else:
            goal.abort()
        return result

    # Driving

    def _submit(self, function: Any, *args: Any) -> Future:
        future = self._worker.submit(function, *args)
        future.add_done_callback(lambda _: self._answered.trigger())
        return future

    def _poke(self) -> None:
        """Go on at once where the episode waits for what has just come; turns keep to the timer."""
        if self._run and self._run.episode.phase in (Phase.OBSERVE, Phase.THINK):
            self._tick()

    def _tick(self) -> None:
        run = self._run
        if run is None:
            return
        if run.goal.is_cancel_requested:
            run.episode.finish("canceled", "The client canceled the goal.")
        self._check_base()
        now = self.get_clock().now()
        output = run.episode.update(now.nanoseconds * 1e-9, self._inputs)
        self._drive(output.command)
        if output.tilt is not None:
            self._tilts.publish(Float64(data=output.tilt))
        if output.record is not None:
            self._report(run, output.record)
        if run.episode.ended:
            self._end(run)

    def _drive(self, command: Command) -> None:
        if self._velocity is None:
            return
        if self._velocity.msg_type is Twist:
            self._velocity.publish(conversions.twist(command))
            return
        now = self.get_clock().now().to_msg()
        frame = self._settings.base_frame
        self._velocity.publish(conversions.twist_stamped(command, now, frame))

    def _check_base(self) -> None:
        """Look who is on cmd_vel, and make the publisher that its listener understands."""
        if time.monotonic() - self._base_checked_at < BASE_CHECK_S:
            return
        self._base_checked_at = time.monotonic()
        topic = self.resolve_topic_name("cmd_vel")
        infos = self.get_publishers_info_by_topic(topic)
        publishers = [(info.node_namespace, info.node_name) for info in infos]
        me = (self.get_namespace(), self.get_name())
        if self._velocity is not None and me in publishers:
            publishers.remove(me)
        base = check_base(
            topic,
            conversions.endpoints(self.get_subscriptions_info_by_topic(topic)),
            [name for _, name in publishers],
            self._settings.cmd_vel_type,
            self._settings.allow_robot,
            self._settings.other_publishers.split(),
        )
        self._inputs = replace(self._inputs, base=base)
        if base.ready:
            self._speak(TwistStamped if base.type == STAMPED else Twist)

    def _speak(self, kind: type) -> None:
        if self._velocity is not None:
            if self._velocity.msg_type is kind:
                return
            self.destroy_publisher(self._velocity)
        self._velocity = self.create_publisher(kind, "cmd_vel", 1)
        self.get_logger().info(f"Sending {kind.__name__} to {self._velocity.topic_name}.")

    def _watch_clock(self) -> None:
        """Stop the robot when node time stands still, which stops every other watch."""
        run = self._run
        if run is None:
            return
        standstill = self._clock_watch.look(time.monotonic(), self.get_clock().now().nanoseconds)
        if standstill >= Standstill.STOP:
            self._drive(STOP)
        if standstill >= Standstill.FAIL:
            run.episode.fail("Node time stands still: is /clock published?")
        if standstill >= Standstill.END:
            self._end(run)

    # Reports

    def _report(self, run: Run, record: StepRecord) -> None:
        """Publish a decision before it is executed."""
        now = self.get_clock().now().to_msg()
        self._decisions.publish(conversions.decision(record, run.episode.goal, now))
        run.goal.publish_feedback(conversions.feedback(record, run.episode.track.path_length))

    def _publish_status(self, episode: Episode, phase: int) -> None:
        now = self.get_clock().now().to_msg()
        self._episodes.publish(conversions.status(episode, phase, self._policy.name, now))

    def shut_down(self, wait: Callable[[float], None]) -> None:
        """Send zeros for long enough to arrive, end a running episode, and let the policy finish.

        Args:
            wait: spends at most so many seconds, if possible serving what is still asked for.
        """
        self._closing = True
        end = time.monotonic() + BURST_S
        if self._run is not None:
            self._next = None
            self._run.episode.fail("The policy node was stopped.")
            self._end(self._run)
        while self._velocity is not None and time.monotonic() < end:
            self._drive(STOP)
            wait(0.05)
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
