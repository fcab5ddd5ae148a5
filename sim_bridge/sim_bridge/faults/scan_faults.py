"""What can be wrong with a LaserScan message; each function changes one in place.

The rows that use them are in ``faults.FAULTS``. Knows no ROS: messages are taken as they come.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np

from sim_bridge.robot.rplidar import ANGLE_MAX, ANGLE_MIN, MODES

SPAN = ANGLE_MAX - ANGLE_MIN
NEAR_M = 0.10
SPECKLE_M = 0.2


def set_ranges(scan: Any, ranges: np.ndarray) -> None:
    """Write ranges and the intensities that the driver would give them."""
    scan.ranges = array("f", np.asarray(ranges, np.float32).tobytes())
    quality = np.where(np.isfinite(ranges), 15.0, 0.0).astype(np.float32)
    scan.intensities = array("f", quality.tobytes())


def ranges_of(scan: Any) -> np.ndarray:
    """float32 [N], metres: a copy of the ranges."""
    return np.array(scan.ranges, np.float32)


def all_ranges(value: float) -> Callable[[Any], None]:
    """Every range the same."""
    return lambda scan: set_ranges(scan, np.full(len(scan.ranges), value, np.float32))


def unknown_sector(width_deg: int) -> Callable[[Any], None]:
    """Nothing returns from a sector around the robot's front."""

    def alter(scan: Any) -> None:
        ranges = ranges_of(scan)
        angles = scan.angle_min + np.arange(len(ranges)) * scan.angle_increment
        off = np.abs((angles + math.pi / 2 + math.pi) % math.tau - math.pi)
        ranges[off <= math.radians(width_deg) / 2 + 1e-6] = np.inf
        set_ranges(scan, ranges)

    return alter


def speckle(rng: np.random.Generator) -> Callable[[Any], None]:
    """One sample out of the air, so one bin, at a bearing drawn for every scan."""

    def alter(scan: Any) -> None:
        ranges = ranges_of(scan)
        ranges[rng.integers(len(ranges))] = SPECKLE_M
        set_ranges(scan, ranges)

    return alter


def resampled(count: int) -> Callable[[Any], None]:
    """Another number of bins over the same span, header to match where two bins allow one."""

    def alter(scan: Any) -> None:
        ranges = ranges_of(scan)
        nearest = np.arange(count) * len(ranges) // max(count, 1)
        set_ranges(scan, ranges[nearest])
        if count > 1:
            scan.angle_increment = SPAN / (count - 1)
            scan.time_increment = scan.scan_time / (count - 1)

    return alter


def without_returns(samples: int) -> Callable[[Any], None]:
    """The driver's scan when every sample is invalid: the raw number of samples, all +inf."""

    def alter(scan: Any) -> None:
        resampled(samples)(scan)
        all_ranges(math.inf)(scan)

    return alter


def increment(factor: float) -> Callable[[Any], None]:
    """An angle_increment that is not the one between the bins."""

    def alter(scan: Any) -> None:
        scan.angle_increment *= factor

    return alter


def swap_limits(scan: Any) -> None:
    """The nearest range above the farthest."""
    scan.range_min, scan.range_max = scan.range_max, scan.range_min


def shorten(scan: Any) -> None:
    """Fewer ranges than the angles announce."""
    ranges = ranges_of(scan)
    set_ranges(scan, ranges[: len(ranges) - len(ranges) // 4])


def wrong_frame(scan: Any) -> None:
    """Another mounting than the robot has."""
    scan.header.frame_id = f"another_{scan.header.frame_id}"


def turn(scan: Any) -> None:
    """Mounted a quarter turn to the left of where it should be, own posts included."""
    ranges = ranges_of(scan)
    set_ranges(scan, np.roll(ranges, -(len(ranges) // 4)))


def mirror(scan: Any) -> None:
    """Mounted upside down: bearings run the other way."""
    set_ranges(scan, ranges_of(scan)[::-1])


def stranger(scan: Any) -> None:
    """What a second LiDAR says: a round wall 3 m away."""
    all_ranges(3.0)(scan)


SHAPES: dict[str, Callable[[Any], None]] = {
    "scan_all_inf": all_ranges(math.inf),
    "scan_all_nan": all_ranges(math.nan),
    "scan_all_zero": all_ranges(0.0),
    "scan_all_near": all_ranges(NEAR_M),
    **{f"scan_sector_{width}": unknown_sector(width) for width in (30, 90, 180)},
    **{f"scan_ranges_{count}": resampled(count) for count in (1, 360, 3240)},
    **{f"scan_ranges_{m.samples}_inf": without_returns(m.samples) for m in MODES.values()},
    "scan_ranges_0": resampled(0),
    "scan_increment_zero": increment(0.0),
    "scan_increment_negative": increment(-1.0),
    "scan_increment_nan": increment(math.nan),
    "scan_increment_wrong": increment(1.2),
    "scan_limits_swapped": swap_limits,
    "scan_short": shorten,
    "scan_wrong_frame": wrong_frame,
    "scan_turned_90": turn,
    "scan_mirrored": mirror,
}
"""Faults that change every scan the same way. Of several that hold, each takes what those before it
in the table have made; no ranges are left for those after ``scan_ranges_0``."""
