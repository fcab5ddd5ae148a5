"""The mock TurtleBot 4: one loop advances simulated time, draws and publishes.

ROS callbacks only hand it work, so the world and the camera belong to one thread.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, NoReturn

from builtin_interfaces.msg import Time
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from sim_bridge.base import Odometry
from sim_bridge.broadcast_node import Broadcast
from sim_bridge.fault_schedule import FaultSchedule, Order, read_schedule
from sim_bridge.faults import COMMANDS, ODOM, SCAN
from sim_bridge.lock_step import MOMENT_PERIOD, LockStep
from sim_bridge.own_motions import Undock
from sim_bridge.pacing import MAX_LAG_S, Every, Pacer
from sim_bridge.parameters import read_parameters
from sim_bridge.robot_clock import RobotClock
from sim_bridge.robot_node import CLOCK, RIVALS, TILT, RivalNode, RobotNode, settle_undock
from sim_bridge.simulator_node import SimulatorNode
from sim_bridge.stage import Stage

DISCOVERY_S = 4.0
"""Wall time after which another robot in the domain has been heard of; Fast DDS announces a
participant again every 3 s."""


class Mock:
    """The robot's node and the simulator's, and the loop that feeds them.

    ``set_up`` and ``run`` follow in the same thread.

    Raises:
        ValueError: with one sentence, for parameters that cannot be used.
    """

    def __init__(self) -> None:
        self._born = time.monotonic()
        self._inbox: queue.SimpleQueue[tuple[Future, Callable, tuple]] = queue.SimpleQueue()
        leave = self._hand_over
        self.robot = RobotNode(
            lambda v, w: leave(self._receive, COMMANDS, (v, w), self._drive),
            lambda tilt: leave(self._receive, TILT, tilt, self._simulator.tilt_to),
            lambda done: leave(self._lock.answer, _key(done.stamp), done.idle),
            partial(leave, self._switch),
            partial(leave, self._undock),
        )
        self.parameters = p = read_parameters(self.robot)
        self.robot.connect(p.clock == "simulated", p.set_up.tilts, p.lock_step)
        self.simulator_node = SimulatorNode(
            leave, self._start_episode, self._end_episode, self._set_fault, p.lock_step,
            p.true_estimate,
        )  # fmt: skip
        self._pacer = Pacer(p.speed)
        self._lock = LockStep()
        self._promise: Future = Future()
        self._moments = Every(MOMENT_PERIOD, self._ask)
        self._faults = FaultSchedule(read_schedule(p.faults) if p.faults else (), p.seed)
        self._suffered: frozenset[str] = frozenset()
        self._clock = RobotClock()
        self._undocking: tuple[ServerGoalHandle, Undock] | None = None
        self._stage = Stage(p)
        self._simulator = self._stage.simulator
        self._out = Broadcast(
            self.robot, self.simulator_node, self._stage, self._clock, self._faults, p
        )

    def set_up(self) -> None:
        """Put the robot down and make sure that no other robot is about.

        Raises:
            ValueError: with one sentence, when the parameters ask for what cannot be had.
        """
        self._stage.put_robot()
        if self.parameters.domain_guard:
            self._refuse_company()
        self._restart_pace()
        self._out.map()
        self._out.mounts()

    @property
    def summary(self) -> str:
        """What runs, in a few words."""
        p = self.parameters
        speed = f"{p.speed:g} times real time" if p.speed else "as fast as it can"
        return f"room {p.room}, goal {p.goal or 'none'}, {speed}"

    def run(self) -> NoReturn:
        """Advance simulated time and publish until the process is told to end."""
        self._restart_pace()
        while True:
            self._do_requests()
            if self._lock.stands:
                continue
            self._update_faults()
            self._out.publish(self._simulator.step())
            self._end_undocking()
            if self.parameters.lock_step and self._moments.due(self._simulator.time):
                self._ask()
            self._keep_pace()

    def abort(self, error: Exception) -> None:
        """Make the loop raise an error, from another thread or a signal handler.

        A robot whose receiving thread failed is deaf and must not live on.
        """

        def fail() -> None:
            raise error

        self._hand_over(fail)

    def refuse_requests(self) -> None:
        """Answer no service call any more; for the end, when the loop no longer runs."""
        self._promise.cancel()
        while not self._inbox.empty():
            self._inbox.get()[0].cancel()

    @property
    def nodes(self) -> tuple[Node, Node]:
        """The nodes to spin, each in a thread of its own; the robot's first."""
        return self.robot, self.simulator_node

    def close(self) -> None:
        """Free the camera and the nodes; in the thread that ran the loop."""
        self._stage.camera.close()
        for node in (*self.nodes, self._out.rival):
            if node is not None:
                node.destroy_node()

    # Time

    def _keep_pace(self) -> None:
        # Until the policy is there, time runs no faster than it can follow.
        alone = self.parameters.lock_step and not self._lock.engaged
        ahead = self._pacer.ahead(self._simulator.time, time.monotonic(), at_most=alone)
        if ahead > 0:
            time.sleep(ahead)
        elif ahead < -MAX_LAG_S and not self._lock.engaged:
            self._restart_pace()
            self.robot.get_logger().warning(
                f"the machine is too slow: simulated time stood for {-ahead:.1f} s",
                throttle_duration_sec=10.0,
            )

    def _restart_pace(self) -> None:
        t = self._simulator.time
        self._pacer.restart(t, time.monotonic())
        if self.parameters.clock == "system":
            self._clock.epoch = time.time() - t

    def _ask(self) -> None:
        """Let time stand until the moment is answered."""
        announced = self._out.moment()
        if announced is not None:
            stamp, listeners = announced
            self._lock.ask(_key(stamp), listeners)

    # Requests

    def _hand_over(self, action: Callable, *arguments: object) -> Future:
        """Leave work for the loop; called from an executor's thread."""
        task: Future = Future()
        self._inbox.put((task, action, arguments))
        return task

    def _do_requests(self) -> None:
        """Do what was handed over; while time stands, wait for it."""
        while self._lock.stands or not self._inbox.empty():
            try:
                task, action, arguments = self._inbox.get(timeout=0.1)
            except queue.Empty:
                continue
            try:
                task.set_result(action(*arguments))
            except BaseException:
                task.cancel()
                raise

    def _receive(self, topic: str, command: Any, obey: Callable[[Any], None]) -> None:
        """Take what came in on a topic, as far as the faults let it."""
        t = self._simulator.time
        self._out.outbox.put(topic, command, obey, t)
        self._out.outbox.release(t)

    def _drive(self, command: tuple[float, float]) -> None:
        self._simulator.command(*command)

    def _switch(self, part: str, on: bool) -> None:
        """Turn a part of the robot on or off; see ``RobotNode``."""
        if part == "e_stop":
            self._simulator.e_stop = on
        elif part == "lidar":
            self._out.lidar_on = on
        else:
            self._out.camera_on = on

    def _undock(self, goal: ServerGoalHandle) -> None:
        """Begin to leave the dock; a robot that is not on it, or is busy, refuses."""
        docked = self._simulator.docked
        if self._simulator.busy or not docked:
            goal.execute(partial(settle_undock, done=False, docked=docked))
            return
        self._undocking = goal, self._simulator.undock()

    def _end_undocking(self) -> None:
        """Answer the goal of an undocking that is over: made, given up, or cut short."""
        if self._undocking is None:
            return
        goal, undock = self._undocking
        if self._simulator.own is not undock:
            docked = self._simulator.docked
            goal.execute(partial(settle_undock, done=undock.done and not docked, docked=docked))
            self._undocking = None

    def _start_episode(self, request: Any, response: Any) -> Any:
        """Answer at once; in lock-step when the policy has heard the sensors at the new place."""
        if self._stage.start_episode(request, response):
            self._out.map()
        self._restart_pace()
        if response.ok:
            self._restart(request.seed)
        if not (response.ok and self._lock.engaged):
            return response
        self._promise = promise = Future()
        self._lock.begin(lambda: promise.set_result(response))
        return promise

    def _restart(self, seed: int) -> None:
        """Let the robot's messages begin anew, so that an episode repeats itself."""
        self._out.restart()
        self._moments.restart(self._simulator.time)
        self._faults.reseed(seed)
        if self.parameters.lock_step:
            # A carried robot counts on; but large sums have other last bits than small ones.
            self._simulator.odometry = Odometry()

    def _end_episode(self, _: Any, response: Any) -> Any:
        self._stage.end_episode(response)
        return response

    # Faults

    def _set_fault(self, request: Any, response: Any) -> Any:
        try:
            if request.active:
                when = request.when or "now"
                self._faults.order(Order(request.fault, when, duration=request.duration))
            else:
                self._faults.mend(request.fault)
        except ValueError as error:
            response.message = str(error)
        else:
            response.ok = True
        return response

    def _update_faults(self) -> None:
        """Let faults begin and end, tell the parts that have them and announce them."""
        t = self._simulator.time
        changes = self._faults.update(t, self._simulator.motion)
        if not changes:
            return
        for name, holds in changes:
            # One after the other, so that a fault that begins anew is seen to end before.
            self._suffered = self._suffered | {name} if holds else self._suffered - {name}
            self._simulator.suffer(self._suffered)
            self._clock.suffer(self._suffered, t)
        self.robot.suffer(self._suffered)
        self._let_rival(self._suffered & RIVALS.keys())
        for name, holds in changes:
            self._out.fault(name, holds)

    def _let_rival(self, faults: frozenset[str]) -> None:
        rival = self._out.rival
        if faults and rival is None:
            rival = RivalNode()
        if rival is not None:
            rival.suffer(faults)
            if not faults:
                rival.destroy_node()
        self._out.rival = rival if faults else None

    def _refuse_company(self) -> None:
        """Raise ValueError when somebody else plays the robot in this domain."""
        time.sleep(max(0.0, self._born + DISCOVERY_S - time.monotonic()))
        for topic in (ODOM, SCAN, CLOCK):
            if self.robot.count_publishers(topic) > (topic in self.robot.out):
                domain = self.robot.context.get_domain_id()
                raise ValueError(
                    f"another node publishes {topic} in ROS domain {domain}; "
                    "choose another ROS_DOMAIN_ID."
                )


def _key(stamp: Time) -> tuple[int, int]:
    return stamp.sec, stamp.nanosec
