"""Points of the LiDAR around a drive, placed by odometry."""

import dataclasses
import math

import numpy as np
import pytest
from cfnav_ros.bags.files.events import LaserTurn
from cfnav_ros.bags.judge.drive_log import Drive
from cfnav_ros.bags.scan_map import CELL_M, FAR_M, ScanMap
from cfnav_ros.lidar.returns import Mount, Scan

from tests.bags.made import at, ns, pose

MOUNT = Mount(-0.04, 0.0, math.pi / 2)
WALL_X = 3.0


def turn(t, x=0.0, yaw=0.0, **changes):
    """A scan of a wall at x = 3 m, from a robot at (x, 0)."""
    angles = np.radians(np.arange(360.0))
    heading = yaw + MOUNT.yaw + angles
    lidar_x = x + MOUNT.x * math.cos(yaw)
    with np.errstate(divide="ignore"):
        ranges = np.where(np.cos(heading) > 0.1, (WALL_X - lidar_x) / np.cos(heading), np.inf)
    step = math.radians(1.0)
    scan = Scan(ranges.astype(np.float32), 0.0, 359 * step, step, 0.15, 12.0)
    return LaserTurn(**at(t, topic="scan"), scan=dataclasses.replace(scan, **changes))


def points_of(*events, drive=(100, 200), mount=MOUNT):
    seen = ScanMap()
    for event in events:
        seen.see(event, mount)
    return seen.cut(Drive("policy", ns(drive[0]), ns(drive[1])))


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
def test_a_wall_stands_where_it_is_whatever_the_heading(yaw):
    points = points_of(pose(101, 0.5, yaw=yaw), turn(101.1, 0.5, yaw))
    assert len(points) > 50
    assert points[:, 0] == pytest.approx(WALL_X, abs=CELL_M / 2 + 1e-4)
    assert np.hypot(*points.T).max() <= FAR_M + 1.0


def test_a_robot_that_stands_turns_or_is_unknown_adds_nothing():
    first = (pose(101), turn(101.1))
    points = points_of(*first)
    shifted = turn(102.1, x=-0.1)
    assert len(points_of(*first, pose(102, 0.1), shifted)) == len(points)
    assert len(points_of(*first, pose(102, 1.0, w=0.5), shifted)) == len(points)
    assert len(points_of(*first, pose(102, 1.0), shifted)) > len(points)
    assert len(points_of(turn(101.1))) == 0
    assert len(points_of(*first, mount=None)) == 0
    assert len(points_of(pose(101, math.nan), turn(101.1))) == 0


def test_each_drive_has_its_own_points():
    seen = ScanMap()
    for event in (pose(101), turn(101.1), pose(111, 0.5), turn(111.1, 0.5), pose(121, 1.0),
                  turn(121.1, 1.0)):  # fmt: skip
        seen.see(event, MOUNT)
    first = seen.cut(Drive("policy", ns(100), ns(110)))
    second = seen.cut(Drive("policy", ns(120), ns(130)))
    assert len(first)
    assert len(second)
    assert first.dtype == np.float32
    assert len(seen.cut(Drive("policy", ns(130), ns(140)))) == 0


def test_a_scan_that_makes_no_sense_is_left_out():
    assert len(points_of(pose(101), turn(101.1, angle_increment=0.0))) == 0
    nothing = np.full(360, np.nan, np.float32)
    assert len(points_of(pose(101), turn(101.1, ranges=nothing))) == 0
