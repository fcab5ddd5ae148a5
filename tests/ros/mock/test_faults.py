"""Every fault that alters messages, on real messages as the mock makes them."""

from __future__ import annotations

import math
from copy import deepcopy
from itertools import combinations

import cv2
import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_ros.robot.depths import depth_to_metres  # noqa: E402
from cfnav_ros.ros.conversions import frame_from_message, image_to_rgb  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from sim_bridge.faults import picture_faults  # noqa: E402
from sim_bridge.faults.faults import (  # noqa: E402
    CAMERA_INFO,
    DEPTH,
    DEPTH_INFO,
    DOCK,
    EVERYTHING,
    FAULTS,
    HAZARDS,
    IMAGE,
    JOINTS,
    ODOM,
    SCAN,
    TF,
    WHEELS,
)
from sim_bridge.faults.schedule import FaultOrder, FaultSchedule  # noqa: E402
from sim_bridge.robot.base import SimulatedOdometry, TrueMotion  # noqa: E402
from sim_bridge.robot.rplidar import SENSITIVITY, driver_ranges, sample_angles  # noqa: E402
from sim_bridge.ros import conversions as to_msg  # noqa: E402
from tf2_msgs.msg import TFMessage  # noqa: E402

from cfnav_core.task.camera import CAMERAS  # noqa: E402

T0 = 20.0


def make(topic, k=0):
    """The k-th message of a topic; each differs from the one before."""
    t = T0 + 0.1 * k
    rng = np.random.default_rng(k)
    if topic == SCAN:
        angles = sample_angles(SENSITIVITY, 0.5)
        distances = rng.uniform(0.5, 4.0, len(angles)).astype(np.float32)
        return to_msg.laser_scan(driver_ranges(angles, distances, SENSITIVITY), t, "laser")
    if topic == IMAGE:
        return to_msg.image(rng.integers(0, 255, (60, 60, 3), np.uint8), t)
    if topic in (CAMERA_INFO, DEPTH_INFO):
        return to_msg.camera_info(CAMERAS["mast"], t)
    if topic == DEPTH:
        return to_msg.depth(rng.integers(400, 4000, (60, 80), np.uint16), t, "optical")
    if topic == JOINTS:
        return to_msg.joint_state("neck", 0.1 * k, t)
    if topic == HAZARDS:
        return to_msg.hazards([0.0], True, t)
    if topic in (WHEELS, DOCK):
        return (to_msg.wheel_status if topic == WHEELS else to_msg.dock_status)(True, t)
    counted = SimulatedOdometry()
    counted.move(1.0 + k, 0.5, 0.7)
    if topic == TF:
        return TFMessage(transforms=to_msg.moving_transforms(counted, CAMERAS["mast"], 0.0, t))
    return to_msg.odometry(counted, (0.1 + k, 0.2), t)


def suffered(faults, topic, count=20, seed=0):
    """What becomes of ``count`` messages: (message or None, delay) each; and the originals.

    ``faults`` is a name, or several that begin in this order.
    """
    names = [faults] if isinstance(faults, str) else faults
    schedule = FaultSchedule([FaultOrder(name) for name in names], seed)
    schedule.update(T0, TrueMotion(0.0, 0.0, None))
    originals = [make(topic, k) for k in range(count)]
    return [
        schedule.pass_on(topic, deepcopy(message), T0 + 0.1 * k)
        for k, message in enumerate(originals)
    ], originals


def first(fault, topic):
    results, originals = suffered(fault, topic, 1)
    return results[0][0], originals[0]


def payload(message):
    """The bytes of a scan or a picture; NaN equals NaN."""
    numbers = getattr(message, "ranges", getattr(message, "data", None))
    return message.header, None if numbers is None else numbers.tobytes()


def stamp_s(message):
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


def bearing(scan):
    """Bearing of each bin from the robot's front, rad."""
    angles = scan.angle_min + np.arange(len(scan.ranges)) * scan.angle_increment
    return np.angle(np.exp(1j * (angles + math.pi / 2)))


@pytest.mark.parametrize("fault", [name for name, row in FAULTS.items() if row.topics])
def test_altered_messages_can_be_sent_and_other_topics_are_left_alone(fault):
    for topic in (
        SCAN, IMAGE, CAMERA_INFO, DEPTH, DEPTH_INFO, ODOM, JOINTS, HAZARDS, WHEELS, DOCK,
    ):  # fmt: skip
        results, originals = suffered(fault, topic, 3)
        concerned = {topic, "*"} & set(FAULTS[fault].topics)
        for (message, delay), original in zip(results, originals, strict=True):
            if message is not None:
                again = deserialize_message(serialize_message(message), type(message))
                assert payload(again) == payload(message)
            if not concerned:
                assert (message, delay) == (original, 0.0)
        if concerned:
            assert [r for r in results if r[1] or r[0] != originals[results.index(r)]]


@pytest.mark.parametrize(
    "topic", [SCAN, IMAGE, CAMERA_INFO, DEPTH, DEPTH_INFO, ODOM, TF, JOINTS, HAZARDS]
)
def test_any_two_faults_of_a_topic_hold_together(topic, monkeypatch):
    monkeypatch.setattr(picture_faults, "HUGE", (90, 160))
    concerned = [name for name, row in FAULTS.items() if {topic, EVERYTHING} & set(row.topics)]
    for pair in combinations(concerned, 2):
        one, other = (suffered(names, topic, 2)[0] for names in (pair, pair[::-1]))
        for (message, delay), (same, as_long) in zip(one, other, strict=True):
            assert delay == as_long, pair
            if message is not None:
                serialize_message(message)
            # Which of them began first makes no difference; as text, NaN equals NaN.
            assert repr(message) == repr(same), pair


def test_each_of_two_faults_is_seen():
    image, _ = first(("image_mono8", "image_white", "image_padded"), IMAGE)
    assert (image.encoding, image.step) == ("mono8", 60 + picture_faults.PADDING)
    assert set(image.data) == {255}
    image, _ = first(("image_bgra8", "image_mono8"), IMAGE)
    assert (image.encoding, image.step) == ("bgra8", 4 * 60)
    image, _ = first(("image_data_short", "image_black"), IMAGE)
    assert (set(image.data), len(image.data)) == ({0}, 60 * 60 * 3 // 2)
    for count in ("0", "360", "1034_inf"):
        scan, _ = first(("scan_speckle", "scan_ranges_0", f"scan_ranges_{count}"), SCAN)
        assert len(scan.ranges) == 0
    scan, _ = first(("scan_turned_90", "scan_all_near", "scan_sector_90"), SCAN)
    assert set(np.round(scan.ranges, 3)) == {np.float32(0.1), np.inf}
    # What is frozen is not changed anew at every message.
    for odometry, _ in suffered(("odom_frozen", "odom_bad_quaternion"), ODOM)[0]:
        q = odometry.pose.pose.orientation
        assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(2.0)


@pytest.mark.parametrize("fault", picture_faults.SHAPES)
def test_a_compressed_picture_has_the_fault_of_the_raw_one(fault, monkeypatch):
    monkeypatch.setattr(picture_faults, "HUGE", (90, 160))
    colours = np.random.default_rng(0).integers(0, 255, (4, 4, 3), np.uint8)
    rgb = cv2.resize(colours, (60, 60))
    raw, message = to_msg.image(rgb, T0), to_msg.compressed_image(rgb, T0)
    for picture in (raw, message):
        picture_faults.SHAPES[fault](picture)
    frame = frame_from_message(deserialize_message(serialize_message(message), type(message)))
    if fault in ("image_16uc1", "image_step_short", "image_data_short", "image_empty"):
        with pytest.raises(ValueError, match="compressed picture"):
            frame.decode()
        assert bool(frame.fault) is (fault in ("image_step_short", "image_empty"))
    else:
        seen = frame.decode()
        assert seen.shape[:2] == (frame.height, frame.width) == (raw.height, raw.width)
        again = rgb if fault == "image_padded" else picture_faults.pixels_of(raw)[..., ::-1]
        assert np.abs(seen.astype(int) - again).mean() < 6


@pytest.mark.parametrize("encoding", ["rgb8", "bgra8", "mono8", "yuv422", "16uc1"])
def test_picture_of_every_encoding_can_be_read_again(encoding):
    image, original = first(f"image_{encoding}", IMAGE)
    seen, pixels = picture_faults.pixels_of(image), picture_faults.pixels_of(original)
    grey = picture_faults.grey(original)[..., None].repeat(3, 2)
    assert np.array_equal(seen, pixels if encoding in ("rgb8", "bgra8") else grey)


@pytest.mark.parametrize(
    ("fault", "topic"),
    [
        ("scan_silent", SCAN), ("image_silent", IMAGE), ("image_silent", CAMERA_INFO),
        ("odom_silent", ODOM), ("odom_silent", TF), ("joints_silent", JOINTS),
        ("depth_silent", DEPTH), ("depth_silent", DEPTH_INFO),
        ("network_cut_1", SCAN), ("network_cut_1", IMAGE), ("network_cut_1", "/clock"),
    ],
)  # fmt: skip
def test_silence(fault, topic):
    assert {message for message, _ in suffered(fault, topic)[0]} == {None}


@pytest.mark.parametrize(
    ("fault", "topic", "kept"),
    [
        ("scan_half_rate", SCAN, [k for k in range(20) if k % 2 == 0]),
        # 0.3 s of every second, a message every 0.1 s.
        ("scan_burst_loss", SCAN, [k for k in range(20) if k % 10 >= 3]),
        ("image_slow", IMAGE, [0, 5, 10, 15]),
        ("image_slow", CAMERA_INFO, [0, 5, 10, 15]),
    ],
)
def test_lost_messages(fault, topic, kept):
    results, _ = suffered(fault, topic)
    assert [k for k, (message, _) in enumerate(results) if message is not None] == kept


@pytest.mark.parametrize(
    ("fault", "topic", "seconds"),
    [
        ("scan_late_0.2", SCAN, 0.2), ("scan_late_0.5", SCAN, 0.5), ("scan_late_1", SCAN, 1.0),
        ("scan_late_5", SCAN, 5.0), ("image_late_0.5", IMAGE, 0.5), ("image_late_2", IMAGE, 2.0),
        ("odom_late_0.5", ODOM, 0.5), ("odom_late_0.5", TF, 0.5), ("cmd_late_0.2", "cmd_vel", 0.2),
        ("cmd_late_0.35", "cmd_vel", 0.35), ("cmd_late_10", "cmd_vel", 10.0),
        ("depth_late_2", DEPTH, 2.0), ("depth_late_2", DEPTH_INFO, 2.0),
    ],
)  # fmt: skip
def test_late_messages_are_otherwise_right(fault, topic, seconds):
    results, originals = suffered(fault, topic)
    assert results == [(message, seconds) for message in originals]


@pytest.mark.parametrize(
    ("fault", "topic", "off"),
    [
        ("scan_stamp_future", SCAN, 5.0), ("scan_stamp_back", SCAN, -5.0),
        ("image_stamp_future", IMAGE, 5.0), ("odom_stamp_future", ODOM, 5.0),
        ("depth_stamp_future", DEPTH, 5.0), ("depth_stamp_back", DEPTH, -5.0),
    ],
)  # fmt: skip
def test_stamps_off(fault, topic, off):
    results, originals = suffered(fault, topic)
    for (message, _), original in zip(results, originals, strict=True):
        assert stamp_s(message) - stamp_s(original) == pytest.approx(off)
        message.header.stamp = original.header.stamp
        assert message == original


@pytest.mark.parametrize(("fault", "rate"), [("odom_drift_ahead", 0.5), ("odom_drift_back", -0.5)])
def test_stamps_of_a_clock_that_drifts(fault, rate):
    results, originals = suffered(fault, ODOM)
    off = [stamp_s(m) - stamp_s(o) for (m, _), o in zip(results, originals, strict=True)]
    assert off == pytest.approx([rate * 0.1 * k for k in range(len(off))], abs=1e-6)


@pytest.mark.parametrize(
    ("fault", "topic"), [("scan_stamp_zero", SCAN), ("image_stamp_zero", IMAGE)]
)
def test_stamps_zero(fault, topic):
    assert {stamp_s(message) for message, _ in suffered(fault, topic)[0]} == {0.0}


def test_stamps_never_lie_before_zero():
    schedule = FaultSchedule([FaultOrder("scan_stamp_back")])
    schedule.update(1.0, TrueMotion(0.0, 0.0, None))
    scan = to_msg.laser_scan(np.ones(1080, np.float32), 1.0, "laser")
    assert stamp_s(schedule.pass_on(SCAN, scan, 1.0)[0]) == 0.0


@pytest.mark.parametrize(
    ("fault", "topic", "same", "goes_on"),
    [
        ("scan_frozen", SCAN, ["ranges", "intensities"], ["header"]),
        ("scan_stamp_repeated", SCAN, ["header"], ["ranges"]),
        ("image_frozen", IMAGE, ["data"], ["header"]),
        ("depth_frozen", DEPTH, ["data"], ["header"]),
        ("odom_frozen", ODOM, ["pose", "twist"], ["header"]),
        ("odom_slip", ODOM, ["pose"], ["header", "twist"]),
    ],
)
def test_frozen_fields_repeat_and_the_rest_goes_on(fault, topic, same, goes_on):
    results, originals = suffered(fault, topic, 5)
    for name in same:
        assert all(getattr(m, name) == getattr(originals[0], name) for m, _ in results)
    for name in goes_on:
        assert [getattr(m, name) for m, _ in results] == [getattr(m, name) for m in originals]


@pytest.mark.parametrize(
    ("fault", "value"),
    [("scan_all_inf", math.inf), ("scan_all_nan", math.nan), ("scan_all_zero", 0.0),
     ("scan_all_near", 0.10)],
)  # fmt: skip
def test_scans_of_one_value(fault, value):
    scan, original = first(fault, SCAN)
    assert np.array_equal(np.array(scan.ranges), np.full(1080, value, np.float32), equal_nan=True)
    assert set(scan.intensities) == {15.0 if math.isfinite(value) else 0.0}
    assert scan.header == original.header


@pytest.mark.parametrize("width", [30, 90, 180])
def test_unknown_sector_is_around_the_front(width):
    scan, original = first(f"scan_sector_{width}", SCAN)
    inside = np.abs(bearing(scan)) <= math.radians(width) / 2 + 1e-6
    assert inside.sum() == pytest.approx(3 * width, abs=4)
    assert np.isinf(np.array(scan.ranges)[inside]).all()
    assert np.array_equal(np.array(scan.ranges)[~inside], np.array(original.ranges)[~inside])


def test_speckle_is_one_return_at_another_bearing_in_each_scan():
    results, originals = suffered("scan_speckle", SCAN)
    firsts = []
    for (scan, _), original in zip(results, originals, strict=True):
        (changed,) = np.nonzero(np.array(scan.ranges) != np.array(original.ranges))
        assert len(changed) == 1
        assert np.array(scan.ranges)[changed] == pytest.approx(0.2)
        firsts.append(int(changed[0]))
    assert len(set(firsts)) > 15
    other, _ = suffered("scan_speckle", SCAN, seed=1)
    assert repr(other[0][0]) != repr(results[0][0])


@pytest.mark.parametrize("count", [0, 1, 360, 3240])
def test_other_numbers_of_bins_see_the_same_room(count):
    scan, original = first(f"scan_ranges_{count}", SCAN)
    assert len(scan.ranges) == len(scan.intensities) == count
    if count > 1:
        last = scan.angle_min + (count - 1) * scan.angle_increment
        assert last == pytest.approx(scan.angle_max)
        for degrees in (-100, 0, 45, 90):
            seen, there = (
                int(np.abs(bearing(m) - math.radians(degrees)).argmin()) for m in (scan, original)
            )
            assert scan.ranges[seen] in original.ranges[there - 3 : there + 4]


def test_raw_scan_without_returns_is_the_drivers():
    scan, _ = first("scan_ranges_1034_inf", SCAN)
    assert len(scan.ranges) == 1034
    assert np.isinf(scan.ranges).all()
    assert scan.angle_min + 1033 * scan.angle_increment == pytest.approx(scan.angle_max)


@pytest.mark.parametrize(
    ("fault", "factor"), [("zero", 0.0), ("negative", -1.0), ("wrong", 1.2), ("nan", math.nan)]
)
def test_increments(fault, factor):
    scan, original = first(f"scan_increment_{fault}", SCAN)
    assert scan.angle_increment == pytest.approx(factor * original.angle_increment, nan_ok=True)
    assert scan.ranges == original.ranges


def test_scan_headers_that_contradict_themselves():
    scan, original = first("scan_limits_swapped", SCAN)
    assert (scan.range_min, scan.range_max) == (original.range_max, original.range_min)
    scan, original = first("scan_short", SCAN)
    assert len(scan.ranges) == 810
    assert scan.angle_max == original.angle_max
    assert first("scan_wrong_frame", SCAN)[0].header.frame_id == "another_laser"


def test_turned_and_mirrored_mountings_move_the_posts_too():
    scan, original = first("scan_turned_90", SCAN)
    posts = np.isinf(original.ranges)
    # What truly is to the left, is seen in front.
    assert np.array_equal(np.isinf(scan.ranges), np.roll(posts, -270))
    assert scan.ranges[300] == original.ranges[570]
    scan, original = first("scan_mirrored", SCAN)
    assert list(scan.ranges) == list(original.ranges)[::-1]


@pytest.mark.parametrize(("fault", "value"), [("image_black", 0), ("image_white", 255)])
def test_pictures_of_one_colour(fault, value):
    image, original = first(fault, IMAGE)
    assert set(image.data) == {value}
    assert (image.width, image.height, image.step) == (60, 60, original.step)


@pytest.mark.parametrize("fault", ["rgb8", "bgra8", "padded"])
def test_encodings_that_show_the_same_picture(fault):
    image, original = first(f"image_{fault}", IMAGE)
    assert np.array_equal(image_to_rgb(image), image_to_rgb(original))
    assert (image.encoding, image.step) != (original.encoding, original.step)
    assert len(image.data) == image.step * image.height


@pytest.mark.parametrize(
    ("fault", "encoding", "bytes_each"),
    [("mono8", "mono8", 1), ("yuv422", "yuv422", 2), ("16uc1", "16UC1", 2)],
)
def test_encodings_without_colour(fault, encoding, bytes_each):
    image, original = first(f"image_{fault}", IMAGE)
    assert (image.encoding, image.step) == (encoding, 60 * bytes_each)
    assert len(image.data) == 60 * 60 * bytes_each
    grey = image_to_rgb(original) @ np.array([0.299, 0.587, 0.114])
    if fault == "mono8":
        assert np.abs(image_to_rgb(image)[..., 0] - grey).max() <= 1


def test_pictures_that_contradict_themselves():
    image, original = first("image_step_short", IMAGE)
    assert image.step < 3 * image.width
    assert image.data == original.data
    image, _ = first("image_data_short", IMAGE)
    assert len(image.data) < image.step * image.height
    image, _ = first("image_empty", IMAGE)
    assert (image.width, image.height, len(image.data)) == (0, 0, 0)
    image, original = first("image_huge", IMAGE)
    assert (image.width, image.height, image.step) == (3840, 2160, 11520)
    assert len(image.data) == 11520 * 2160
    assert np.array_equal(image_to_rgb(image)[::36, ::64], image_to_rgb(original))


def test_depth_that_shows_nothing_is_not_there_or_stands_right_before_the_lens():
    empty, original = first("depth_all_zero", DEPTH)
    assert (empty.encoding, empty.step) == (original.encoding, original.step)
    assert not depth_to_metres(empty).any()
    near = [depth_to_metres(message) for message, _ in suffered("depth_all_near", DEPTH, 2)[0]]
    assert near[0].shape == (60, 80)
    assert np.abs(np.array(near) - picture_faults.NEAR_MM / 1000).max() < 0.02
    assert (near[0] != near[1]).any()  # or it would be frozen


def test_depth_that_cannot_be_read():
    colours, _ = first("depth_rgb8", DEPTH)
    assert (colours.step, len(colours.data)) == (3 * 80, 3 * 80 * 60)
    for fault, why in (("depth_rgb8", "encoded as 'rgb8'"), ("depth_data_short", "4800 bytes")):
        with pytest.raises(ValueError, match=why):
            depth_to_metres(first(fault, DEPTH)[0])
    calibration, original = first("depth_info_other", DEPTH_INFO)
    assert (2 * calibration.width, calibration.k[0]) == (original.width, original.k[0])


def test_odometry_that_makes_no_sense():
    odometry, _ = first("odom_nan", ODOM)
    assert math.isnan(odometry.pose.pose.position.x)
    for fault, norm in (("odom_zero_quaternion", 0.0), ("odom_bad_quaternion", 2.0)):
        q = first(fault, ODOM)[0].pose.pose.orientation
        assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(norm)
