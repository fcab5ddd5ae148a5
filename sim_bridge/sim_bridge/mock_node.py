"""The mock TurtleBot 4's node: topics, types, QoS, rates and frames of the real robot.

One loop advances simulated time, draws and publishes; ROS callbacks only hand it work, so the
world and the camera belong to one thread.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import NoReturn

import numpy as np
from cfnav_interfaces.msg import GroundTruth
from cfnav_interfaces.srv import EndEpisode, StartEpisode
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import HazardDetectionVector
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

from cfnav_core.visibility import VISIBLE_DISTANCE_M
from sim_bridge import conversions as to_msg
from sim_bridge.camera import Camera
from sim_bridge.grid import start_episode, state_grid
from sim_bridge.pacing import MAX_LAG_S, Every, Pacer
from sim_bridge.parameters import read_parameters
from sim_bridge.room import generate_room, parse_room
from sim_bridge.rplidar import SCAN_PERIOD
from sim_bridge.simulator import Simulator
from sim_bridge.world import World

CAMERA_PERIOD = 1.0 / 15.0
STATE_PERIOD = 1.0 / 20.0
MAP_RESOLUTION = 0.02
DISCOVERY_S = 4.0
"""Wall time after which another robot in the domain has been heard of; Fast DDS announces a
participant again every 3 s."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class MockTurtleBot4(Node):
    """The node, with its room built; ``set_up`` and ``run`` follow in the same thread.

    Raises:
        ValueError: with one sentence, for parameters that cannot be used.
    """

    def __init__(self) -> None:
        super().__init__("mock_turtlebot4", automatically_declare_parameters_from_overrides=True)
        self._born = time.monotonic()
        self.parameters = read_parameters(self)
        self._pacer = Pacer(self.parameters.speed)
        self._inbox: queue.SimpleQueue[tuple[Future, Callable, tuple]] = queue.SimpleQueue()
        self._advertise()
        self._listen()
        self._schedule = (
            Every(STATE_PERIOD, self._publish_state),
            Every(SCAN_PERIOD, self._publish_scan),
            Every(CAMERA_PERIOD, self._publish_picture),
        )
        world, self.camera = self._build(self.parameters.room)
        self.simulator = Simulator(world)
        self._seen: tuple[tuple, bool] = ((), False)

    def set_up(self) -> None:
        """Put the robot down and make sure that no other robot is about.

        Raises:
            ValueError: with one sentence, when the parameters ask for what cannot be had.
        """
        p = self.parameters
        if p.goal:
            start = start_episode(self.simulator.world, self.camera, p.goal, p.seed)
            self.simulator.start_episode(p.goal, start)
        elif p.start:
            self._put_at(*p.start)
        else:
            self._put_anywhere()
        if p.domain_guard:
            self._refuse_company()
        self._publish_map()
        self._tf_static.publish(TFMessage(transforms=to_msg.static_transforms(0.0)))

    @property
    def summary(self) -> str:
        """What runs, in a few words."""
        p = self.parameters
        speed = f"{p.speed:g} times real time" if p.speed else "as fast as it can"
        return f"room {p.room}, goal {p.goal or 'none'}, {speed}"

    def run(self) -> NoReturn:
        """Advance simulated time and publish until the process is told to end."""
        self._pacer.restart(self.simulator.time, time.monotonic())
        while True:
            self._do_requests()
            began = self.simulator.step()
            self._publish(began)
            ahead = self._pacer.ahead(self.simulator.time, time.monotonic())
            if ahead > 0:
                time.sleep(ahead)
            elif ahead < -MAX_LAG_S:
                self.get_logger().warning(
                    f"the machine is too slow: simulated time stood for {-ahead:.1f} s",
                    throttle_duration_sec=10.0,
                )

    def abort(self, error: Exception) -> None:
        """Make the loop raise an error of the receiving thread: a deaf robot must not live on."""

        def fail() -> None:
            raise error

        self._hand_over(fail)

    def refuse_requests(self) -> None:
        """Answer no service call any more; for the end, when the loop no longer runs."""
        while not self._inbox.empty():
            self._inbox.get()[0].cancel()

    def close(self) -> None:
        """Free the camera and the node; in the thread that ran the loop."""
        self.camera.close()
        self.destroy_node()

    def _build(self, room: str) -> tuple[World, Camera]:
        world = World(generate_room(*parse_room(room)))
        size = self.parameters.camera_size
        return world, Camera(world, width=size, height=size)

    def _advertise(self) -> None:
        publish = self.create_publisher
        self._clock_publisher = publish(Clock, "/clock", 10)
        self._image = publish(Image, "oakd/rgb/preview/image_raw", 10)
        self._camera_info = publish(CameraInfo, "oakd/rgb/preview/camera_info", 10)
        self._scan = publish(LaserScan, "scan", 10)
        self._odom = publish(Odometry, "odom", LATCHED)
        self._tf = publish(TFMessage, "tf", 100)
        self._tf_static = publish(TFMessage, "tf_static", LATCHED)
        self._joints = publish(JointState, "joint_states", 10)
        self._hazards = publish(HazardDetectionVector, "hazard_detection", 5)
        self._truth = publish(GroundTruth, "ground_truth/state", 100)
        self._map = publish(OccupancyGrid, "ground_truth/map", LATCHED)

    def _listen(self) -> None:
        subscribe = self.create_subscription
        subscribe(TwistStamped, "cmd_vel", self._on_stamped_velocity, NEWEST)
        subscribe(Twist, "cmd_vel_unstamped", self._on_velocity, NEWEST)
        subscribe(Float64, "camera_tilt/command", self._on_tilt, 10)
        self.create_service(
            StartEpisode, "simulator/start_episode", self._in_loop(self._start_episode)
        )
        self.create_service(EndEpisode, "simulator/end_episode", self._in_loop(self._end_episode))

    def _on_stamped_velocity(self, message: TwistStamped) -> None:
        self._on_velocity(message.twist)

    def _on_velocity(self, twist: Twist) -> None:
        self._hand_over(self.simulator.command, twist.linear.x, twist.angular.z)

    def _on_tilt(self, message: Float64) -> None:
        self._hand_over(self.simulator.tilt_to, message.data)

    def _in_loop(self, answer: Callable) -> Callable:
        """A service callback that waits until the loop has answered."""
        return lambda request, response: self._hand_over(answer, request, response).result()

    def _hand_over(self, action: Callable, *arguments: object) -> Future:
        """Leave work for the loop; called from the executor's thread."""
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

    def _start_episode(
        self, request: StartEpisode.Request, response: StartEpisode.Response
    ) -> StartEpisode.Response:
        world, camera = self.simulator.world, self.camera
        new_room = request.room != world.room.name
        try:
            if new_room:
                world, camera = self._build(request.room)
            start = start_episode(world, camera, request.goal, request.seed)
        except ValueError as error:
            if camera is not self.camera:
                camera.close()
            response.message = str(error)
            return response
        finally:
            self._pacer.restart(self.simulator.time, time.monotonic())
        if new_room:
            self.camera.close()
            self.camera = camera
            self.simulator.enter(world)
            self._publish_map()
        self.simulator.start_episode(request.goal, start)
        response.ok = True
        response.x, response.y, response.yaw = start.x, start.y, start.yaw
        response.shortest_path = start.shortest_path
        response.shortest_actions = start.shortest_actions
        return response

    def _end_episode(
        self, request: EndEpisode.Request, response: EndEpisode.Response
    ) -> EndEpisode.Response:
        goal = self.simulator.goal
        try:
            account = self.simulator.end_episode()
        except RuntimeError as error:
            response.message = str(error)
            return response
        response.ok = True
        response.goal_visible = self.camera.goal_visible(goal)
        response.collisions = account.collisions
        response.path_length = account.path_length
        response.shortest_path = account.shortest_path
        return response

    def _publish(self, collision_began: bool) -> None:
        """Publish what is due, the time first so that no stamp lies in a receiver's future.

        A message on /clock every step would cost each Python node that listens a sixth of a core.
        """
        t = self.simulator.time
        due = [every.action for every in self._schedule if every.due(t)]
        if collision_began and self._publish_state not in due:
            due.append(self._publish_contact)
        if due:
            self._clock_publisher.publish(Clock(clock=to_msg.stamp(t)))
        for action in due:
            action()

    def _publish_state(self) -> None:
        simulator = self.simulator
        t, tilt = simulator.time, simulator.world.pose.tilt
        self._odom.publish(to_msg.odometry(simulator.odometry, simulator.world.velocity, t))
        moving = to_msg.moving_transforms(simulator.odometry, tilt, t)
        self._tf.publish(TFMessage(transforms=moving))
        self._joints.publish(to_msg.joint_state(tilt, t))
        self._publish_contact()

    def _publish_contact(self) -> None:
        simulator = self.simulator
        self._hazards.publish(to_msg.hazards(simulator.collisions.contacts, simulator.time))
        self._truth.publish(to_msg.ground_truth(simulator, self._goal_visible()))

    def _publish_scan(self) -> None:
        self._scan.publish(to_msg.laser_scan(self.simulator.world.scan(), self.simulator.time))

    def _publish_picture(self) -> None:
        t = self.simulator.time
        self._image.publish(to_msg.image(self.camera.rgb(), t))
        self._camera_info.publish(to_msg.camera_info(self.parameters.camera_size, t))

    def _publish_map(self) -> None:
        grid = self.simulator.world.occupancy(MAP_RESOLUTION)
        self._map.publish(to_msg.occupancy_grid(grid, MAP_RESOLUTION, self.simulator.time))

    def _goal_visible(self) -> bool:
        """Whether the episode's goal is in view; drawing to find out costs as much as a picture."""
        if self.simulator.goal_distance() > VISIBLE_DISTANCE_M:
            return False
        pose = self.simulator.world.pose
        here = tuple(round(value, 4) for value in (pose.x, pose.y, pose.yaw, pose.tilt))
        key = (self.simulator.goal, id(self.camera), here)
        if self._seen[0] != key:
            self._seen = key, self.camera.goal_visible(self.simulator.goal)
        return self._seen[1]

    def _put_at(self, x: float, y: float, yaw: float) -> None:
        world = self.simulator.world
        inside = 0 < x < world.room.width and 0 < y < world.room.depth
        if not (inside and world.free(x, y)):
            raise ValueError(f"start ({x}, {y}) is not free in {world.room.name}; choose another.")
        self.simulator.place(x, y, yaw)

    def _put_anywhere(self) -> None:
        """Put the robot on a reachable place of the grid, drawn from the seed."""
        grid = state_grid(self.simulator.world)
        state = np.random.default_rng(self.parameters.seed).integers(len(grid.next_state))
        pose = grid.pose(int(state))
        self.simulator.place(pose.x, pose.y, pose.yaw)

    def _refuse_company(self) -> None:
        """Raise ValueError when somebody else plays the robot in this domain."""
        time.sleep(max(0.0, self._born + DISCOVERY_S - time.monotonic()))
        for topic in ("odom", "scan", "/clock"):
            if self.count_publishers(topic) > 1:
                raise ValueError(
                    f"another node publishes {topic} in ROS domain {self.context.get_domain_id()}; "
                    "choose another ROS_DOMAIN_ID."
                )
