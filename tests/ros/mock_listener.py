"""The mock TurtleBot 4 as a process, and a node that hears all it says and drives it."""

from __future__ import annotations

import os
import sys
from collections import defaultdict

import numpy as np
from cfnav_interfaces.msg import FaultStatus, GroundTruth
from cfnav_interfaces.srv import EndEpisode, SetFault, StartEpisode
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import DockStatus, HazardDetection, HazardDetectionVector, WheelStatus
from irobot_create_msgs.srv import EStop
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, JointState, LaserScan
from sim_bridge.room.room import generate_room, parse_room
from sim_bridge.world.world import HULL_RADIUS, World
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

from tests.conftest import RunningProcess
from tests.ros.own_node import OwnNode

ROOM, OTHER_ROOM = "kitchen:21", "bathroom:20"
TOPICS = {
    "/clock": Clock,
    "oakd/rgb/preview/image_raw": Image,
    "oakd/rgb/preview/camera_info": CameraInfo,
    "scan": LaserScan,
    "odom": Odometry,
    "tf": TFMessage,
    "tf_static": TFMessage,
    "joint_states": JointState,
    "hazard_detection": HazardDetectionVector,
    "wheel_status": WheelStatus,
    "dock_status": DockStatus,
    "battery_state": BatteryState,
    "imu": Imu,
    "ground_truth/state": GroundTruth,
    "ground_truth/map": OccupancyGrid,
}
RELAYED = {"odom", "hazard_detection", "wheel_status", "dock_status", "battery_state", "imu"}
LATCHED = {"tf_static", "ground_truth/map", *RELAYED}
SENSORS = {"scan", "oakd/rgb/preview/image_raw", "oakd/rgb/preview/camera_info"}


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


def start_mock(log, domain, *parameters):
    command = [sys.executable, "-m", "sim_bridge.ros.mock_turtlebot4", *ros_arguments(parameters)]
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    return RunningProcess(command, log, environment)


def ros_arguments(parameters):
    return ["--ros-args", *(word for parameter in parameters for word in ("-p", parameter))]


class Listener(OwnNode):
    """Keeps every message, with its number among those sent on its topic; sends commands."""

    def __init__(self, domain):
        super().__init__(domain, "listener")
        self.heard, self.numbers = defaultdict(list), defaultdict(list)
        for topic, kind in TOPICS.items():
            qos = QoSProfile(depth=50)
            if topic in LATCHED:
                qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
            self.node.create_subscription(kind, topic, self._keep_on(topic), qos)
        best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.velocity = self.node.create_publisher(TwistStamped, "cmd_vel", best_effort)
        self.unstamped = self.node.create_publisher(Twist, "cmd_vel_unstamped", best_effort)
        self.tilt = self.node.create_publisher(Float64, "camera_tilt/command", 10)
        self.clients = {
            kind: self.node.create_client(kind, f"simulator/{name}")
            for kind, name in (
                (StartEpisode, "start_episode"),
                (EndEpisode, "end_episode"),
                (SetFault, "set_fault"),
            )
        }
        self.clients[EStop] = self.node.create_client(EStop, "e_stop")
        self.faults = []
        every = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(FaultStatus, "simulator/fault", self.faults.append, every)

    def _keep_on(self, topic):
        def keep(message, info):
            self.heard[topic].append(message)
            self.numbers[topic].append(info["publication_sequence_number"])

        return keep

    def last(self, topic):
        return self.heard[topic][-1]

    def stamps(self, topic):
        """Of all messages heard, s."""
        return [seconds(message.header.stamp) for message in self.heard[topic]]

    def now(self):
        return seconds(self.last("/clock").clock)

    @property
    def truth(self):
        """The newest state."""
        return self.last("ground_truth/state")

    def truth_time(self):
        return seconds(self.truth.header.stamp)

    def wait_connected(self, tilt=True, commands=True, without=()):
        publishers = [self.velocity, self.unstamped] * commands + [self.tilt] * tilt
        topics = set(TOPICS) - set(without)
        self.wait(lambda: all(self.heard[topic] for topic in topics), "every topic")
        self.wait(lambda: all(p.get_subscription_count() for p in publishers), "subscriptions")

    def drive(self, v, w, condition, what, unstamped=False):
        """Renew a command at every odometry message until a condition holds."""
        answered = [0]

        def renew():
            if len(self.heard["odom"]) == answered[0]:
                return
            answered[0] = len(self.heard["odom"])
            twist = Twist()
            twist.linear.x, twist.angular.z = v, w
            if unstamped:
                self.unstamped.publish(twist)
            else:
                message = TwistStamped(twist=twist)
                message.header.stamp = self.last("odom").header.stamp
                self.velocity.publish(message)

        self.wait(condition, what, renew)

    def odometry_time(self):
        """The newest odometry's stamp (s); by a listener that lags, behind the clock's."""
        return seconds(self.last("odom").header.stamp)

    def bumps(self):
        """The zones in which the newest hazards say that something presses the bumper."""
        found = self.last("hazard_detection").detections
        return [hazard.header.frame_id for hazard in found if hazard.type == HazardDetection.BUMP]

    def wait_rest(self):
        """Hear odometry and truth say of a moment from now on that the robot stands."""
        since = max(self.truth_time(), self.odometry_time())

        def rests():
            twist = self.last("odom").twist.twist
            still = abs(twist.linear.x) < 1e-4 and abs(twist.angular.z) < 1e-4
            at_rest = self.truth.still_since and self.truth_time() > since
            return still and at_rest and self.odometry_time() > since

        self.wait(rests, "the robot to stand still")

    def wait_for(self, duration):
        """Hear messages for some seconds of the truth's time."""
        until = self.truth_time() + duration
        self.wait(lambda: self.truth_time() > until, f"{duration} s to pass")

    def call(self, kind, **fields):
        return self._answer(self.clients[kind], kind.Request(**fields))

    def ask(self, kind, name):
        """Call another service of the robot."""
        client = self.node.create_client(kind, name)
        try:
            return self._answer(client, kind.Request())
        finally:
            self.node.destroy_client(client)

    def _answer(self, client, request):
        self.wait(client.service_is_ready, "the service")
        answer = client.call_async(request)
        self.wait(answer.done, "the answer")
        return answer.result()


def before_a_wall():
    """A free pose that looks at a wall or a piece of furniture 0.63 m ahead of the hull."""
    world = World(generate_room(*parse_room(ROOM)))
    for x in np.arange(world.room.width - HULL_RADIUS, 0.5, -0.01):
        for y in np.arange(0.4, world.room.depth - 0.4, 0.1):
            ahead = world.free(x + 0.03, y)
            if not ahead and world.sweep_free((x, y), (x - 0.6, y)):
                return float(x) - 0.6, float(y), 0.0
    raise AssertionError("no wall found")
