"""The node ``mock_turtlebot4``: the topics of a TurtleBot 4, with its types and QoS.

Source of names, types and QoS: create3_docs; turtlebot4_robot (jazzy) ``republisher.yaml``; the
relay subscribes best effort with depth 1.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from cfnav_interfaces.msg import MomentDone
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.action import Undock
from irobot_create_msgs.msg import DockStatus, HazardDetectionVector, WheelStatus
from irobot_create_msgs.srv import EStop
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, JointState, LaserScan
from std_msgs.msg import Float64
from std_srvs.srv import Empty, Trigger
from tf2_msgs.msg import TFMessage

from sim_bridge.faults import CAMERA_INFO, DOCK, HAZARDS, IMAGE, JOINTS, ODOM, SCAN, TF, WHEELS

CLOCK, TF_STATIC, BATTERY, IMU = "/clock", "tf_static", "battery_state", "imu"
TILT = "camera_tilt/command"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
SURE = QoSProfile(depth=10)

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
    WHEELS: (WheelStatus, LATCHED),
    DOCK: (DockStatus, LATCHED),
    BATTERY: (BatteryState, LATCHED),
    IMU: (Imu, LATCHED),
}
"""What the robot publishes."""


class RobotNode(Node):
    """The robot's publishers and subscriptions; ``connect`` makes them.

    Args:
        on_velocity: takes m/s forward and rad/s counter-clockwise, in the executor's thread.
        on_tilt: takes rad, up positive, in the executor's thread.
        on_done: takes a MomentDone, in the executor's thread.
        switch: turns "e_stop", "lidar" or "camera" on or off, in the executor's thread.
        on_undock: takes a goal that was accepted, in the executor's thread.
    """

    def __init__(
        self,
        on_velocity: Callable[[float, float], Any],
        on_tilt: Callable[[float], Any],
        on_done: Callable[[MomentDone], Any],
        switch: Callable[[str, bool], Any],
        on_undock: Callable[[ServerGoalHandle], Any],
    ) -> None:
        super().__init__("mock_turtlebot4", automatically_declare_parameters_from_overrides=True)
        self._on_velocity = on_velocity
        self._on_tilt = on_tilt
        self._on_done = on_done
        self._switch = switch
        self._on_undock = on_undock
        self.out: dict[str, Publisher] = {}
        self._ears: list[Subscription] = []
        self._heard: dict[str, type] = {}
        self._faults: frozenset[str] = frozenset()
        # Subscriptions come and go in the executor's thread only.
        self._changed = self.create_guard_condition(self._listen)
        # Put off by one turn of the executor, so that a command which was sent before an answer is
        # taken before it; a policy sends one of each kind a moment.
        self._answers: list[MomentDone] = []
        self._answered = self.create_guard_condition(self._take_answers)

    def connect(self, clock: bool, tilts: bool, lock_step: bool) -> None:
        """Make the publishers and subscriptions.

        Args:
            clock: whether simulated time is published.
            tilts: whether the camera obeys commands to its tilt.
            lock_step: commands are received reliably, or an episode would not repeat itself.
        """
        for topic, (kind, qos) in TOPICS.items():
            if clock or topic != CLOCK:
                self.out[topic] = self.create_publisher(kind, topic, qos)
        self._quality = SURE if lock_step else NEWEST
        self._listen()
        self._serve()
        if tilts:
            self.create_subscription(Float64, TILT, lambda message: self._on_tilt(message.data), 10)
        if lock_step:
            self.create_subscription(MomentDone, "simulator/moment_done", self._on_answer, SURE)

    def _on_answer(self, done: MomentDone) -> None:
        self._answers.append(done)
        self._answered.trigger()

    def _take_answers(self) -> None:
        answers, self._answers = self._answers, []
        for done in answers:
            self._on_done(done)

    def _serve(self) -> None:
        """Offer the robot's services and its action."""
        serve = self.create_service
        for kind, name, part, on in (
            (Empty, "start_motor", "lidar", True),
            (Empty, "stop_motor", "lidar", False),
            (Trigger, "oakd/start_camera", "camera", True),
            (Trigger, "oakd/stop_camera", "camera", False),
        ):
            serve(kind, name, partial(self._on_switch, part, on))
        serve(EStop, "e_stop", self._on_e_stop)
        # Executed only when it is over, see ``settle_undock``: waiting would cost a thread.
        self._undock = ActionServer(
            self, Undock, "undock", Undock.Result, handle_accepted_callback=self._on_undock
        )

    def _on_switch(self, part: str, on: bool, _: Any, response: Any) -> Any:
        self._switch(part, on)
        if isinstance(response, Trigger.Response):
            response.success = True
        return response

    def _on_e_stop(self, request: EStop.Request, response: EStop.Response) -> EStop.Response:
        # The relay answers with a default response although the base obeys: success is never true.
        self._switch("e_stop", request.e_stop_on)
        return response

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
            self.create_subscription(kind, topic, self._hear, self._quality)
            for topic, kind in kinds.items()
        ]

    def _hear(self, message: Twist | TwistStamped) -> None:
        twist = message.twist if isinstance(message, TwistStamped) else message
        self._on_velocity(twist.linear.x, twist.angular.z)


def settle_undock(goal: ServerGoalHandle, done: bool, docked: bool) -> Undock.Result:
    """End an undock goal.

    Args:
        goal: of a client.
        done: whether the robot has left its dock for it and turned.
        docked: whether it sits on its dock now.
    """
    if done:
        goal.succeed()
    else:
        goal.abort()
    return Undock.Result(is_docked=docked)


RIVALS: dict[str, tuple[type, str, int]] = {
    "scan_rival": (LaserScan, SCAN, 10),
    "cmd_rival": (TwistStamped, "cmd_vel", 1),
}
"""What a rival publishes, by the fault that brings it: type, topic and depth."""


class RivalNode(Node):
    """Somebody else who publishes where only the robot or its driver should.

    Attributes:
        out: a publisher for each fault of ``RIVALS`` that holds.
    """

    def __init__(self) -> None:
        super().__init__("rival")
        self.out: dict[str, Publisher] = {}

    def suffer(self, faults: frozenset[str]) -> None:
        """Take the faults that hold from now on; what goes on holding is left alone."""
        for fault in self.out.keys() - faults:
            self.destroy_publisher(self.out.pop(fault))
        for fault in RIVALS.keys() & faults - self.out.keys():
            self.out[fault] = self.create_publisher(*RIVALS[fault])
