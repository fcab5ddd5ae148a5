"""Pictures and scans that repeat themselves under new stamps. Pure.

Only the last of each is kept to compare with. A simulator without noise repeats itself while its
robot stands; so a repetition is a fault only if the robot moved meanwhile, or if the sensor has
shown before that it has noise (``picture_watch``).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfnav_ros.bags.events import Pose
from cfnav_ros.motion import wrap
from cfnav_ros.picture_watch import MOVED_M, MOVED_RAD, NOISY, REST_S, SAME_M, SAME_RAD

FROZEN_S = 1.0
"""Repetition from which the robot takes a sensor for frozen: the default of its nodes."""


class Frozen:
    """Looks at one sensor's messages."""

    def __init__(self) -> None:
        self._data: Any = None
        self._stamp_ns = 0
        self._since = 0.0
        self._pose: Pose | None = None
        self._rest: tuple[float, Pose | None] = (0.0, None)
        self._different = 0

    def see(self, t: float, stamp_ns: int, data: Any, pose: Pose | None) -> float | None:
        """Take a message.

        Args:
            t: s of log time.
            stamp_ns: its stamp.
            data: what is compared: bytes, a memoryview or an array.
            pose: newest odometry, None while there is none.

        Returns:
            Since when the sensor is frozen, seconds; None while it is not.
        """
        rested_at = self._rest[1]
        if _apart(pose, rested_at, SAME_M, SAME_RAD) or (pose is None) != (rested_at is None):
            self._rest = (t, pose)
        new_stamp, before = stamp_ns != self._stamp_ns, self._data
        self._stamp_ns, self._data = stamp_ns, data
        if before is None or not _same(before, data):
            # Without odometry every view counts as one of a robot at rest.
            rested = pose is None or t - self._rest[0] > REST_S
            self._different += rested and before is not None
            self._since, self._pose = t, pose
            return None
        noisy = self._different >= NOISY
        if not noisy:
            self._different = 0
        moved = _apart(pose, self._pose, MOVED_M, MOVED_RAD)
        frozen = new_stamp and t - self._since >= FROZEN_S and (noisy or moved)
        return self._since if frozen else None


def _same(a: Any, b: Any) -> bool:
    """Whether two buffers hold the same bytes."""
    first, second = _bytes(a), _bytes(b)
    return first.shape == second.shape and bool(np.array_equal(first, second))


def _bytes(data: Any) -> np.ndarray:
    array = data if isinstance(data, np.ndarray) else np.frombuffer(data, np.uint8)
    # As bytes, so that NaN equals itself.
    return np.ascontiguousarray(array).view(np.uint8).ravel()


def _apart(a: Pose | None, b: Pose | None, metres: float, radians: float) -> bool:
    """Whether two poses differ by more than so much; without one they do not."""
    if a is None or b is None:
        return False
    return math.hypot(a.x - b.x, a.y - b.y) > metres or abs(wrap(a.yaw - b.yaw)) > radians
