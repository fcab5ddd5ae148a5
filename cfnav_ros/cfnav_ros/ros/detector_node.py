"""Pictures -> Detection2DArray: any detector in an ONNX file, where the camera brings none.

Run it with ``cfnav node detector``; its parameters are those of ``DetectorParameters``. A class is
told by its name and a box in pixels of the picture; a message bears the stamp and the frame of the
picture that it is about. A picture of which nothing is told gets an empty message; one that cannot
be read, is of nothing at all (a covered lens), comes from a frozen camera, from one of two
publishers or from a new one gets none, so that whoever drives by it stops.
"""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CompressedImage, Image, JointState

from cfnav_core.detect.detector import LEAST, OnnxDetector
from cfnav_core.robot.robot import robot_setting
from cfnav_core.robot.settings import setting
from cfnav_core.robot.topics import DETECTIONS_2D, TOPICS
from cfnav_ros.drive import fields
from cfnav_ros.drive.diagnostics import Level, Rate, Report, Stopwatch
from cfnav_ros.drive.inputs import SensorInputs, Tilt
from cfnav_ros.drive.picture_watch import PictureWatch
from cfnav_ros.robot.speakers import OneAfterAnother
from cfnav_ros.ros import conversions
from cfnav_ros.ros.listener import Listener
from cfnav_ros.ros.node_process import run_node
from cfnav_ros.ros.parameters import declare, named_robot
from cfnav_ros.ros.topics import message_type, newest_only, publisher

NAME = "detector_node"

NEW_S = 4.0
"""How long pictures of a new publisher are none, real seconds: a drive that saw by the camera
before it ends meanwhile, as a second without detections stops the robot and two more end that."""


@dataclass(frozen=True)
class DetectorParameters:
    """Parameters of ``detector_node``."""

    robot: str = robot_setting()
    model: str = setting("", "the ONNX file of a detector")
    labels: str = setting(
        "",
        "what it learnt: coco, coco_ids, voc, objects365, open_images or a file; empty: as its "
        "file says",
    )
    head: str = setting("", "how its outputs are read (cfnav_core.detect.heads); empty: by itself")
    side: int = setting(0, "of its input where its file leaves that open, pixels", 0, 4096)
    least: float = setting(LEAST, "score of what is told", 0.0, 1.0)
    frozen_picture_time: float = setting(
        1.0,
        "one picture under new stamps is frozen, s; 0: never, for simulators without noise",
        0.0,
        60.0,
    )
    threads: int = setting(1, "of ONNX Runtime", 1, 64)
    lock_step: bool = setting(False, "a simulator waits for what is said of each picture")


class DetectorNode(Node):
    """Asks the detector about the newest picture as soon as the one before is answered."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        robot = named_robot(self)
        given = declare(self, DetectorParameters())
        if not given.model:
            raise ValueError("model is empty, expected the ONNX file of a detector.")
        detector = OnnxDetector(
            Path(given.model), given.labels, given.head, given.side, given.threads
        )
        self._times, self._rate, self._fault = Stopwatch(), Rate(), "No picture has arrived."
        self._found = self._times.timed(lambda rgb: detector(rgb, given.least))
        topic = robot.topics.get("detections", TOPICS["detections"])
        if topic.type != DETECTIONS_2D:
            raise ValueError(
                f"The robot {robot.name} has boxes with places on {topic.name}, this node says "
                "only boxes: give topics.detections another name in the robot's file."
            )
        self._watch = PictureWatch(lambda height, width: None, given.frozen_picture_time)
        self._odometry = SensorInputs().odometry
        self._publisher = publisher(self, topic)
        self._diagnostics = publisher(self, TOPICS["diagnostics"])
        picture = robot.topics["image"]
        quality = newest_only(given.lock_step)
        kind = message_type(picture.type)
        # Before pictures: of what waits together rclpy takes that of the first subscription first,
        # and a picture judged by the pose before its own looks like a frozen one later.
        self.create_subscription(
            Odometry, robot.topics["odom"].name, self._on_odometry, qos_profile_sensor_data
        )
        self._tilt, self._joint = Tilt(), robot.tilt_joint
        if robot.tilts:
            self.create_subscription(
                JointState, robot.topics["joint_states"].name, self._on_joints,
                qos_profile_sensor_data,
            )  # fmt: skip
        self._pictures = Listener(self, kind, picture.name, self._on_picture, quality)
        self._speakers = OneAfterAnother(self._pictures.topic, self._pictures.type, NEW_S)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0, self._on_second, clock=steady)
        width, height = detector.size[::-1]
        self.get_logger().info(
            f"{Path(given.model).name} ({detector.head}, {width}x{height}, "
            f"{len(detector.labels.names)} classes): {self._pictures.topic} -> "
            f"{self._publisher.topic_name}."
        )

    def _on_odometry(self, message: Odometry) -> None:
        """Tells whether the robot moves under a picture that stays the same."""
        try:
            self._odometry = fields.odometry_from_message(message)
        except ValueError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=2.0)

    def _on_joints(self, message: JointState) -> None:
        """Tells whether the camera tilts."""
        with suppress(ValueError):  # the policy node says what is wrong with it
            self._tilt = fields.tilt_from_message(message, self._joint) or self._tilt

    def _on_picture(self, message: Image | CompressedImage) -> None:
        self._rate.note(time.monotonic())
        try:
            if stranger := self._look_for_strangers():
                raise ValueError(stranger)
            frame = conversions.frame_from_message(message)
            seen = self._watch.look(frame, self._odometry, self._tilt)
            if wrong := seen.fault or seen.waiting:
                raise ValueError(wrong)
            found = self._found(frame.decode())
        except ValueError as error:
            self._fault = str(error)
            self.get_logger().warning(self._fault, throttle_duration_sec=2.0)
            return
        self._fault = ""
        self._publisher.publish(conversions.detections_to_message(found, message.header))

    def _look_for_strangers(self) -> str:
        listener = self._pictures
        stranger = self._speakers.look(time.monotonic(), listener.speakers(), listener.met)
        listener.begin_anew()
        return stranger

    def _on_second(self) -> None:
        self._look_for_strangers()
        hz, (p50, p99) = self._rate.hz(time.monotonic()), self._times.percentiles_ms()
        fault = self._fault or ("" if hz else "No picture comes any more.")
        report = Report(
            "detector",
            Level.WARN if fault else Level.OK,
            fault or "The detector sees.",
            {"pictures_hz": f"{hz:.1f}", "p50_ms": f"{p50:.1f}", "p99_ms": f"{p99:.1f}"},
        )
        now = self.get_clock().now().to_msg()
        name = self.get_fully_qualified_name()
        self._diagnostics.publish(conversions.diagnostics([report], name, now))


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; the exit code is that of ``run_node``."""
    return run_node(NAME, DetectorNode, args)


if __name__ == "__main__":
    sys.exit(main())
