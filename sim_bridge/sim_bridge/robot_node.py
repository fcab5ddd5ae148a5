"""The node ``mock_turtlebot4``: the topics of a TurtleBot 4, with its types and QoS.

Source of names, types and QoS: create3_docs; turtlebot4_robot (jazzy) ``republisher.yaml``; the
relay subscribes best effort with depth 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import HazardDetectionVector
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

from sim_bridge.faults import CAMERA_INFO, IMAGE, JOINTS, ODOM, SCAN, TF

CLOCK, TF_STATIC, HAZARDS = "/clock", "tf_static", "hazard_detection"
TILT = "camera_tilt/command"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)

TOPICS: dict[str, tuple[type, QoSProfile | int]] = {
    CLOCK: (Clock, 10),
    IMAGE: (Image, 10),
    CAMERA_INFO: (CameraInfo, 10),
    SCAN: (LaserScan, 10),
    ODOM: (Odometry, LATCHED),
    TF: (TFMessage, 100),
    TF_STATIC: (TFMessage, LATCHED),
    JOINTS: (JointState, 10),
    HAZARDS: (HazardDetectionVector, 5),
}
"""What the robot publishes."""


class RobotNode(Node):
    """The robot's publishers and subscriptions.

    Args:
        on_velocity: takes m/s forward and rad/s counter-clockwise, in the executor's thread.
        on_tilt: takes rad, up positive, in the executor's thread.
    """

    def __init__(
        self, on_velocity: Callable[[float, float], Any], on_tilt: Callable[[float], Any]
    ) -> None:
        super().__init__("mock_turtlebot4", automatically_declare_parameters_from_overrides=True)
        self._on_velocity = on_velocity
        self.out: dict[str, Publisher] = {
            topic: self.create_publisher(kind, topic, qos) for topic, (kind, qos) in TOPICS.items()
        }
        self._on_tilt = on_tilt
        self._ears: list[Subscription] = []
        self._heard: dict[str, type] = {}
        self._faults: frozenset[str] = frozenset()
        # Subscriptions come and go in the executor's thread only.
        self._changed = self.create_guard_condition(self._listen)
        self._listen()

    def tilt(self) -> None:
        """Obey commands to the camera's tilt, which not every camera has."""
        self.create_subscription(Float64, TILT, lambda message: self._on_tilt(message.data), 10)

    def suffer(self, faults: frozenset[str]) -> None:
        """Take the faults that hold from now on, names in ``faults.FAULTS``; in any thread."""
        self._faults = faults
        self._changed.trigger()

    def _listen(self) -> None:
        """Subscribe to commands, as far as the faults leave it."""
        faults = self._faults
        kinds: dict[str, type] = {"cmd_vel": TwistStamped, "cmd_vel_unstamped": Twist}
        if "cmd_type" in faults:
            kinds = {"cmd_vel": Twist}
        if "cmd_deaf" in faults:
            kinds = {}
        if kinds == self._heard:
            return
        for ear in self._ears:
            self.destroy_subscription(ear)
        self._heard = kinds
        self._ears = [
            self.create_subscription(kind, topic, self._hear, NEWEST)
            for topic, kind in kinds.items()
        ]

    def _hear(self, message: Twist | TwistStamped) -> None:
        twist = message.twist if isinstance(message, TwistStamped) else message
        self._on_velocity(twist.linear.x, twist.angular.z)


class RivalNode(Node):
    """Somebody else who publishes where only the robot or its driver should.

    Args:
        faults: names in ``faults.FAULTS``; of each that is a rival there is a publisher.
    """

    def __init__(self, faults: frozenset[str]) -> None:
        super().__init__("rival")
        scans, drives = "scan_rival" in faults, "cmd_rival" in faults
        self.scan = self.create_publisher(LaserScan, SCAN, 10) if scans else None
        self.velocity = self.create_publisher(TwistStamped, "cmd_vel", 1) if drives else None
