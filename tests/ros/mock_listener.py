"""The mock TurtleBot 4 as a process, and a node that hears all it says and drives it."""

from __future__ import annotations

import fcntl
import os
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import contextmanager
from pathlib import Path

import rclpy
from cfnav_interfaces.msg import FaultStatus, GroundTruth
from cfnav_interfaces.srv import EndEpisode, SetFault, StartEpisode
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import DockStatus, HazardDetection, HazardDetectionVector, WheelStatus
from irobot_create_msgs.srv import EStop
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, JointState, LaserScan
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

from tests.conftest import DEADLINE_S, DOMAINS, RunningProcess

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
RELAYED = {"odom", "wheel_status", "dock_status", "battery_state", "imu"}
LATCHED = {"tf_static", "ground_truth/map", *RELAYED}
SENSORS = {"scan", "oakd/rgb/preview/image_raw", "oakd/rgb/preview/camera_info"}


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


@contextmanager
def locked_domain():
    """A ROS domain for a whole module, locked like those of ``ros_domain_id``."""
    folder = Path(tempfile.gettempdir(), "cfnav-domains")
    folder.mkdir(exist_ok=True)
    for number in reversed(DOMAINS):
        with (folder / str(number)).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield number
            return
    raise AssertionError("all ROS domains are taken by other tests")


def start_mock(log, domain, *parameters):
    command = [sys.executable, "-m", "sim_bridge.mock_turtlebot4", *ros_arguments(parameters)]
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    return RunningProcess(command, log, environment)


def ros_arguments(parameters):
    return ["--ros-args", *(word for parameter in parameters for word in ("-p", parameter))]


class Listener:
    """Another node in the domain, in this process: keeps every message, sends commands."""

    def __init__(self, domain):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node("listener", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard = defaultdict(list)
        for topic, kind in TOPICS.items():
            qos = QoSProfile(depth=50)
            if topic in LATCHED:
                qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
            self.node.create_subscription(kind, topic, self.heard[topic].append, qos)
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

    def last(self, topic):
        return self.heard[topic][-1]

    def now(self):
        return seconds(self.last("/clock").clock)

    def wait(self, condition, what, each=lambda: None):
        """Hear messages until a condition holds; ``each`` is called between them."""
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, f"waited in vain: {what}"
            each()
            self.executor.spin_once(timeout_sec=0.05)

    def wait_connected(self, tilt=True, commands=True, without=()):
        publishers = [self.velocity, self.unstamped] * commands + [self.tilt] * tilt
        topics = set(TOPICS) - set(without)
        self.wait(lambda: all(self.heard[topic] for topic in topics), "every topic")
        self.wait(lambda: all(p.get_subscription_count() for p in publishers), "subscriptions")

    def drive(self, v, w, condition, what, unstamped=False):
        """Renew a command at every odometry message until a condition holds.

        Returns the stamp (s) of the last odometry that was answered with a command.
        """
        sent, answered = [0], [0.0]

        def renew():
            if len(self.heard["odom"]) == sent[0]:
                return
            sent[0], answered[0] = len(self.heard["odom"]), self.odometry_time()
            twist = Twist()
            twist.linear.x, twist.angular.z = v, w
            if unstamped:
                self.unstamped.publish(twist)
            else:
                message = TwistStamped(twist=twist)
                message.header.stamp = self.last("odom").header.stamp
                self.velocity.publish(message)

        self.wait(condition, what, renew)
        return answered[0]

    def odometry_time(self):
        """The newest odometry's stamp (s); by a listener that lags, behind the clock's."""
        return seconds(self.last("odom").header.stamp)

    def bumps(self):
        """The zones in which the newest hazards say that something presses the bumper."""
        found = self.last("hazard_detection").detections
        return [hazard.header.frame_id for hazard in found if hazard.type == HazardDetection.BUMP]

    def wait_rest(self):
        def rests():
            twist = self.last("odom").twist.twist
            return abs(twist.linear.x) < 1e-4 and abs(twist.angular.z) < 1e-4

        self.wait(rests, "the robot to stand still")

    def wait_for(self, duration):
        """Hear messages for some seconds of the truth's time."""
        until = seconds(self.last("ground_truth/state").header.stamp) + duration
        self.wait(
            lambda: seconds(self.last("ground_truth/state").header.stamp) > until,
            f"{duration} s to pass",
        )

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

    def close(self):
        rclpy.shutdown(context=self.context)
        self.executor.shutdown()
        self.node.destroy_node()
