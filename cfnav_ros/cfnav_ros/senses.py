"""The robot's topics -> ``Inputs``: the newest message of each, and why one does not come."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cfnav_interfaces.msg import CollisionEstimate
from irobot_create_msgs.msg import DockStatus, HazardDetectionVector, WheelStatus
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import Image, JointState

from cfnav_ros import conversions
from cfnav_ros.diagnostics import Rate
from cfnav_ros.inputs import Inputs, needed
from cfnav_ros.picture_watch import PictureWatch
from cfnav_ros.policy_parameters import PolicyParameters
from cfnav_ros.preflight import BaseCheck, explain_silence


class Senses:
    """Keeps ``inputs`` up to date."""

    def __init__(self, node: Node, settings: PolicyParameters, wake: Callable[[], None]) -> None:
        """Listen.

        Args:
            node: owner of the subscriptions.
            settings: names of topic and joint, time of frozen pictures, lock-step.
            wake: called after every picture and estimate, for which an episode waits, and in
                lock-step after all that belongs to a moment.
        """
        self.inputs = Inputs()
        self._node, self._settings, self._wake = node, settings, wake
        self.heard: set[str] = set()
        """Fields of ``Inputs`` and ``diagnostics.STATUSES`` of which a message has come."""
        self._pictures = PictureWatch(settings.frozen_picture_time)
        newest = qos_profile_sensor_data
        only_newest = QoSProfile(depth=1, reliability=newest.reliability)
        if settings.lock_step:  # nothing may be lost: the simulator waits until all has come
            newest = only_newest = QoSProfile(depth=10)
        subscribe = node.create_subscription
        self._listeners = {
            "frame": subscribe(Image, settings.image_topic, self._on_image, only_newest),
            "estimate": subscribe(CollisionEstimate, "collision/estimate", self._on_estimate, 5),
            "odometry": subscribe(Odometry, "odom", self._on_odometry, newest),
            "tilt": subscribe(JointState, "joint_states", self._on_joints, newest),
        }
        subscribe(HazardDetectionVector, "hazard_detection", self._on_hazards, newest)
        subscribe(DockStatus, "dock_status", self._on_dock, qos_profile_sensor_data)
        subscribe(WheelStatus, "wheel_status", self._on_wheels, qos_profile_sensor_data)
        self._rates = {name: Rate() for name in self._listeners}

    @property
    def image_topic(self) -> str:
        """Resolved name of the pictures' topic."""
        return self._listeners["frame"].topic_name

    def rates(self) -> dict[str, float]:
        """Messages a second of real time, by field of ``Inputs``."""
        real = time.monotonic()
        return {name: rate.hz(real) for name, rate in self._rates.items()}

    def notice_base(self, base: BaseCheck) -> None:
        """Take who listens on cmd_vel, and what the graph says of inputs that never came."""
        notes, names = {**self.inputs.notes}, ()
        limits = self._settings.episode
        for name in needed(limits.lidar, limits.has_tilt):
            if name in self.heard:
                continue
            listener = self._listeners[name]
            topic, expected = listener.topic_name, conversions.type_name(listener.msg_type)
            names = names or [found for found, _ in self._node.get_topic_names_and_types()]
            infos = self._node.get_publishers_info_by_topic(topic)
            below = [found for found in names if found.startswith(f"{topic}/")]
            sources = conversions.sources(infos, listener)
            notes[name] = explain_silence(topic, expected, sources, below)
        self.inputs = replace(self.inputs, base=base, notes=notes)

    def _on_image(self, message: Image) -> None:
        self._take("frame", conversions.frame_from_message, message)
        inputs = self.inputs
        picture = self._pictures.look(inputs.frame, inputs.odometry, inputs.tilt)
        self.inputs = replace(inputs, picture=picture)
        self._wake()

    def _on_estimate(self, message: CollisionEstimate) -> None:
        self._take("estimate", conversions.estimate_from_message, message)
        self._wake()

    def _on_odometry(self, message: Odometry) -> None:
        self._take("odometry", conversions.odometry_from_message, message)
        if self._settings.lock_step:
            self._wake()

    def _on_joints(self, message: JointState) -> None:
        joint = self._settings.tilt_joint
        otherwise = f"{self._listeners['tilt'].topic_name} gives no position of {joint}"
        self._take("tilt", conversions.tilt_from_message, message, joint, otherwise=otherwise)
        if self._settings.lock_step:
            self._wake()

    def _on_hazards(self, message: HazardDetectionVector) -> None:
        self.heard.add("hazards")
        self._take("bumped_at", conversions.bump_from_message, message)
        self._take("front_bumped_at", conversions.front_bump_from_message, message)

    def _on_dock(self, message: DockStatus) -> None:
        self.heard.add("dock status")
        self.inputs = replace(self.inputs, docked=message.is_docked)

    def _on_wheels(self, message: WheelStatus) -> None:
        self.heard.add("wheel status")
        self.inputs = replace(self.inputs, powered=message.wheels_enabled)

    def _take(
        self, name: str, convert: Callable[..., Any], *message: Any, otherwise: str = ""
    ) -> None:
        """Keep a message; one that makes no sense is left out, so that its input grows old.

        Args:
            name: field of ``Inputs``.
            convert: gives the field's value, or None when the message speaks of something else.
            message: what it is given.
            otherwise: note for a message that speaks of something else.
        """
        self.heard.add(name)
        if name in self._rates:
            self._rates[name].note(time.monotonic())
        notes = {key: note for key, note in self.inputs.notes.items() if key != name}
        try:
            value = convert(*message)
        except ValueError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=2.0)
            self.inputs = replace(self.inputs, notes={**notes, name: str(error).rstrip(".")})
            return
        if value is None:
            notes = {**notes, name: otherwise} if otherwise else notes
            self.inputs = replace(self.inputs, notes=notes)
        else:
            now = self._node.get_clock().now().nanoseconds * 1e-9
            arrived = {**self.inputs.arrived, name: now}
            self.inputs = replace(self.inputs, **{name: value}, arrived=arrived, notes=notes)
