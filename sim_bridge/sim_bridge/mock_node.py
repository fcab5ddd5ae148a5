"""The mock TurtleBot 4: one loop advances simulated time, draws and publishes.

ROS callbacks only hand it work, so the world and the camera belong to one thread.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from concurrent.futures import Future
from copy import deepcopy
from typing import Any, NoReturn

from cfnav_interfaces.msg import FaultStatus
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from sim_bridge import conversions as to_msg
from sim_bridge.fault_schedule import FaultSchedule, Order, read_schedule
from sim_bridge.faults import CAMERA_INFO, COMMANDS, IMAGE, JOINTS, ODOM, SCAN, TF
from sim_bridge.lidar_turn import LidarTurn
from sim_bridge.outbox import Outbox
from sim_bridge.pacing import MAX_LAG_S, Every, Pacer
from sim_bridge.parameters import read_parameters
from sim_bridge.robot_clock import RobotClock
from sim_bridge.robot_node import CLOCK, HAZARDS, TF_STATIC, TILT, RivalNode, RobotNode
from sim_bridge.scan_faults import stranger
from sim_bridge.simulator_node import SimulatorNode
from sim_bridge.stage import Stage

CAMERA_PERIOD = 1.0 / 15.0
STATE_PERIOD = 1.0 / 20.0
MAP_RESOLUTION = 0.02
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
        self.robot = RobotNode(
            lambda v, w: self._hand_over(self._receive, COMMANDS, (v, w), self._drive),
            lambda tilt: self._hand_over(self._receive, TILT, tilt, self._simulator.tilt_to),
        )
        self.parameters = p = read_parameters(self.robot)
        if p.set_up.tilts:
            self.robot.tilt()
        self.simulator_node = SimulatorNode(
            self._hand_over, self._start_episode, self._end_episode, self._set_fault
        )
        self._pacer = Pacer(p.speed)
        self._faults = FaultSchedule(read_schedule(p.faults) if p.faults else (), p.seed)
        self._outbox = Outbox(self._faults)
        self._clock = RobotClock()
        self._rival: RivalNode | None = None
        self._turn = LidarTurn()
        self._schedule = (
            Every(STATE_PERIOD, self._publish_state),
            Every(CAMERA_PERIOD, self._publish_picture),
        )
        self._stage = Stage(p)
        self._simulator = self._stage.simulator

    def set_up(self) -> None:
        """Put the robot down and make sure that no other robot is about.

        Raises:
            ValueError: with one sentence, when the parameters ask for what cannot be had.
        """
        self._stage.put_robot()
        if self.parameters.domain_guard:
            self._refuse_company()
        self._publish_map()
        mounts = TFMessage(transforms=to_msg.static_transforms(self.parameters.set_up, self._now))
        self.robot.out[TF_STATIC].publish(mounts)

    @property
    def summary(self) -> str:
        """What runs, in a few words."""
        p = self.parameters
        speed = f"{p.speed:g} times real time" if p.speed else "as fast as it can"
        return f"room {p.room}, goal {p.goal or 'none'}, {speed}"

    def run(self) -> NoReturn:
        """Advance simulated time and publish until the process is told to end."""
        self._pacer.restart(self._simulator.time, time.monotonic())
        while True:
            self._do_requests()
            self._update_faults()
            self._publish(self._simulator.step())
            ahead = self._pacer.ahead(self._simulator.time, time.monotonic())
            if ahead > 0:
                time.sleep(ahead)
            elif ahead < -MAX_LAG_S:
                self.robot.get_logger().warning(
                    f"the machine is too slow: simulated time stood for {-ahead:.1f} s",
                    throttle_duration_sec=10.0,
                )

    def abort(self, error: Exception) -> None:
        """Make the loop raise an error of a receiving thread: a deaf robot must not live on."""

        def fail() -> None:
            raise error

        self._hand_over(fail)

    def refuse_requests(self) -> None:
        """Answer no service call any more; for the end, when the loop no longer runs."""
        while not self._inbox.empty():
            self._inbox.get()[0].cancel()

    @property
    def nodes(self) -> tuple[Node, Node]:
        """The nodes to spin, each in a thread of its own; the robot's first."""
        return self.robot, self.simulator_node

    def close(self) -> None:
        """Free the camera and the nodes; in the thread that ran the loop."""
        self._stage.camera.close()
        for node in (*self.nodes, self._rival):
            if node is not None:
                node.destroy_node()

    @property
    def _now(self) -> float:
        """What the robot's clock shows, s."""
        return self._clock(self._simulator.time)

    # Requests

    def _hand_over(self, action: Callable, *arguments: object) -> Future:
        """Leave work for the loop; called from an executor's thread."""
        task: Future = Future()
        self._inbox.put((task, action, arguments))
        return task

    def _do_requests(self) -> None:
        while not self._inbox.empty():
            task, action, arguments = self._inbox.get()
            try:
                task.set_result(action(*arguments))
            except BaseException:
                task.cancel()
                raise

    def _receive(self, topic: str, command: Any, obey: Callable[[Any], None]) -> None:
        """Take what came in on a topic, as far as the faults let it."""
        t = self._simulator.time
        self._outbox.put(topic, command, obey, t)
        self._outbox.release(t)

    def _drive(self, command: tuple[float, float]) -> None:
        self._simulator.command(*command)

    def _start_episode(self, request: Any, response: Any) -> Any:
        if self._stage.start_episode(request, response):
            self._publish_map()
        if response.ok:
            self._restart(request.seed)
        self._pacer.restart(self._simulator.time, time.monotonic())
        return response

    def _restart(self, seed: int) -> None:
        """Let the robot's messages begin anew, so that an episode repeats itself."""
        t = self._simulator.time
        self._outbox.clear()
        self._faults.reseed(seed)
        self._turn.restart(t)
        for every in self._schedule:
            every.restart(t)

    def _end_episode(self, _: Any, response: Any) -> Any:
        self._stage.end_episode(response)
        return response

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

    # Faults

    def _update_faults(self) -> None:
        """Let faults begin and end, tell the parts that have them and announce them."""
        t = self._simulator.time
        changes = self._faults.update(t, self._simulator.motion)
        if not changes:
            return
        active = self._faults.active
        self._simulator.suffer(active)
        self._clock.suffer(active, t)
        self.robot.suffer(active)
        self._let_rival(active & {"scan_rival", "cmd_rival"})
        for name, holds in changes:
            header = to_msg.header(self._clock.true(t), "")
            status = FaultStatus(header=header, fault=name, active=holds)
            self.simulator_node.fault.publish(status)

    def _let_rival(self, faults: frozenset[str]) -> None:
        if self._rival is not None:
            self._rival.destroy_node()
        self._rival = RivalNode(faults) if faults else None

    # Messages

    def _publish(self, collision_began: bool) -> None:
        """Publish what is due, the time first so that no stamp lies in a receiver's future.

        A message on /clock every step would cost each Python node that listens a sixth of a core.
        """
        t = self._simulator.time
        due = [every.action for every in self._schedule if every.due(t)]
        if self._turn.complete(t, self._simulator.world.pose):
            due.append(self._publish_scan)
        if collision_began and self._publish_state not in due:
            due.append(self._publish_contact)
        if (due or self._outbox.due(t)) and self._clock.stopped_at is None:
            self._send(CLOCK, Clock(clock=to_msg.stamp(self._now)))
        for action in due:
            action()
        self._outbox.release(t)

    def _send(self, topic: str, message: Any, latency: float = 0.0) -> None:
        t = self._simulator.time
        self._outbox.put(topic, message, self.robot.out[topic].publish, t, latency)

    def _publish_state(self) -> None:
        simulator, now, set_up = self._simulator, self._now, self.parameters.set_up
        tilt, late = simulator.world.pose.tilt, self._stage.noise.levels.odometry_latency
        self._send(ODOM, to_msg.odometry(simulator.odometry, simulator.twist, now), late)
        moving = to_msg.moving_transforms(simulator.odometry, set_up, tilt, now)
        self._send(TF, TFMessage(transforms=moving), late)
        self._send(JOINTS, to_msg.joint_state(set_up, tilt, now))
        self._publish_contact()

    def _publish_contact(self) -> None:
        self._send(HAZARDS, to_msg.hazards(self._simulator.pressed(), self._now))
        truth = to_msg.ground_truth(self._simulator, self._stage.goal_visible(), self._clock.epoch)
        self.simulator_node.truth.publish(truth)

    def _publish_scan(self) -> None:
        began = self._clock(self._turn.began)
        distances = self._stage.noise.scan(self._turn.distances(self._simulator.world))
        self._turn.next()
        scan = to_msg.laser_scan(distances, began)
        if self._rival is not None and self._rival.scan is not None:
            other = deepcopy(scan)
            stranger(other)
            self._rival.scan.publish(other)
        self._send(SCAN, scan)

    def _publish_picture(self) -> None:
        now, late = self._now, self._stage.noise.levels.image_latency
        self._send(IMAGE, to_msg.image(self._stage.picture(CAMERA_PERIOD), now), late)
        self._send(CAMERA_INFO, to_msg.camera_info(self.parameters.set_up, now), late)

    def _publish_map(self) -> None:
        grid = self._simulator.world.occupancy(MAP_RESOLUTION)
        t = self._clock.true(self._simulator.time)
        self.simulator_node.map.publish(to_msg.occupancy_grid(grid, MAP_RESOLUTION, t))

    def _refuse_company(self) -> None:
        """Raise ValueError when somebody else plays the robot in this domain."""
        time.sleep(max(0.0, self._born + DISCOVERY_S - time.monotonic()))
        for topic in ("odom", "scan", "/clock"):
            if self.robot.count_publishers(topic) > 1:
                domain = self.robot.context.get_domain_id()
                raise ValueError(
                    f"another node publishes {topic} in ROS domain {domain}; "
                    "choose another ROS_DOMAIN_ID."
                )
