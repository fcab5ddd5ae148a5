"""A turn of the RPLIDAR A1M8 as its ROS driver hands it on.

The sensor is mounted turned left by 90 degrees, so the robot's front is laser angle -pi/2. The
driver spreads 360 returns over 1080 bins that span 359 degrees, and writes +inf both where nothing
returned and where something is too close. Pure: numpy in, numpy out.

Source: rplidar_ros ``src/rplidar_node.cpp`` (branch ros2); turtlebot4_description.
"""

from __future__ import annotations

import math

import numpy as np

RETURNS = 360
"""Returns of one turn, one per degree."""

COPIES = 3
"""Bins the driver writes each return into at 8 kHz."""

BINS = RETURNS * COPIES
ANGLE_MIN = math.pi - math.radians(359.0)
ANGLE_MAX = math.pi
RANGE_MIN = 0.15
RANGE_MAX = 12.0
SCAN_PERIOD = 1.0 / 7.7
"""s; how long a turn takes."""

_MOUNT_DEG = 90
"""Yaw of the sensor on the robot."""

BLIND_SECTORS_DEG = ((58.3, 2.6), (-58.3, 2.6), (111.7, 3.5), (-111.7, 3.5), (180.0, 3.5))
"""Bearing from the robot's front and half width of what hides behind the four posts of the tower
(radius 6 mm at 0.134 and 0.098 m) and the camera bracket; all stand nearer than the sensor sees.
"""


def _blind() -> np.ndarray:
    bearings = np.arange(RETURNS)
    blind = np.zeros(RETURNS, dtype=bool)
    for centre, half_width in BLIND_SECTORS_DEG:
        blind |= np.abs((bearings - centre + 180.0) % 360.0 - 180.0) <= half_width
    return blind


_BLIND = _blind()


def driver_ranges(distances: np.ndarray) -> np.ndarray:
    """Shape true distances as the driver's ``LaserScan.ranges``.

    Args:
        distances: float32 [360], metres, inf where nothing; entry i at bearing i degrees
            counter-clockwise from the robot's front.

    Returns:
        float32 [1080], metres, +inf for no return: behind the robot's own posts, nearer than
        ``RANGE_MIN``, farther than ``RANGE_MAX``.
    """
    lost = _BLIND | (distances < RANGE_MIN) | (distances > RANGE_MAX)
    returns = np.where(lost, np.float32(np.inf), distances).astype(np.float32)
    # The first triple of bins lies at laser angle -179 degrees: bearing -89.
    return np.repeat(np.roll(returns, _MOUNT_DEG - 1), COPIES)
