"""Picture, collision estimate and odometry -> velocities: the policy on a robot.

Run it with ``cfnav node policy``; its parameters are those of
``drive.policy_parameters.PolicyParameters``. Everything that decides is in ``episode``; this node
converts, calls and publishes. When it does so says ``real_time``, or ``moments`` in lock-step with
a simulator. One thread runs all callbacks, a second one only the policy, so that a slow inference
never delays a velocity.
"""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import EpisodeStatus
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from std_msgs.msg import Float64

from cfnav_core.policy.policy import Policy
from cfnav_ros.drive.diagnostics import (
    Stopwatch,
    base_report,
    episode_report,
    inference_report,
    input_reports,
    status_reports,
)
from cfnav_ros.drive.episode import Episode
from cfnav_ros.drive.motion import STOP
from cfnav_ros.drive.phases import Phase, StepRecord
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.ros import conversions
from cfnav_ros.ros.docking import Docking
from cfnav_ros.ros.goals import Goal, Goals
from cfnav_ros.ros.moments import Moments
from cfnav_ros.ros.node_process import run_node
from cfnav_ros.ros.parameters import declare, named_robot
from cfnav_ros.ros.real_time import RealTime
from cfnav_ros.ros.senses import Senses
from cfnav_ros.ros.topics import publisher
from cfnav_ros.ros.velocity import VelocityPublisher

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
        robot = named_robot(self)
        settings = self._settings = declare(self, PolicyParameters.of(robot), self._adopt)
        sample_seed = None if settings.sample_seed < 0 else settings.sample_seed
        self._policy = Policy.load(
            settings.bundle, settings.backend, sample_seed, settings.room_type
        )
        settings.check_suits(self._policy.name, self._policy.reads_sightings)
        self._worker = ThreadPoolExecutor(1, "policy")
        self._inferences = Stopwatch()
        self.episode: Episode | None = None
        self._told: set[int] = set()
        """What has been said of the episode on ``policy/episode``."""
        self._docking = Docking(self, robot, settings)
        self.velocity = VelocityPublisher(self, settings, robot)
        self.senses = Senses(self, self._policy, settings, robot, lambda: self._pace.wake())
        self._decisions, self._episodes, self._diagnostics = (
            publisher(self, robot.topics[role]) for role in ("decision", "episode", "diagnostics")
        )
        tilt = robot.topics.get("tilt_command")
        self._tilts = publisher(self, tilt) if tilt else None
        self._pace = Moments(self, settings) if settings.lock_step else RealTime(self, settings)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DIAGNOSTICS_S, self._diagnose, clock=steady)
        self.goals = Goals(self, self._begin, self._preempt, self._tell_unserved)
        self.get_logger().info(
            settings.announcement(
                self._policy.name,
                [goal for goal in self._policy.goals if not self.senses.unseen(goal)],
                self.senses.inputs.view,
                self.senses.topic("frame"),
                self.velocity.topic,
            )
        )
        if settings.goal:
            self.goals.add(Goal(settings.goal))

    # Goals

    def _adopt(self, settings: PolicyParameters) -> None:
        """Take changed parameters at once."""
        was, now = self._settings.episode.motion, settings.episode.motion
        self.get_logger().info(
            f"Top speeds were {was.v_max:g} m/s and {was.w_max:g} rad/s, are {now.v_max:g} and "
            f"{now.w_max:g} from now on."
        )
        self._settings = settings
        if self.episode is not None:
            self.episode.adopt(settings.episode)

    def _begin(self, goal: Goal) -> None:
        limits = self._settings.episode
        if goal.max_steps:
            limits = replace(limits, max_steps=goal.max_steps)
        self.episode = Episode(
            goal.name, self._policy, self._submit, limits, goal.time_limit,
            self._docking.undock, self._docking.dock,
        )  # fmt: skip
        if not self._policy.admits(goal.name):
            self.episode.fail(self.senses.unseen(goal.name))
        self._told.clear()
        self.velocity.restart()
        self.senses.restart()
        self._pace.begin()
        if not self._settings.undock:
            self._tell_phase(self.episode, EpisodeStatus.STARTED)
        self.get_logger().info(f"Looking for {goal.name}.")

    def _preempt(self, reason: str) -> None:
        if self.episode is not None:
            self.episode.finish("preempted", reason)

    def _tell_unserved(self, goal: Goal, given_up: NavigateToObject.Result) -> None:
        self._publish_status(goal.name, EpisodeStatus.ENDED, given_up)

    def end(self, episode: Episode) -> None:
        """Tell everybody how the episode ended and take the next goal, if any."""
        self._pace.end()
        self.senses.release()
        self.episode = None
        self._tell_phase(episode, EpisodeStatus.ENDED)
        result = conversions.result(episode)
        self.get_logger().info(
            f"{episode.goal}: {episode.outcome} after {episode.steps} decisions. {episode.message}"
        )
        self.goals.end(result)

    # Driving

    def _submit(self, function: Any, *args: Any) -> Future:
        future = self._worker.submit(self._inferences.timed(function), *args)
        self._pace.follow(future)
        return future

    def update(self, episode: Episode) -> None:
        """Let an episode go on with what has come, and send and publish what follows."""
        self.check_base()
        t, inputs = self._pace.present(self.senses.inputs)
        begins = episode.phase is Phase.PREFLIGHT
        output = episode.update(t, inputs)
        if episode.begun and not episode.over:
            self.senses.hold()
        if begins and episode.phase is not Phase.PREFLIGHT and not episode.ended:
            self._warn_of_hazards()
        # After the update: what goes wrong in the same moment is said first.
        canceled = self.heed_cancel(episode)
        self.velocity.send(STOP if canceled else output.command)
        if output.tilt is not None and self._tilts is not None:
            self._tilts.publish(Float64(data=output.tilt))
        if output.record is not None:
            self._report(episode, output.record)
        if episode.begun and not episode.outcome:
            self._tell_phase(episode, EpisodeStatus.STARTED)
        if episode.over:
            self._tell_phase(episode, EpisodeStatus.ENDED)
        if episode.ended:
            self.end(episode)

    def _warn_of_hazards(self) -> None:
        if topic := self.senses.unheard.get("hazards"):
            self.get_logger().warning(
                f"{topic}: not heard. The robot drives "
                "without its bumper, and the result counts no bumps. On a TurtleBot 4 enable it in "
                "the republisher's list."
            )

    def heed_cancel(self, episode: Episode) -> bool:
        """End an episode whose goal was canceled; returns whether it was."""
        if self.goals.canceled:
            episode.finish("canceled", CANCELED)
        return self.goals.canceled

    def check_base(self) -> None:
        """Look now and then who is driven, and who drives too."""
        base = self.velocity.check()
        if base is not None:
            self.senses.notice_base(base)
            self.senses.look_for_rivals()

    # Reports

    def _report(self, episode: Episode, record: StepRecord) -> None:
        """Publish a decision before it is executed."""
        now = conversions.ns_to_stamp(self._pace.now_ns)
        zero_ns, frame = self._pace.zero_ns, self._settings.base_frame
        self._decisions.publish(
            conversions.decision(
                record, episode.goal, now, zero_ns, frame, self._policy.reads_sightings
            )
        )
        goal = self.goals.current
        if goal is not None:
            goal.tell(conversions.feedback(record, episode.track.path_length))

    def _tell_phase(self, episode: Episode, phase: int) -> None:
        """Say once that a drive begins, and once that it is over.

        What the base does by itself on its way from the dock and back is no part of it.
        """
        if phase not in self._told:
            self._told.add(phase)
            self._publish_status(episode.goal, phase, conversions.result(episode))

    def _publish_status(self, goal: str, phase: int, result: NavigateToObject.Result) -> None:
        now = conversions.ns_to_stamp(self._pace.now_ns)
        self._episodes.publish(conversions.status(goal, phase, result, self._policy.name, now))

    def _diagnose(self) -> None:
        now, limits = self.get_clock().now(), self._settings.episode
        velocity, inputs, t = self.velocity, self.senses.inputs, now.nanoseconds * 1e-9
        needed = (limits.lidar, limits.has_tilt)
        reports = (
            *input_reports(t, inputs, limits.ages, self.senses.rates(), *needed),
            *status_reports(self.senses.heard, self.senses.unheard, self.senses.quiet),
            episode_report(self.episode),
            inference_report(*self._inferences.percentiles_ms(), limits.think_timeout),
            base_report(
                inputs,
                velocity.topic,
                velocity.type,
                velocity.largest_gap,
                bool(self.episode),
                self._settings.undock,
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
        self.velocity.send(STOP)
        owed = self.velocity.speaks or self.goals.current is not None  # zeros, or a result
        self.goals.close()
        end = time.monotonic() + BURST_S
        if self.episode is not None:
            self.episode.fail("The policy node was stopped.")
            self.end(self.episode)
        while owed and time.monotonic() < end:
            self.velocity.send(STOP)
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
