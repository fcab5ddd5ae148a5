"""A live graph under observation: places the robot, sends goals, breaks things, notes the truth.

All its waits receive; nothing sleeps. Speed is 1, so that simulated seconds are real ones.
"""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from action_msgs.srv import CancelGoal
from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import (
    CollisionEstimate,
    EpisodeStatus,
    FaultStatus,
    GroundTruth,
    PolicyDecision,
)
from cfnav_interfaces.srv import SetFault
from cfnav_ros.drive.fields import stamp_to_seconds
from cfnav_ros.process.processes import GraphError
from cfnav_ros.ros.graph import RosGraph
from cfnav_ros.ros.spinning import join, leave
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from studies.deploy.judge import TruthSample

PATIENCE_S = 20.0
"""Real seconds for anything that should be a matter of moments."""

COUNTS_ANEW = "odom_turned"
"""The fault after which what was seen by the odometry before is forgotten."""

SIGHT_S = 0.6
"""An estimate this young, and not blind, says that the robot is well again, s."""


class Rig:
    """What the measuring programs need of one graph."""

    def __init__(self, graph: RosGraph) -> None:
        """Listen to a running graph."""
        self.graph = graph
        self.truth: list[TruthSample] = []
        self.decisions: list[PolicyDecision] = []
        self.faults: list[FaultStatus] = []
        self.idle = True
        self._heard_at = 0.0
        self._estimate = CollisionEstimate(verdict=CollisionEstimate.BLIND)
        node = graph.node
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(GroundTruth, "ground_truth/state", self._on_truth, 100)
        node.create_subscription(FaultStatus, "simulator/fault", self.faults.append, latched)
        node.create_subscription(PolicyDecision, "policy/decision", self.decisions.append, 50)
        node.create_subscription(EpisodeStatus, "policy/episode", self._on_episode, latched)
        node.create_subscription(CollisionEstimate, "collision/estimate", self._on_estimate, 5)
        self._set_fault = node.create_client(SetFault, "simulator/set_fault")
        self._cancel = node.create_client(CancelGoal, "navigate_to_object/_action/cancel_goal")

    @property
    def now(self) -> float:
        """Simulated time, seconds: the newest sample and the real time since it came."""
        return self.truth[-1].t + time.monotonic() - self._heard_at

    def watch(self, condition: Callable[[], object], patience_s: float) -> bool:
        """Receive until a condition holds, whatever becomes of the processes; False if never."""
        end = time.monotonic() + patience_s
        while not condition():
            if time.monotonic() > end:
                return False
            self.graph.receive()
        return True

    def prepare(self, room: str, start: tuple[float, float, float], seed: int) -> None:
        """Mend everything, end every goal, put the robot down, and wait until it is well.

        Raises:
            GraphError: it does not get well.
        """
        self.fault("", active=False)
        self.graph.call(self._cancel, CancelGoal.Request(), "the cancelling of all goals")
        self.graph.until(lambda: self.idle, PATIENCE_S, "end of the goal before")
        self.truth.clear()
        answer = self.graph.start_episode(room, "", seed, start)
        if not answer.ok:
            raise GraphError(f"the simulator refused the start {start}: {answer.message}")
        self.graph.until(lambda: self._placed(start), PATIENCE_S, "robot at its start")
        if self.graph.config.depth_down_deg is not None:
            self._count_anew()
        self.graph.until(self._sees, PATIENCE_S, "sight of the LiDAR")
        del self.truth[:-1]
        self.decisions.clear()
        self.faults.clear()

    def fault(self, name: str, active: bool = True, when: str = "") -> None:
        """Ask the simulator for a fault.

        Raises:
            GraphError: it knows none of this name.
        """
        request = SetFault.Request(fault=name, active=active, when=when)
        answer = self.graph.call(self._set_fault, request, "simulator/set_fault")
        if not answer.ok:
            raise GraphError(f"the simulator refused the fault {name!r}: {answer.message}")

    def _count_anew(self) -> None:
        """Turn the odometry, as if the base had been switched on here.

        It goes on counting where the robot is put down elsewhere, and so would what depth has shown
        before stand around it for as long as that counts.
        """
        self.faults.clear()
        self.fault(COUNTS_ANEW)
        over = partial(self.announced, COUNTS_ANEW, active=False)
        self.graph.until(lambda: over() < math.inf, PATIENCE_S, "odometry that counts anew")

    def announced(self, name: str, active: bool = True) -> float:
        """Simulated time at which a fault began or ended; infinite when it has not."""
        for status in self.faults:
            if status.fault == name and status.active == active:
                return stamp_to_seconds(status.header.stamp)
        return math.inf

    def signal(self, process: str, number: signal.Signals) -> None:
        """Send a signal to one of the graph's processes."""
        os.kill(self.graph.children[process].pid, number)

    def _placed(self, start: tuple[float, float, float]) -> bool:
        if not self.truth or not self.truth[-1].still_since:
            return False
        newest = self.truth[-1]
        return math.hypot(newest.x - start[0], newest.y - start[1]) < 0.01

    def _sees(self) -> bool:
        stamp = stamp_to_seconds(self._estimate.header.stamp)
        fresh = self._estimate.verdict != CollisionEstimate.BLIND
        return fresh and abs(self.now - stamp) < SIGHT_S

    def _on_truth(self, m: GroundTruth) -> None:
        self._heard_at = time.monotonic()
        t = stamp_to_seconds(m.header.stamp)
        self.truth.append(TruthSample(t, m.x, m.y, m.yaw, m.v, m.w, m.still_since, m.collisions))

    def _on_episode(self, message: EpisodeStatus) -> None:
        self.idle = message.phase == EpisodeStatus.ENDED

    def _on_estimate(self, message: CollisionEstimate) -> None:
        self._estimate = message


class PassingClient:
    """A client of its own that sends a goal and can vanish."""

    def __init__(self, rig: Rig, goal: str) -> None:
        """Send the goal and wait until it is accepted.

        Raises:
            GraphError: nobody accepts it.
        """
        self._context = join(rig.graph.domain)
        self._node = Node("passing_client", context=self._context)
        self._client = ActionClient(self._node, NavigateToObject, "navigate_to_object")
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._wait(self._client.server_is_ready)
        sent = self._client.send_goal_async(NavigateToObject.Goal(goal=goal))
        self._wait(sent.done)

    def vanish(self) -> None:
        """Leave without a word to the server."""
        self._executor.shutdown()
        leave(self._node)

    def _wait(self, condition: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > end:
                raise GraphError("policy_node did not accept the goal of a second client")
            self._executor.spin_once(timeout_sec=0.1)
