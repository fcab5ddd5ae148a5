"""A turn of the RPLIDAR A1M8 as its ROS driver hands it on. Pure: numpy in, numpy out.

The device measures so many samples a second while it turns, clockwise from its own rear. The
driver (``angle_compensate``, as the TurtleBot 4 starts it) resamples a turn: each sample that
returned is written into the bin of its angle and the next ``multiple`` - 1, and the sample after it
overwrites what it shares with it. A turn of 1034 samples so fills 1080 bins, nearly each from a
sample of its own, and a sample that is lost shows what the one before it saw; 269 samples leave a
quarter of 360 bins empty. It then says that the bins span 359 degrees, and +inf both where nothing
returned and where something is too close: what a bin holds was seen up to a degree to the right of
where the message puts it.

Source: rplidar_ros ``src/rplidar_node.cpp`` (branch ros2, 1597018); turtlebot4_description.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ScanMode:
    """One of the device's ways to measure.

    Attributes:
        name: as the driver's parameter ``scan_mode`` has it.
        samples: of a turn.
        multiple: bins a degree; the driver takes the samples of a turn at 10 Hz over 360, plus one.
    """

    name: str
    samples: int
    multiple: int

    @property
    def bins(self) -> int:
        """Ranges of a message."""
        return 360 * self.multiple


SENSITIVITY = ScanMode("Sensitivity", 1034, 3)
"""8 kHz; a TurtleBot 4's. The samples of a turn are those that turtlebot4#149 shows."""

STANDARD = ScanMode("Standard", 269, 1)
"""2 kHz; samples as in turtlebot4#664."""

MODES = {mode.name: mode for mode in (SENSITIVITY, STANDARD)}

ANGLE_MIN = math.pi - math.radians(359.0)
ANGLE_MAX = math.pi
RANGE_MIN = 0.15
RANGE_MAX = 12.0
SCAN_PERIOD = 1.0 / 7.7
"""s; how long a turn takes."""

_REAR_DEG = 270.0
"""Bearing from the robot's front where a turn begins: the sensor is mounted turned left by 90
degrees, so that its rear is the robot's right."""

BLIND_SECTORS_DEG = ((58.3, 2.6), (-58.3, 2.6), (111.7, 3.5), (-111.7, 3.5), (180.0, 3.5))
"""Bearing from the robot's front and half width of what hides behind the four posts of the tower
(radius 6 mm at 0.134 and 0.098 m) and the camera bracket; all stand nearer than the sensor sees.
"""


def sample_angles(mode: ScanMode, phase: float) -> np.ndarray:
    """Where the samples of a turn are taken.

    Args:
        mode: of the device.
        phase: share of a sample's time from the beginning of the turn to its first sample.

    Returns:
        float64 [N], degrees turned, in the order of time.
    """
    return (np.arange(mode.samples) + phase) * (360.0 / mode.samples)


def bearings(angles: np.ndarray) -> np.ndarray:
    """Angles of the device, degrees, as bearings from the robot's front, radians, left positive."""
    return np.radians(_REAR_DEG - angles)


def driver_ranges(angles: np.ndarray, distances: np.ndarray, mode: ScanMode) -> np.ndarray:
    """Shape the samples of a turn as the driver's ``LaserScan.ranges``.

    Args:
        angles: float64 [N], degrees, rising; see ``sample_angles``.
        distances: float32 [N], metres, inf where nothing returned.
        mode: of the device.

    Returns:
        float32 [mode.bins], metres, +inf for no return: behind the robot's own posts, nearer than
        ``RANGE_MIN``, farther than ``RANGE_MAX``.
    """
    returned = ~_behind_parts(angles) & (distances >= RANGE_MIN) & (distances <= RANGE_MAX)
    first = np.floor(angles[returned] * mode.multiple).astype(int)
    bins = np.minimum(first[:, None] + np.arange(mode.multiple), mode.bins - 1)
    ranges = np.full(mode.bins, np.inf, np.float32)
    # Of several values for one place numpy keeps the last, as the driver does.
    ranges[bins] = distances[returned, None]
    return ranges[::-1].copy()


def _behind_parts(angles: np.ndarray) -> np.ndarray:
    hidden = np.zeros(len(angles), bool)
    for bearing, half_width in BLIND_SECTORS_DEG:
        apart = np.abs((_REAR_DEG - angles - bearing + 180.0) % 360.0 - 180.0)
        hidden |= apart <= half_width
    return hidden
