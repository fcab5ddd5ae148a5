"""The detector node as a process: pictures in, the standard message out, a bad picture told."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("vision_msgs.msg", reason="ros_ws is not built: run 'make setup'")

from builtin_interfaces.msg import Time  # noqa: E402
from cfnav_ros.drive.repeats import NOISY  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from sensor_msgs.msg import CompressedImage, Image, JointState  # noqa: E402
from vision_msgs.msg import Detection2DArray  # noqa: E402

from cfnav_core.robot.robot import SHIPPED as ROBOTS  # noqa: E402
from tests.core.detect.made import constant_network  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402

CHAIR = 56


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A YOLO v10 of 64x32 pixels that finds a chair, and a cup that nobody is told of."""
    rows = np.array([[[10, 5, 30, 25, 0.75, CHAIR], [0, 0, 9, 9, 0.25, 41]]], np.float32)
    return constant_network(tmp_path / "made.onnx", {"output0": rows})


class Camera(OwnNode):
    """Sends pictures and keeps what is found in them."""

    def __init__(self, domain: int, kind: type, topic: str) -> None:
        super().__init__(domain, "camera")
        self.found: list[Detection2DArray] = []
        self.told: list[DiagnosticArray] = []
        self.pictures = self.node.create_publisher(kind, topic, 10)
        self.node.create_subscription(Detection2DArray, "detections", self.found.append, 5)
        self.node.create_subscription(DiagnosticArray, "diagnostics", self.told.append, 5)

    def show(self, message: Image | CompressedImage) -> Detection2DArray:
        """What is found in a picture, which is sent until it is heard.

        What is found late in another one, or in a copy of it, is no answer.
        """
        stamp = message.header.stamp
        self.found.clear()
        self.wait(
            lambda: any(said.header.stamp == stamp for said in self.found),
            f"detections of the picture of {stamp.sec} s",
            lambda: self.pictures.publish(message),
        )
        return next(said for said in self.found if said.header.stamp == stamp)


def picture(stamp: int, height: int = 160, width: int = 320) -> Image:
    message = Image(height=height, width=width, encoding="rgb8", step=3 * width)
    message.header.stamp, message.header.frame_id = Time(sec=stamp), "lens"
    message.data = np.arange(3 * height * width, dtype=np.uint32).astype(np.uint8).tobytes()
    return message


def test_detections_bear_the_pictures_stamp(
    start_process: Callable, ros_domain_id: int, model: Path
) -> None:
    process = start_process(
        "cfnav_ros.ros.detector_node", "--ros-args", "-p", f"model:={model}", "-p", "labels:=coco"
    )
    camera = Camera(ros_domain_id, Image, "oakd/rgb/preview/image_raw")
    message = camera.show(picture(7))
    assert (message.header.stamp.sec, message.header.frame_id) == (7, "lens")
    (chair,) = message.detections
    assert chair.header == message.header
    (result,) = chair.results
    assert result.hypothesis.class_id == "chair"
    assert result.hypothesis.score == pytest.approx(0.75)
    box = chair.bbox
    assert (box.center.position.x, box.center.position.y) == pytest.approx((100, 75))
    assert (box.size_x, box.size_y, box.center.theta) == pytest.approx((100, 100, 0))

    broken = picture(8)
    broken.encoding = "16UC1"
    camera.wait(
        lambda: any("16UC1" in s.message for told in camera.told for s in told.status),
        "a sentence about the picture",
        lambda: camera.pictures.publish(broken),
    )
    assert camera.show(picture(9)).header.stamp.sec == 9

    covered = picture(10)
    covered.data = bytes(len(covered.data))
    camera.found.clear()
    camera.wait(
        lambda: any("shows nothing" in s.message for told in camera.told for s in told.status),
        "a sentence about the lens",
        lambda: camera.pictures.publish(covered),
    )
    assert not [said for said in camera.found if said.header.stamp.sec == 10]
    camera.close()
    assert process.interrupt() == 0


@pytest.fixture
def camera(start_process: Callable, ros_domain_id: int, model: Path) -> Iterator[Camera]:
    """The camera of a detector that runs."""
    process = start_process(
        "cfnav_ros.ros.detector_node", "--ros-args", "-p", f"model:={model}", "-p", "labels:=coco"
    )
    camera = Camera(ros_domain_id, Image, "oakd/rgb/preview/image_raw")
    yield camera
    camera.close()
    assert process.interrupt() == 0


def freeze(camera: Camera, message: Image, each: Callable[[Time], None]) -> None:
    """Repeat a picture under new stamps until the node says so; ``each`` is called before one."""
    stamps = itertools.count(message.header.stamp.sec + 1)

    def repeat() -> None:
        message.header.stamp = Time(sec=next(stamps))
        each(message.header.stamp)
        camera.pictures.publish(message)

    camera.wait(
        lambda: any("camera is frozen" in s.message for told in camera.told for s in told.status),
        "a sentence about the camera",
        repeat,
    )


def test_of_a_frozen_camera_nothing_is_told(camera: Camera) -> None:
    """Its last picture may show nothing, and an empty message under new stamps is no news."""
    noisy, stamps = picture(20), itertools.count(20)

    def send() -> None:
        """At rest each picture has its own noise: one sent twice would be of a camera without."""
        noisy.header.stamp = Time(sec=next(stamps))
        noisy.data = bytes([noisy.header.stamp.sec % 256]) + bytes(noisy.data)[1:]
        camera.pictures.publish(noisy)

    camera.wait(lambda: len(camera.found) > 2 * NOISY, "detections of noisy pictures", send)
    freeze(camera, noisy, lambda stamp: None)
    last = noisy.header.stamp.sec
    assert max(said.header.stamp.sec for said in camera.found) < last
    noisy.data = bytes([noisy.data[0] ^ 1]) + bytes(noisy.data)[1:]
    noisy.header.stamp = Time(sec=last + 1)
    camera.show(noisy)


def test_a_camera_without_noise_is_frozen_when_the_robot_moves(camera: Camera) -> None:
    odometry = camera.node.create_publisher(Odometry, "odom", 10)
    moved = Odometry()
    moved.pose.pose.orientation.w = 1.0
    odometry.publish(moved)
    for stamp in range(10, 30):
        camera.show(picture(stamp))  # at rest it tells
    moved.pose.pose.position.x = 1.0

    def drive(stamp: Time) -> None:
        moved.header.stamp = stamp
        odometry.publish(moved)

    freeze(camera, picture(30), drive)


def test_while_two_send_pictures_nothing_is_told(camera: Camera) -> None:
    """The policy hears one detector, whoever showed it the goal."""
    camera.show(picture(20))
    stranger = camera.node.create_publisher(Image, camera.pictures.topic_name, 1)
    stamps = itertools.count(21)
    camera.wait(
        lambda: any("2 nodes publish /" in s.message for told in camera.told for s in told.status),
        "a sentence about the other one",
        lambda: stranger.publish(picture(next(stamps))),
    )
    seen = len(camera.found)
    stranger.publish(picture(next(stamps)))
    camera.pictures.publish(picture(next(stamps)))
    camera.told.clear()
    camera.wait(lambda: camera.told, "its next report")
    assert len(camera.found) == seen
    camera.node.destroy_publisher(stranger)
    camera.show(picture(next(stamps)))


def test_of_another_camera_in_its_place_nothing_is_told_until_a_drive_has_ended(
    camera: Camera,
) -> None:
    camera.show(picture(20))
    topic = camera.pictures.topic_name
    camera.node.destroy_publisher(camera.pictures)
    camera.pictures = camera.node.create_publisher(Image, topic, 10)
    stamps = itertools.count(21)
    camera.wait(
        lambda: any("another" in s.message for told in camera.told for s in told.status),
        "a sentence about the other one",
        lambda: camera.pictures.publish(picture(next(stamps))),
    )
    assert all(said.header.stamp.sec <= 20 for said in camera.found)
    camera.show(picture(next(stamps)))


def test_what_changes_as_the_camera_tilts_is_no_noise(camera: Camera) -> None:
    """A camera without noise that has tilted, and then rests, still tells."""
    joints = camera.node.create_publisher(JointState, "joint_states", 10)
    camera.wait(joints.get_subscription_count, "the node to listen")
    for k in range(12):
        angle = JointState(name=["camera_tilt"], position=[-0.05 * k])
        angle.header.stamp = Time(sec=10 + k)
        joints.publish(angle)
        joints.wait_for_all_acked()
        shown = picture(10 + k)
        shown.data = bytes([k]) + bytes(shown.data)[1:]
        camera.show(shown)
    for stamp in range(30, 45):
        shown.header.stamp = Time(sec=stamp)
        camera.show(shown)


def test_pictures_may_be_compressed_and_without_things(
    start_process: Callable, ros_domain_id: int, model: Path
) -> None:
    process = start_process(
        "cfnav_ros.ros.detector_node", "--ros-args", "-p", f"model:={model}", "-p", "labels:=coco",
        "-p", "robot:=turtlebot4", "-p", "least:=0.9",
    )  # fmt: skip
    camera = Camera(ros_domain_id, CompressedImage, "oakd/rgb/image_raw/compressed")
    ramp = np.tile(np.arange(320, dtype=np.uint8)[None, :, None], (180, 1, 3))
    _, jpeg = cv2.imencode(".jpg", ramp)
    message = CompressedImage(format="jpeg", data=jpeg.tobytes())
    message.header.stamp = Time(sec=3)
    found = camera.show(message)
    assert found.header.stamp.sec == 3
    assert len(found.detections) == 0
    camera.close()
    assert process.interrupt() == 0


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ((), "model is empty, expected the ONNX file of a detector."),
        (("model:=/none.onnx", "labels:=coco"), "found no usable detector at /none.onnx"),
        (("model:=MODEL",), "say which labels it learnt"),
        (("model:=MODEL", "labels:=cocoa"), "found no labels 'cocoa'"),
        (("model:=MODEL", "labels:=coco", "robot:=PLACES"), "this node says only boxes"),
    ],
)
def test_what_cannot_be_used_ends_it_with_a_sentence(
    start_process: Callable, model: Path, parameters: tuple[str, ...], sentence: str,
    tmp_path: Path,
) -> None:  # fmt: skip
    places = tmp_path / "places.yaml"
    text = (ROBOTS / "turtlebot4.yaml").read_text()
    places.write_text(text.replace("topics:\n", "topics:\n  detections: nn/spatial_detections\n"))
    for name, path in (("MODEL", model), ("PLACES", places)):
        parameters = tuple(p.replace(name, str(path)) for p in parameters)
    words = [w for p in parameters for w in ("-p", p)]
    process = start_process("cfnav_ros.ros.detector_node", "--ros-args", *words)
    assert process.wait() == 2
    assert sentence in process.output
