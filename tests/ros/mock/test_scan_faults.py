"""Faults of scans: values, bins, headers and mountings."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from sim_bridge.faults.faults import (  # noqa: E402
    SCAN,
)

from tests.ros.mock.fault_messages import bearing, first, suffered  # noqa: E402


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
