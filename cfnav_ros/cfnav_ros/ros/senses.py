"""The robot's topics -> ``SensorInputs``: the newest message of each, and why one does not come."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cfnav_interfaces.msg import CollisionEstimate
from irobot_create_msgs.msg import DockStatus, HazardDetectionVector, WheelStatus
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import (
    BatteryState,
    CameraInfo,
    CompressedImage,
    Image,
    JointState,
    LaserScan,
)

from cfnav_core.policy.policy import Policy
from cfnav_core.robot.robot import Robot
from cfnav_ros.drive import fields
from cfnav_ros.drive.camera_watch import CameraWatch
from cfnav_ros.drive.detection_watch import DetectionWatch
from cfnav_ros.drive.diagnostics import STATUSES, Rate
from cfnav_ros.drive.inputs import DETECTIONS, CameraFrame, SensorInputs, needed
from cfnav_ros.drive.picture_watch import PictureWatch
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.drive.preflight import BaseCheck, explain_silence, relatives
from cfnav_ros.robot.speakers import GUARDED, OneSpeaker
from cfnav_ros.ros import conversions
from cfnav_ros.ros.listener import Listener
from cfnav_ros.ros.topics import message_type, newest_only


class Senses:
    """Keeps ``inputs`` up to date."""

    def __init__(
        self,
        node: Node,
        policy: Policy,
        settings: PolicyParameters,
        robot: Robot,
        wake: Callable[[], None],
    ) -> None:
        """Listen.

        Args:
            node: owner of the subscriptions.
            policy: says which pictures it can use and which camera it learnt from.
            settings: name of the joint, time of frozen pictures, lock-step.
            robot: names of the topics that there are.
            wake: called after every picture and estimate, for which an episode waits, and in
                lock-step after all that belongs to a moment.
        """
        self.inputs = SensorInputs()
        self._node, self._settings, self._wake = node, settings, wake
        self.heard: set[str] = set()
        """Fields of ``SensorInputs`` and ``diagnostics.STATUSES`` of which a message has come."""
        self._detections: DetectionWatch | None = None
        if policy.reads_sightings:
            self._detections = self._watch_detections(policy, robot)
            self.inputs = replace(self.inputs, view=DETECTIONS)
        check_size = None if self._detections else policy.check_size
        self._pictures = PictureWatch(check_size, settings.frozen_picture_time)
        only_newest = newest_only(settings.lock_step)
        # nothing may be lost: the simulator waits until all has come
        newest = only_newest if settings.lock_step else qos_profile_sensor_data
        self._listeners: dict[str, Listener] = {}
        """By field of ``SensorInputs``, or by the name that the thing has in ``STATUSES``."""
        view = "detections" if policy.reads_sightings else "image"
        kind_of_view = message_type(robot.topics[view].type)
        for heard, role, kind, act, qos in (
            ("frame", view, kind_of_view, self._on_view, only_newest),
            ("estimate", "estimate", CollisionEstimate, self._on_estimate, 5),
            ("odometry", "odom", Odometry, self._on_odometry, newest),
            ("tilt", "joint_states", JointState, self._on_joints, newest),
        ):
            if topic := robot.topics.get(role):
                self._listeners[heard] = Listener(node, kind, topic.name, act, qos)
        for heard, role, kind, act in (
            ("hazards", "hazards", HazardDetectionVector, self._on_hazards),
            ("dock status", "dock_status", DockStatus, self._on_dock),
            ("wheel status", "wheel_status", WheelStatus, self._on_wheels),
            ("battery", "battery", BatteryState, self._on_battery),
        ):
            if topic := robot.topics.get(role):
                self._listeners[heard] = Listener(node, kind, topic.name, act, newest, state=True)
        self._drives = False
        self._guarded = {
            name: OneSpeaker(listener.topic, listener.type)
            for name, listener in self._listeners.items()
            if name in GUARDED
        }
        if scan := robot.topics.get("scan"):
            self._guarded["scan"] = OneSpeaker(node.resolve_topic_name(scan.name), scan.type)
            if self._detections and settings.detections.far_by == "lidar":
                node.create_subscription(LaserScan, scan.name, self._on_scan, newest)
        info = robot.topics.get("camera_info")
        self._camera = CameraWatch(policy.camera, info is not None, settings.other_camera)
        if info:
            node.create_subscription(CameraInfo, info.name, self._on_camera, newest)
        self._rates = {name: Rate() for name in self._listeners if name not in STATUSES}

    def _watch_detections(self, policy: Policy, robot: Robot) -> DetectionWatch:
        if "detections" not in robot.topics:
            raise ValueError(
                f"The robot {robot.name} has no topic for detections, which bundle {policy.name} "
                "reads: name one in its file."
            )
        return DetectionWatch(self._settings.detections, robot)

    def topic(self, name: str) -> str:
        """Resolved name of the topic of a field of ``SensorInputs``; "frame" is what is seen."""
        return self._listeners[name].topic

    def unseen(self, goal: str) -> str:
        """Why the detector can never see a goal, as one sentence; "" when it can or is none."""
        return self._detections.unseen(goal) if self._detections else ""

    @property
    def quiet(self) -> set[str]:
        """Names in ``STATUSES`` of what somebody offers to tell and has not told yet."""
        offered = {name for name in STATUSES if name in self._listeners} - self.unheard.keys()
        return offered - self.heard

    @property
    def unheard(self) -> dict[str, str]:
        """Resolved topics that nobody tells of, by name in ``STATUSES``.

        A robot that offers one and is silent has had no change to tell.
        """
        listeners = {name: self._listeners[name] for name in STATUSES if name in self._listeners}
        return {
            name: listener.topic
            for name, listener in listeners.items()
            if name not in self.heard and not listener.subscription.get_publisher_count()
        }

    def rates(self) -> dict[str, float]:
        """Messages a second of real time, by field of ``SensorInputs``."""
        real = time.monotonic()
        return {name: rate.hz(real) for name, rate in self._rates.items()}

    def restart(self) -> None:
        """Begin an episode.

        Publishers may still come and go, as a camera's that starts when the robot leaves its dock.
        """
        for name in self._guarded:
            self._begin_anew(name)
        self.inputs = replace(self.inputs, rival="")

    def hold(self) -> None:
        """The robot drives: whoever speaks alone now is who must speak until ``release``."""
        if not self._drives:
            self._drives = True
            self._trust()

    def release(self) -> None:
        """The episode is over: publishers may come and go."""
        if self._drives:
            self._trust()  # names may have been discovered meanwhile
        self._drives = False

    def _trust(self) -> None:
        for one in self._guarded.values():
            one.trust()

    def look_for_rivals(self) -> None:
        """Ask the graph who speaks on each topic that safety hangs on."""
        if not self._drives:
            for name in self._guarded:
                self._begin_anew(name)
        found = filter(None, map(self._rival, self._guarded))
        self.inputs = replace(self.inputs, rival=next(found, ""))

    def _begin_anew(self, name: str) -> None:
        """Where others have spoken and one is left, forget all that was said.

        That the bumper is pressed is kept: whoever is left may tell of changes only.
        """
        listener = self._listeners.get(name)
        if listener is None or not listener.begin_anew():
            return
        self.heard.discard(name)
        blank = SensorInputs()
        arrived = {key: at for key, at in self.inputs.arrived.items() if key != name}
        if name == "frame":
            self.inputs = replace(self.inputs, frame=blank.frame, picture=blank.picture)
        elif name != "hazards":
            self.inputs = replace(self.inputs, **{name: getattr(blank, name)})
        self.inputs = replace(self.inputs, arrived=arrived)

    def _rivaled(self, name: str) -> bool:
        """Whether another than the known one speaks, or might; told to the episode."""
        rival = self._rival(name)
        if rival:
            self.inputs = replace(self.inputs, rival=rival)
        return bool(rival)

    def _rival(self, name: str) -> str:
        one, listener = self._guarded[name], self._listeners.get(name)
        if not self._drives:
            one.forget()
        infos = self._node.get_publishers_info_by_topic(one.topic)
        # the count is asked last: whoever came before the message did is in it
        return one.look(conversions.speakers(infos, one.type), listener.met if listener else 0)

    def notice_base(self, base: BaseCheck) -> None:
        """Take who listens on cmd_vel, and what the graph says of inputs that never came."""
        notes, names = {**self.inputs.notes}, list[str]()
        limits = self._settings.episode
        for name in needed(limits.lidar, limits.has_tilt):
            if name in self.heard:
                continue
            listener = self._listeners[name]
            topic, expected = listener.topic, listener.type
            names = names or [found for found, _ in self._node.get_topic_names_and_types()]
            infos = self._node.get_publishers_info_by_topic(topic)
            sources = conversions.sources(infos, listener.subscription)
            notes[name] = explain_silence(topic, expected, sources, relatives(topic, names))
        self.inputs = replace(self.inputs, base=base, notes=notes)

    def _on_view(self, message: Any) -> None:
        convert = self._sightings if self._detections else self._frame
        if not self._take("frame", convert, message):
            return
        inputs = self.inputs
        picture = self._pictures.look(inputs.frame, inputs.odometry, inputs.tilt)
        self.inputs = replace(inputs, picture=picture)
        self._wake()

    def _frame(self, message: Image | CompressedImage) -> CameraFrame:
        return self._camera.see(conversions.frame_from_message(message))

    def _sightings(self, message: Any) -> CameraFrame:
        """What a detector says; what makes no sense stops the robot as long as it is the newest."""
        assert self._detections is not None
        stamp_ns, angle = fields.stamp_to_ns(message.header.stamp), self.inputs.tilt.angle
        try:
            claims = fields.detections_from_message(message)
        except ValueError as error:
            return CameraFrame(stamp_ns, waiting=str(error))
        return self._detections.see(stamp_ns, claims, angle)

    def _on_scan(self, message: LaserScan) -> None:
        assert self._detections is not None
        if not self._rivaled("scan"):
            scan = fields.scan_from_message(message)
            self._detections.hear(fields.stamp_to_seconds(message.header.stamp), scan)

    def _on_camera(self, message: CameraInfo) -> None:
        self.heard.add("camera info")
        camera = fields.pinhole_from_message(message)
        self._camera.tell(camera, self._drives)
        if self._detections:
            self._detections.tell(camera, self._drives)

    def _on_estimate(self, message: CollisionEstimate) -> None:
        self._take("estimate", fields.estimate_from_message, message)
        self._wake()

    def _on_odometry(self, message: Odometry) -> None:
        self._take("odometry", fields.odometry_from_message, message)
        if self._settings.lock_step:
            self._wake()

    def _on_joints(self, message: JointState) -> None:
        joint = self._settings.tilt_joint
        otherwise = f"{self._listeners['tilt'].topic} gives no position of {joint}"
        self._take("tilt", fields.tilt_from_message, message, joint, otherwise=otherwise)
        if self._settings.lock_step:
            self._wake()

    def _on_hazards(self, message: HazardDetectionVector) -> None:
        # A stranger may say that the bumper is pressed, but not that it is free; and what the base
        # says of it meanwhile comes only once.
        if self._rivaled("hazards") and not fields.bumper_from_message(message):
            return
        self.heard.add("hazards")
        self._take("bumper", fields.bumper_from_message, message)
        self._take("bumped_at", fields.bump_from_message, message)

    def _on_dock(self, message: DockStatus) -> None:
        self.heard.add("dock status")
        self.inputs = replace(self.inputs, docked=message.is_docked)

    def _on_wheels(self, message: WheelStatus) -> None:
        self.heard.add("wheel status")
        self.inputs = replace(self.inputs, powered=message.wheels_enabled)

    def _on_battery(self, message: BatteryState) -> None:
        self.heard.add("battery")
        self.inputs = replace(self.inputs, battery=fields.charge_from_message(message))

    def _take(
        self, name: str, convert: Callable[..., Any], *message: Any, otherwise: str = ""
    ) -> bool:
        """Keep a message; one that makes no sense is left out, so that its input grows old.

        A message that may be another publisher's than the known one is not even looked at.

        Args:
            name: field of ``SensorInputs``.
            convert: gives the field's value, or None when the message speaks of something else.
            message: what it is given.
            otherwise: note for a message that speaks of something else.

        Returns:
            Whether it was kept.
        """
        if name in self._guarded and self._rivaled(name):
            return False
        self.heard.add(name)
        if name in self._rates:
            self._rates[name].note(time.monotonic())
        notes = {key: note for key, note in self.inputs.notes.items() if key != name}
        try:
            value = convert(*message)
        except ValueError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=2.0)
            self.inputs = replace(self.inputs, notes={**notes, name: str(error).rstrip(".")})
            return False
        if value is None:
            notes = {**notes, name: otherwise} if otherwise else notes
            self.inputs = replace(self.inputs, notes=notes)
        else:
            now = self._node.get_clock().now().nanoseconds * 1e-9
            arrived = {**self.inputs.arrived, name: now}
            self.inputs = replace(self.inputs, **{name: value}, arrived=arrived, notes=notes)
        return value is not None
