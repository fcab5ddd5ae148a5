"""The LiDAR's mask is learnt from a recorded turn of the mock's own scans."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import yaml
from cfnav_ros.bags.lidar_mask import Sector, file_lines, own_sectors, turned
from cfnav_ros.lidar.estimate import SweptDisc
from cfnav_ros.lidar.returns import Mount, Scan
from sim_bridge.robot.lidar_turn import standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.rplidar import (
    ANGLE_MAX,
    ANGLE_MIN,
    BLIND_SECTORS_DEG,
    RANGE_MAX,
    RANGE_MIN,
    SENSITIVITY,
    STANDARD,
    ScanMode,
)
from sim_bridge.room.room import generate_room
from sim_bridge.world.world import World

TURN = np.linspace(0.0, 2.2 * math.pi, 60)
SECOND = 1_000_000_000
DISC = SweptDisc()
CENTRE = Mount(0.0, 0.0, 0.0)


def turned_scans(mode: ScanMode) -> list[Scan]:
    """One and a tenth turns on the spot in a furnished kitchen, with the mock's noise."""
    noise = Noise(NoiseLevels(), seed=5)
    world = World(generate_room("kitchen", 3))
    at = world.pose
    increment = (ANGLE_MAX - ANGLE_MIN) / (mode.bins - 1)
    return [
        Scan(standing_turn(world, noise, mode, replace(at, yaw=float(yaw))),
             ANGLE_MIN, ANGLE_MAX, increment, RANGE_MIN, RANGE_MAX)
        for yaw in TURN
    ]  # fmt: skip


@pytest.fixture(scope="module")
def scans() -> list[Scan]:
    """As a TurtleBot 4 sends them."""
    return turned_scans(SENSITIVITY)


def covers(lines: str, bearing: float) -> bool:
    disc = yaml.safe_load(lines)["lidar"]
    off = [(bearing - float(word) + 180) % 360 - 180 for word in disc["mask_bearings_deg"].split()]
    return min(map(abs, off)) <= disc["mask_half_width_deg"]


def write(bag: object, scans: list[Scan], yaws: np.ndarray) -> None:
    bag.writer.add_topic("/robot1/scan", "sensor_msgs/msg/LaserScan")
    bag.writer.add_topic("/robot1/odom", "nav_msgs/msg/Odometry")
    for i, (scan, yaw) in enumerate(zip(scans, yaws, strict=True)):
        t = i * SECOND // 8
        orientation = bag.message(
            "geometry_msgs/Quaternion", z=math.sin(yaw / 2), w=math.cos(yaw / 2), x=0.0, y=0.0
        )
        pose = bag.message("geometry_msgs/Pose", orientation=orientation)
        covered = bag.message(
            "geometry_msgs/PoseWithCovariance", pose=pose, covariance=np.zeros(36)
        )
        twist = bag.message("geometry_msgs/TwistWithCovariance", covariance=np.zeros(36))
        odometry = bag.message("nav_msgs/Odometry", header=bag.header(t), pose=covered, twist=twist)
        bag.write("/robot1/odom", t, odometry)
        fields = {name: getattr(scan, name) for name in ("angle_min", "angle_max", "range_min")}
        message = bag.message(
            "sensor_msgs/LaserScan", header=bag.header(t), ranges=scan.ranges,
            angle_increment=scan.angle_increment, range_max=scan.range_max,
            intensities=np.zeros(0, np.float32), **fields,
        )  # fmt: skip
        bag.write("/robot1/scan", t, message)
    bag.writer.close()


@pytest.mark.parametrize(("mode", "left"), [(SENSITIVITY, 0.2), (STANDARD, 0.6)])
def test_posts_and_bracket_are_found(mode: ScanMode, left: float) -> None:
    """``left``: degrees by which the driver announces further left what it does not see."""
    scans = turned_scans(mode)
    sectors = own_sectors(scans, turned(TURN), DISC.mount, DISC.radius)
    found = sorted(sector.bearing % 360 for sector in sectors)
    announced = [(bearing + left, half) for bearing, half in BLIND_SECTORS_DEG]
    assert found == pytest.approx(sorted(bearing % 360 for bearing, _ in announced), abs=1.0)
    lines = file_lines(sectors)
    for bearing, half in announced:
        assert covers(lines, bearing - half)
        assert covers(lines, bearing + half)
    for bearing in (0, 30, -30, 90, -90, 150, -150):
        assert not covers(lines, bearing)


def test_the_command_prints_what_the_node_reads(synthetic_bag: Callable, scans: list[Scan]) -> None:
    bag = synthetic_bag()
    write(bag, scans, TURN)
    command = [sys.executable, "-m", "cfnav.cli", "bag", "mask", str(bag.path)]
    told = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert (told.returncode, told.stderr) == (0, "")
    disc = SweptDisc(**yaml.safe_load(told.stdout)["lidar"])
    assert len(disc.mask_bearings) == 5
    assert disc.mask_half_width_deg < 6.0
    told = subprocess.run([*command, "--robot", "differential"], capture_output=True, text=True)
    assert told.returncode == 2
    assert "lidar.mount of differential is tf" in told.stderr


def test_a_robot_that_did_not_turn_tells_nothing(
    synthetic_bag: Callable, scans: list[Scan]
) -> None:
    bag = synthetic_bag()
    write(bag, scans, np.linspace(0.0, math.pi, len(scans)))
    command = [sys.executable, "-m", "cfnav.cli", "bag", "mask", str(bag.path)]
    told = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert told.returncode == 2
    assert "the robot turned by 180 degrees, expected at least 360" in told.stderr


def test_too_few_scans_or_a_covered_lidar_are_told(scans: list[Scan]) -> None:
    with pytest.raises(ValueError, match="there are 3 scans"):
        own_sectors(scans[:3], 7.0, DISC.mount, DISC.radius)
    dark = [replace(scan, ranges=np.full(SENSITIVITY.bins, np.inf, np.float32)) for scan in scans]
    with pytest.raises(ValueError, match="360 degrees around bearing"):
        own_sectors(dark, 7.0, DISC.mount, DISC.radius)


def plain(hidden_deg: tuple[int, ...], ghosts: float = 0.0, part: float = 0.1) -> list[Scan]:
    """Scans of 360 beams at whole degrees, 2 m all around but for some bearings."""
    generator = np.random.default_rng(1)
    made = []
    for _ in range(100):
        ranges = np.full(360, 2.0, np.float32)
        hide = np.array(hidden_deg)
        ranges[hide] = np.where(generator.random(hide.size) < ghosts, 0.2, part)
        made.append(Scan(ranges, 0.0, math.radians(359), math.radians(1), 0.15, 12.0))
    return made


def test_a_part_in_front_is_one_sector_and_ghosts_do_not_hide_it() -> None:
    (sector,) = own_sectors(plain((358, 359, 0, 1), ghosts=0.02), 7.0, CENTRE, DISC.radius)
    assert sector == Sector(pytest.approx(-0.25, abs=0.5), pytest.approx(1.75, abs=0.5))


@pytest.mark.parametrize(("part", "parts"), [(0.16, 1), (0.17, 1), (0.18, 0)])
def test_a_part_that_returns_from_within_the_hull_is_found(part: float, parts: int) -> None:
    scans = plain((20, 21, 22, 23), part=part)
    assert len(own_sectors(scans, 7.0, CENTRE, DISC.radius)) == parts
    # A LiDAR 0.04 m behind the middle sees the hull end at 0.21 m there.
    assert len(own_sectors(scans, 7.0, Mount(-0.04, 0.0, 0.0), DISC.radius)) == 1


def test_a_robot_without_parts_in_the_way_has_an_empty_mask() -> None:
    assert own_sectors(plain((90,)), 7.0, CENTRE, DISC.radius) == []
    disc = SweptDisc(**yaml.safe_load(file_lines([]))["lidar"])
    assert len(disc.mask_bearings) == 0


def test_turning_back_and_forth_is_no_whole_turn() -> None:
    swing = np.concatenate([np.linspace(0, 3, 50), np.linspace(3, 0, 50)])
    assert turned(swing) == pytest.approx(3.0)
    wrapped = (np.linspace(0, 7, 100) + math.pi) % math.tau - math.pi
    assert turned(wrapped) == pytest.approx(7.0)
