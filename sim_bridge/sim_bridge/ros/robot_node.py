"""The node ``mock_turtlebot4``: the topics of a TurtleBot 4, with its types and QoS.

Source of names, types and QoS: create3_docs; turtlebot4_robot (jazzy) ``republisher.yaml``; the
relay subscribes best effort with depth 1.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Any

from cfnav_interfaces.msg import MomentDone
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.action import Dock, Undock
from irobot_create_msgs.srv import EStop
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from rclpy.subscription import Subscription
from std_msgs.msg import Float64
from std_srvs.srv import Empty, Trigger

from cfnav_core.robot.robot import Robot
from cfnav_core.robot.topics import TOPICS, UNSTAMPED, Topic, unstamped
from sim_bridge.faults.faults import (
    CAMERA_INFO,
    COMMANDS,
    DEPTH,
    DEPTH_INFO,
    DETECTIONS,
    DOCK,
    HAZARDS,
    IMAGE,
    JOINTS,
    ODOM,
    SCAN,
    TF,
    WHEELS,
)
from sim_bridge.ros.topics import publisher

CLOCK, TF_STATIC, BATTERY, IMU, TILT = "clock", "tf_static", "battery", "imu", "tilt_command"
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
SURE = QoSProfile(depth=10)

SAID = (
    CLOCK, IMAGE, CAMERA_INFO, SCAN, ODOM, TF, TF_STATIC, JOINTS, HAZARDS, WHEELS, DOCK, BATTERY,
    IMU, DEPTH, DEPTH_INFO, DETECTIONS,
)  # fmt: skip
"""Roles of what a robot publishes, as far as it has them."""
CAMERA = {IMAGE, CAMERA_INFO, DEPTH, DEPTH_INFO, DETECTIONS}
"""Those whose publishers live as long as the camera runs: depthai's driver makes new ones at each
start (``Camera::stop`` clears its nodes, ``setupQueues`` makes them again). Source: depthai-ros,
``depthai_ros_driver/src/camera.cpp``."""


class RobotNode(Node):
    """The robot's publishers and subscriptions; ``connect`` makes them.

    Args:
        on_velocity: takes m/s forward and rad/s counter-clockwise, in the executor's thread.
        on_tilt: takes a Float64, rad, up positive, in the executor's thread.
        on_done: takes a MomentDone, in the executor's thread.
        switch: turns "e_stop", "lidar" or "camera" on or off, in the executor's thread.
        on_own: takes an action, "undock" or "dock", and its goal that was accepted, in the
            executor's thread.
    """

    def __init__(
        self,
        on_velocity: Callable[[float, float], Any],
        on_tilt: Callable[[Float64], Any],
        on_done: Callable[[MomentDone], Any],
        switch: Callable[[str, bool], Any],
        on_own: Callable[[str, ServerGoalHandle], Any],
    ) -> None:
        super().__init__("mock_turtlebot4", automatically_declare_parameters_from_overrides=True)
        self._on_velocity = on_velocity
        self._on_tilt = on_tilt
        self._on_done = on_done
        self._switch = switch
        self._on_own = on_own
        self.out: dict[str, Publisher] = {}
        """By role; a camera that is off has none."""
        self._publishing = Lock()
        self._camera: dict[str, Topic] = {}
        self._camera_runs = True
        self._robot = Robot()
        self._command_types: dict[str, type] = {}
        self._command_listeners: list[Subscription] = []
        self._faults: frozenset[str] = frozenset()
        # Subscriptions and publishers come and go in the executor's thread only.
        self._changed = self.create_guard_condition(self._follow)
        self._start: Service | None = None
        # Put off by one turn of the executor, so that a command which was sent before an answer is
        # taken before it; a policy sends one of each kind a moment.
        self._answers: list[MomentDone] = []
        self._answered = self.create_guard_condition(self._take_answers)

    def connect(
        self, robot: Robot, clock: bool, tilts: bool, lock_step: bool, depth: bool = False,
        detector: bool = False,
    ) -> None:  # fmt: skip
        """Make the publishers and subscriptions.

        Args:
            robot: whose topics.
            clock: whether simulated time is published.
            tilts: whether the camera obeys commands to its tilt.
            lock_step: commands are received reliably, or an episode would not repeat itself.
            depth: whether there is a stereo camera.
            detector: whether there is a detector on board.
        """
        self._robot = robot
        unsaid = {
            *[CLOCK] * (not clock), *(DEPTH, DEPTH_INFO) * (not depth),
            *[DETECTIONS] * (not detector),
        }  # fmt: skip
        for role in SAID:
            if role in robot.topics and role not in unsaid:
                self.out[role] = publisher(self, robot.topics[role])
        self._camera = {role: robot.topics[role] for role in self.out.keys() & CAMERA}
        self._quality = SURE if lock_step else NEWEST
        self._listen_to_commands()
        self._serve()
        if tilts and TILT in robot.topics:
            self.create_subscription(Float64, robot.topics[TILT].name, self._on_tilt, 10)
        if lock_step:
            done = TOPICS["moment_done"].name
            self.create_subscription(MomentDone, done, self._on_answer, SURE)

    def _on_answer(self, done: MomentDone) -> None:
        self._answers.append(done)
        self._answered.trigger()

    def _take_answers(self) -> None:
        answers, self._answers = self._answers, []
        for done in answers:
            self._on_done(done)

    def _serve(self) -> None:
        """Offer the services of LiDAR and camera, and the base's where it is a Create 3."""
        serve = self.create_service
        for kind, name, part, on in (
            (Empty, "start_motor", "lidar", True),
            (Empty, "stop_motor", "lidar", False),
            (Trigger, "oakd/stop_camera", "camera", False),
        ):
            serve(kind, name, partial(self._on_switch, part, on))
        self._offer_start()
        if WHEELS in self._robot.topics:
            serve(EStop, "e_stop", self._on_e_stop)
        if DOCK in self._robot.topics:
            # Executed only when they are over, see ``settle``: waiting would cost a thread.
            self._actions = [
                ActionServer(
                    self, kind, name, kind.Result,
                    handle_accepted_callback=partial(self._on_own, name),
                    cancel_callback=lambda _: CancelResponse.ACCEPT,
                )
                for name, kind in OWN_ACTIONS.items()
            ]  # fmt: skip

    def _offer_start(self) -> None:
        """Offer to start the camera, except while whoever asks shall get no answer.

        A callback of rclpy cannot stay without an answer and leave the executor to others.
        """
        hangs = "camera_start_hangs" in self._faults
        if hangs and self._start is not None:
            self.destroy_service(self._start)
            self._start = None
        elif not hangs and self._start is None:
            take = partial(self._on_switch, "camera", True)
            self._start = self.create_service(Trigger, "oakd/start_camera", take)

    def _on_switch(self, part: str, on: bool, _: Any, response: Any) -> Any:
        failed = part == "camera" and on and "camera_start_fails" in self._faults
        if not failed:
            self._switch(part, on)
        if isinstance(response, Trigger.Response):
            response.success = not failed
            response.message = "No device was found." if failed else ""
        return response

    def _on_e_stop(self, request: EStop.Request, response: EStop.Response) -> EStop.Response:
        # The relay answers with a default response although the base obeys: success is never true.
        self._switch("e_stop", request.e_stop_on)
        return response

    def take_faults(self, faults: frozenset[str]) -> None:
        """Take the faults that hold from now on, names in ``faults.FAULTS``; in any thread."""
        self._faults = faults
        self._changed.trigger()

    def run_camera(self, runs: bool) -> None:
        """Let the camera's publishers come, or go; in any thread."""
        self._camera_runs = runs
        self._changed.trigger()

    def say(self, role: str, message: Any) -> bool:
        """Publish; returns whether there is a publisher. In any thread."""
        with self._publishing:
            found = self.out.get(role)
            if found is not None:
                found.publish(message)
        return found is not None

    def _follow(self) -> None:
        """Follow the faults and the camera."""
        self._listen_to_commands()
        self._offer_start()
        with self._publishing:
            for role, topic in self._camera.items():
                if self._camera_runs and role not in self.out:
                    self.out[role] = publisher(self, topic)
                elif not self._camera_runs and role in self.out:
                    self.destroy_publisher(self.out.pop(role))

    def _listen_to_commands(self) -> None:
        """Subscribe to commands, as far as the faults leave it."""
        faults = self._faults
        velocity = self._robot.topics[COMMANDS]
        plain = velocity.type == UNSTAMPED or "cmd_type" in faults
        kinds: dict[str, type] = {velocity.name: Twist if plain else TwistStamped}
        if velocity.other_type and not plain:
            kinds[unstamped(velocity.name)] = Twist
        if "cmd_deaf" in faults:
            kinds = {}
        if kinds == self._command_types:
            return
        for listener in self._command_listeners:
            self.destroy_subscription(listener)
        self._command_types = kinds
        self._command_listeners = [
            self.create_subscription(kind, topic, self._take_velocity, self._quality)
            for topic, kind in kinds.items()
        ]

    def _take_velocity(self, message: Twist | TwistStamped) -> None:
        twist = message.twist if isinstance(message, TwistStamped) else message
        self._on_velocity(twist.linear.x, twist.angular.z)


OWN_ACTIONS = {"undock": Undock, "dock": Dock}
"""What the base does by itself when asked."""


def settle(goal: ServerGoalHandle, name: str, done: bool, docked: bool) -> Any:
    """End a goal of one of ``OWN_ACTIONS``.

    Args:
        goal: of a client.
        name: of the action.
        done: whether it was carried out.
        docked: whether the robot sits on its dock now.
    """
    if done:
        goal.succeed()
    elif goal.is_cancel_requested:
        goal.canceled()
    else:
        goal.abort()
    return OWN_ACTIONS[name].Result(is_docked=docked)


RIVALS = {
    "scan_rival": SCAN, "cmd_rival": COMMANDS, "estimate_rival": "estimate", "image_rival": IMAGE,
    "odom_rival": ODOM, "hazards_rival": HAZARDS, "depth_rival": DEPTH,
    "detections_rival": DETECTIONS,
}  # fmt: skip
"""The role of what a rival publishes, by the fault that brings it."""


class RivalNode(Node):
    """Somebody else who publishes where only the robot or its driver should.

    Attributes:
        out: a publisher for each fault of ``RIVALS`` that holds.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__("rival")
        self._robot = robot
        self.out: dict[str, Publisher] = {}

    def take_faults(self, faults: frozenset[str]) -> None:
        """Take the faults that hold from now on; what goes on holding is left alone."""
        for fault in self.out.keys() - faults:
            self.destroy_publisher(self.out.pop(fault))
        for fault in RIVALS.keys() & faults - self.out.keys():
            topics = {**TOPICS, **self._robot.topics}
            self.out[fault] = publisher(self, topics[RIVALS[fault]])
