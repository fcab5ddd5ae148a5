"""Messages to numpy and back: every encoding, padded rows, wrong data."""

import math
from array import array

import cv2
import numpy as np
import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from builtin_interfaces.msg import Time  # noqa: E402
from cfnav_ros.drive.fields import (  # noqa: E402
    bump_from_message,
    bumper_from_message,
    charge_from_message,
    estimate_from_message,
    odometry_from_message,
    scan_from_message,
    stamp_to_ns,
    stamp_to_seconds,
    tilt_from_message,
)
from cfnav_ros.drive.inputs import StampedEstimate, Tilt  # noqa: E402
from cfnav_ros.drive.motion import Command  # noqa: E402
from cfnav_ros.drive.motion import Odometry as Pose  # noqa: E402
from cfnav_ros.drive.picture_watch import PictureWatch  # noqa: E402
from cfnav_ros.lidar.estimate import Estimate, Verdict  # noqa: E402
from cfnav_ros.ros import conversions  # noqa: E402
from irobot_create_msgs.msg import HazardDetection, HazardDetectionVector  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from sensor_msgs.msg import BatteryState, CompressedImage, Image, JointState, LaserScan  # noqa: E402
from std_msgs.msg import Header  # noqa: E402

from cfnav_core.perception.perception import BUILT_IN  # noqa: E402

STAMP = Time(sec=1_700_000_000, nanosec=123_456_789)


@pytest.fixture
def rgb():
    return np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)


def over_the_wire(message):
    """What a subscriber in another process gets."""
    return deserialize_message(serialize_message(message), type(message))


def encoded(rgb, encoding, padding=0):
    """The picture as a driver sends it."""
    alpha = np.full((*rgb.shape[:2], 1), 9, np.uint8)
    pixels = {
        "rgb8": rgb,
        "bgr8": rgb[:, :, ::-1],
        "rgba8": np.concatenate([rgb, alpha], 2),
        "bgra8": np.concatenate([rgb[:, :, ::-1], alpha], 2),
        "mono8": rgb[:, :, :1],
    }[encoding]
    rows = pixels.reshape(rgb.shape[0], -1)
    rows = np.concatenate([rows, np.full((len(rows), padding), 77, np.uint8)], 1)
    message = Image(height=rgb.shape[0], width=rgb.shape[1], encoding=encoding)
    message.step, message.is_bigendian = rows.shape[1], 1
    message.data = array("B", rows.tobytes())
    return message


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8", "bgra8"])
def test_colours_arrive_whatever_the_encoding(rgb, encoding, padding):
    got = conversions.image_to_rgb(over_the_wire(encoded(rgb, encoding, padding)))
    assert got.dtype == np.uint8
    assert np.array_equal(got, rgb)


@pytest.mark.parametrize("encoding", ["rgb8", "bgra8", "mono8"])
def test_rows_and_columns_can_be_left_out(rgb, encoding):
    message = encoded(rgb, encoding, padding=2)
    whole = conversions.image_to_rgb(message)
    assert np.array_equal(conversions.image_to_rgb(message, 3), whole[::3, ::3])


def test_grey_becomes_three_equal_channels(rgb):
    got = conversions.image_to_rgb(encoded(rgb, "mono8", padding=1))
    assert np.array_equal(got, np.repeat(rgb[:, :, :1], 3, axis=2))


def change(message, **fields):
    for name, value in fields.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"encoding": "yuv422"}, "encoded as 'yuv422', expected one of rgb8, bgr8"),
        ({"encoding": "16UC1"}, "encoded as '16UC1'"),
        ({"data": array("B", bytes(20))}, "holds 20 bytes, expected 105 for 5 rows of 21"),
        ({"step": 20}, "step is 20 bytes, expected at least 21"),
        ({"height": 0}, "is 7x0, expected 1 to"),
        ({"height": 100_000, "width": 100_000}, "is 100000x100000"),
    ],
)
def test_a_picture_that_cannot_be_read_gives_one_sentence(rgb, fields, sentence):
    with pytest.raises(ValueError, match=sentence) as caught:
        conversions.image_to_rgb(change(encoded(rgb, "rgb8"), **fields))
    assert "\n" not in str(caught.value)


def test_stamps_keep_their_nanoseconds():
    ns = stamp_to_ns(STAMP)
    assert ns == 1_700_000_000_123_456_789
    assert conversions.ns_to_stamp(ns) == STAMP
    assert stamp_to_seconds(STAMP) == pytest.approx(1_700_000_000.123457, abs=1e-6)


def test_a_scan_keeps_its_infinities():
    message = LaserScan(angle_min=-1.0, angle_max=1.0, angle_increment=1.0, range_max=12.0)
    message.scan_time = 0.125
    message.ranges = [1.0, math.inf, math.nan]
    scan = scan_from_message(over_the_wire(message))
    assert scan.ranges.dtype == np.float32
    assert np.array_equal(scan.ranges, np.array([1, np.inf, np.nan], np.float32), equal_nan=True)
    assert (scan.angle_min, scan.angle_max, scan.range_max) == (-1.0, 1.0, 12.0)
    assert scan.scan_time == 0.125
    assert scan_from_message(LaserScan()).ranges.size == 0


def odometry(yaw=0.0, **fields):
    message = Odometry()
    message.header.stamp = STAMP
    pose = message.pose.pose
    pose.position.x, pose.position.y = 1.0, 2.0
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    message.twist.twist.linear.x, message.twist.twist.angular.z = 0.2, -0.1
    return change(message, **fields)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.0, 3.1])
def test_odometry_is_planar(yaw):
    got = odometry_from_message(over_the_wire(odometry(yaw)))
    assert (got.x, got.y, got.v, got.w) == (1.0, 2.0, 0.2, -0.1)
    assert got.yaw == pytest.approx(yaw)
    assert got.stamp == stamp_to_seconds(STAMP)


def test_odometry_that_makes_no_sense_is_refused():
    broken = odometry()
    broken.pose.pose.position.x = math.nan
    with pytest.raises(ValueError, match="not finite"):
        odometry_from_message(broken)
    broken = odometry()
    broken.pose.pose.orientation.w = 0.0
    with pytest.raises(ValueError, match="quaternion of length 0, expected 1"):
        odometry_from_message(broken)


def test_an_estimate_survives_both_ways():
    estimate = Estimate(0.25, 0.5, Verdict.DEGRADED, "Dark.", 0.75)
    message = over_the_wire(conversions.estimate_to_message(estimate, STAMP, "r1/base"))
    assert message.header.frame_id == "r1/base"
    expected = StampedEstimate(stamp_to_ns(STAMP), estimate)
    assert estimate_from_message(message) == expected


@pytest.mark.parametrize(
    "fields",
    [{"probability": math.nan}, {"probability": 1.5}, {"clearance": math.nan}, {"verdict": 9}],
)
def test_an_estimate_that_makes_no_sense_is_refused(fields):
    message = conversions.estimate_to_message(Estimate(0.5, 1.0, Verdict.GOOD, "", 1.0), STAMP)
    with pytest.raises(ValueError, match=r"\d|finite|nan"):
        estimate_from_message(change(message, **fields))


def test_the_tilt_is_found_among_the_joints():
    message = JointState(name=["wheel", "camera_tilt"], position=[1.0, -0.5])
    message.header.stamp = STAMP
    assert tilt_from_message(message, "camera_tilt").angle == -0.5
    assert tilt_from_message(message, "arm") is None
    assert tilt_from_message(change(message, position=[]), "camera_tilt") is None


def test_a_frame_is_decoded_when_it_is_looked_at(rgb):
    frame = conversions.frame_from_message(change(encoded(rgb, "rgb8"), header=Header(stamp=STAMP)))
    assert frame.stamp_ns == stamp_to_ns(STAMP)
    assert np.array_equal(frame.decode(), rgb)
    unreadable = conversions.frame_from_message(Image())
    with pytest.raises(ValueError, match="expected one of"):
        unreadable.decode()


def test_a_bump_is_found_among_the_hazards():
    message = HazardDetectionVector()
    message.header.stamp = STAMP
    assert bump_from_message(message) is None
    message.detections = [
        HazardDetection(type=HazardDetection.CLIFF),
        HazardDetection(type=HazardDetection.BACKUP_LIMIT),
    ]
    assert bump_from_message(over_the_wire(message)) is None
    assert bumper_from_message(over_the_wire(message)) is False
    message.detections.append(HazardDetection(type=HazardDetection.BUMP))
    for zone in ("", "bump_front_center", "bump_left"):
        message.detections[-1].header.frame_id = zone
        assert bump_from_message(over_the_wire(message)) == stamp_to_seconds(STAMP)
        assert bumper_from_message(over_the_wire(message)) is True


@pytest.mark.parametrize(
    ("percentage", "charge"),
    [(0.12, 0.12), (12.0, 0.12), (1.0, 1.0), (math.nan, math.nan), (-1.0, math.nan)],
)
def test_the_charge_of_a_battery(percentage, charge):
    said = charge_from_message(over_the_wire(BatteryState(percentage=percentage)))
    assert said == pytest.approx(charge, nan_ok=True)


def test_velocities():
    message = conversions.twist_stamped(Command(0.2, -0.5), STAMP, "base_link")
    assert (message.header.stamp, message.header.frame_id) == (STAMP, "base_link")
    assert message.twist == conversions.twist(Command(0.2, -0.5))
    assert (message.twist.linear.x, message.twist.angular.z) == (0.2, -0.5)


def jpeg(seed, ns):
    """A noisy picture of 150x150 as image_transport compresses it."""
    rgb = np.random.default_rng(seed).integers(0, 256, (150, 150, 3), np.uint8)
    message = CompressedImage(format="bgr8; jpeg compressed bgr8")
    message.header.stamp = conversions.ns_to_stamp(ns)
    message.data = array("B", cv2.imencode(".jpg", rgb)[1].tobytes())
    return message


def test_a_compressed_camera_that_repeats_itself_is_frozen():
    watch = PictureWatch(BUILT_IN.check_size, 1.0)
    for k in range(40):
        ns = 10**9 + k * 10**8
        message = over_the_wire(jpeg(min(k, 20), ns))
        frame = conversions.frame_from_message(message)
        assert (frame.stamp_ns, frame.height, frame.width) == (ns, 150, 150)
        check = watch.look(frame, Pose(ns * 1e-9, 0.0, 0.0, 0.0), Tilt())
        frozen = check.waiting.startswith("The camera is frozen")
        assert (frozen, check.fault) == (k >= 29, ""), (k, check)


@pytest.mark.parametrize("kept", [0.5, 0.001, 0.0])
def test_a_broken_jpeg_is_a_fault_and_never_a_picture(kept):
    message = jpeg(0, 10**9)
    message.data = message.data[: math.ceil(kept * len(message.data))]
    frame = conversions.frame_from_message(over_the_wire(message))
    check = PictureWatch(BUILT_IN.check_size, 1.0).look(frame, Pose(1.0, 0.0, 0.0, 0.0), Tilt())
    with pytest.raises(ValueError, match="compressed picture") as caught:
        frame.decode()
    assert check.fault == str(caught.value)
