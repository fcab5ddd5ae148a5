"""Every fault that alters messages, on real messages as the mock makes them."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

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
from sim_bridge.robot.base import TrueMotion  # noqa: E402
from sim_bridge.ros import conversions as to_msg  # noqa: E402

from tests.ros.mock.fault_messages import first, payload, stamp_s, suffered  # noqa: E402


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


def test_odometry_that_makes_no_sense():
    odometry, _ = first("odom_nan", ODOM)
    assert math.isnan(odometry.pose.pose.position.x)
    for fault, norm in (("odom_zero_quaternion", 0.0), ("odom_bad_quaternion", 2.0)):
        q = first(fault, ODOM)[0].pose.pose.orientation
        assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(norm)
