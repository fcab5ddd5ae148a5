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

from sim_bridge.faults.faults import COMMANDS, ODOM, SCAN
from sim_bridge.faults.robot_clock import RobotClock
from sim_bridge.faults.schedule import FaultOrder, FaultSchedule, read_schedule
from sim_bridge.robot.base import SimulatedOdometry
from sim_bridge.robot.own_motions import Dock, Undock
from sim_bridge.ros.broadcast import Broadcast
from sim_bridge.ros.lock_step import MOMENT_PERIOD, LockStepServer
from sim_bridge.ros.pacing import MAX_LAG_S, Every, Pacer
from sim_bridge.ros.parameters import read_parameters
from sim_bridge.ros.robot_node import CLOCK, RIVALS, TILT, RivalNode, RobotNode, settle
from sim_bridge.ros.simulator_node import SimulatorNode
from sim_bridge.ros.stage import SimulatorStage

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
            lambda tilt: leave(self._receive, TILT, tilt.data, self._simulator.tilt_to),
            lambda done: leave(self._lock.answer, _key(done.stamp), done.idle),
            partial(leave, self._switch),
            partial(leave, self._begin_own),
        )
        self.parameters = p = read_parameters(self.robot)
        described = p.described
        self.robot.connect(
            described,
            p.clock == "simulated",
            p.set_up.tilts,
            p.lock_step,
            p.depth,
            bool(p.detector),
        )
        self.simulator_node = SimulatorNode(
            leave, self._start_episode, lambda _, response: self._stage.end_episode(response),
            self._set_fault, p.lock_step, p.true_estimate,
        )  # fmt: skip
        self._pacer = Pacer(p.speed)
        self._lock = LockStepServer()
        self._start_answer: Future[Any] = Future()
        self._moments = Every(MOMENT_PERIOD, self._ask)
        self._faults = FaultSchedule(read_schedule(p.faults) if p.faults else (), p.seed)
        self._holding: frozenset[str] = frozenset()
        self._clock = RobotClock()
        self._asked: tuple[str, ServerGoalHandle, Undock | Dock] | None = None
        self._stage = SimulatorStage(p)
        self._simulator = self._stage.simulator
        self._out = Broadcast(
            self.robot, self.simulator_node, self._stage, self._clock, self._faults, p, described
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
            self._end_own()
            if self._moments.due(self._simulator.time):
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
        self._start_answer.cancel()
        while not self._inbox.empty():
            self._inbox.get()[0].cancel()

    @property
    def nodes(self) -> tuple[Node, Node]:
        """The nodes to spin, each in a thread of its own; the robot's first."""
        return self.robot, self.simulator_node

    def close(self) -> None:
        """Free the cameras and the nodes; in the thread that ran the loop."""
        self._stage.close()
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
        else:
            self._out.running[part] = on

    def _begin_own(self, name: str, goal: ServerGoalHandle) -> None:
        """Begin to leave the dock or to go back to it; a robot that cannot, or is busy, refuses."""
        simulator, docked = self._simulator, self._simulator.docked
        can = docked if name == "undock" else simulator.dock_visible and not docked
        if simulator.busy or not can:
            goal.execute(partial(settle, name=name, done=False, docked=docked))
            return
        motion = simulator.undock() if name == "undock" else simulator.go_to_dock()
        self._asked = name, goal, motion

    def _end_own(self) -> None:
        """Answer the goal of such a motion that is over: made, given up, canceled or cut short."""
        if self._asked is None:
            return
        name, goal, motion = self._asked
        simulator = self._simulator
        if simulator.own is motion and goal.is_cancel_requested:
            simulator.stop_own()
        if simulator.own is not motion:
            docked = simulator.docked
            done = motion.done and docked is (name == "dock")
            goal.execute(partial(settle, name=name, done=done, docked=docked))
            self._asked = None

    def _start_episode(self, request: Any, response: Any) -> Any:
        """Answer at once; in lock-step when the policy has heard the sensors at the new place."""
        if self._stage.start_episode(request, response):
            self._out.map()
        self._restart_pace()
        if response.ok:
            self._restart(request.seed)
        if not (response.ok and self._lock.engaged):
            return response
        answer = self._start_answer = Future[Any]()
        self._lock.begin(lambda: answer.set_result(response))
        return answer

    def _restart(self, seed: int) -> None:
        """Let the robot's messages begin anew, so that an episode repeats itself."""
        self._out.restart()
        self._moments.restart(self._simulator.time)
        self._faults.reseed(seed)
        if self.parameters.lock_step:
            # A carried robot counts on; but large sums have other last bits than small ones.
            self._simulator.odometry = SimulatedOdometry()

    # Faults

    def _set_fault(self, request: Any, response: Any) -> Any:
        try:
            if request.active:
                when = request.when or "now"
                self._faults.order(FaultOrder(request.fault, when, duration=request.duration))
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
            self._holding = self._holding | {name} if holds else self._holding - {name}
            self._simulator.take_faults(self._holding)
            self._clock.take_faults(self._holding, t)
        self.robot.take_faults(self._holding)
        self._update_rival(self._holding & RIVALS.keys())
        for name, holds in changes:
            self._out.fault(name, holds)

    def _update_rival(self, faults: frozenset[str]) -> None:
        rival = self._out.rival
        if faults and rival is None:
            rival = RivalNode(self.parameters.described)
        if rival is not None:
            rival.take_faults(faults)
            if not faults:
                rival.destroy_node()
        self._out.rival = rival if faults else None

    def _refuse_company(self) -> None:
        """Raise ValueError when somebody else plays the robot in this domain."""
        time.sleep(max(0.0, self._born + DISCOVERY_S - time.monotonic()))
        for role in (ODOM, SCAN, CLOCK):
            topic = self.parameters.described.topics[role].name
            if self.robot.count_publishers(topic) > (role in self.robot.out):
                domain = self.robot.context.get_domain_id()
                raise ValueError(
                    f"another node publishes {topic} in ROS domain {domain}; "
                    "choose another ROS_DOMAIN_ID."
                )


def _key(stamp: Time) -> tuple[int, int]:
    return stamp.sec, stamp.nanosec
