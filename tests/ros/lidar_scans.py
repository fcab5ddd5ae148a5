"""Scans of simple places: returns by degrees with copies, or as the A1's driver samples them."""

import dataclasses
import math

import numpy as np
from cfnav_ros.lidar.returns import Scan
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.rplidar import (
    ANGLE_MAX,
    ANGLE_MIN,
    bearings,
    driver_ranges,
    sample_angles,
)

FRAME = "rplidar_link"
TURN_S = 0.13
EXACT = Noise(NoiseLevels().scaled(0.0), 0)
POSTS_DEG = (58.3, -58.3, 111.7, -111.7, 180.0)


def scan_of(distance, returns=360, copies=3):
    """A scan in the A1 driver's fields: distance(bearing in the LiDAR's base-aligned frame) -> m.

    The LiDAR's own x-axis points left of the robot, so bearing 0 is laser angle -pi/2.
    """
    angle_min, angle_max = -3.12414, math.pi
    count = returns * copies
    increment = (angle_max - angle_min) / (count - 1)
    centres = angle_min + (np.arange(returns) * copies + (copies - 1) / 2) * increment
    values = np.array([distance(angle + math.pi / 2) for angle in centres], np.float32)
    ranges = np.repeat(values, copies)
    return Scan(ranges, angle_min, angle_max, increment, 0.15, 12.0, FRAME, TURN_S)


def sampled(distance, mode, noise=EXACT):
    """The same place as the A1's driver says it, posts included."""
    angles = sample_angles(mode, noise.phase())
    values = [distance(math.remainder(bearing, math.tau)) for bearing in bearings(angles)]
    ranges = driver_ranges(angles, noise.scan(np.array(values, np.float32)), mode)
    increment = (ANGLE_MAX - ANGLE_MIN) / (mode.bins - 1)
    return Scan(ranges, ANGLE_MIN, ANGLE_MAX, increment, 0.15, 12.0, FRAME, TURN_S)


def wall_ahead(base_x, else_at=3.0):
    """A wall across the way at base_x in base_link, everything else 3 m away."""

    def distance(bearing):
        forward = math.cos(bearing)
        return min((base_x + 0.04) / forward, else_at) if forward > 0.05 else else_at

    return distance


def room(bearing):
    """Something at 3 m all round, never twice the same value."""
    return 3.0 + 0.1 * math.sin(bearing)


def replaced(scan, value, low_deg, high_deg):
    """The scan with every beam between two bearings (base frame) set to a value."""
    bearing = scan.angle_min + np.arange(scan.ranges.size) * scan.angle_increment + math.pi / 2
    bearing = np.degrees((bearing + math.pi) % (2 * math.pi) - math.pi)
    ranges = scan.ranges.copy()
    ranges[(bearing >= low_deg) & (bearing <= high_deg)] = value
    return dataclasses.replace(scan, ranges=ranges)


def behind_posts(scan, turned_deg=0.0):
    """The scan as the robot's own posts let it through; they are where they are, turned or not."""
    for post in POSTS_DEG:
        centre = (post + turned_deg + 180) % 360 - 180
        scan = replaced(scan, math.inf, centre - 3, centre + 3)
        if centre > 177 or centre < -177:
            scan = replaced(replaced(scan, math.inf, 177, 180), math.inf, -180, -177)
    return scan


def noisy(scan, rng, share=0.005):
    """The scan with errors of its ranges, the same in the three bins of one return."""
    errors = np.repeat(rng.standard_normal(scan.ranges.size // 3), 3) * share
    return dataclasses.replace(scan, ranges=(scan.ranges * (1 + errors)).astype(np.float32))
