"""Pictures and scans that repeat themselves under new stamps. Pure."""

from __future__ import annotations

from typing import Any

import numpy as np

from cfnav_ros.bags.files.events import Pose
from cfnav_ros.drive.repeats import Repeats

FROZEN_S = 1.0
"""Repetition from which the robot takes a sensor for frozen: the default of its nodes."""


class Frozen:
    """Looks at one sensor's messages; only the last is kept to compare with."""

    def __init__(self) -> None:
        self._data: Any = None
        self._stamp_ns = 0
        self._repeats = Repeats()

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
        new_stamp, before = stamp_ns != self._stamp_ns, self._data
        self._stamp_ns, self._data = stamp_ns, data
        same = before is not None and _same(before, data)
        place = None if pose is None else (pose.x, pose.y, pose.yaw)
        newer = 0.0 if pose is None else (pose.t_ns - stamp_ns) * 1e-9
        self._repeats.see(t, stamp_ns, same, place, t + newer)
        long = new_stamp and t - self._repeats.since >= FROZEN_S
        return self._repeats.since if long and self._repeats.frozen else None


def _same(a: Any, b: Any) -> bool:
    """Whether two buffers hold the same bytes."""
    first, second = _bytes(a), _bytes(b)
    return first.shape == second.shape and bool(np.array_equal(first, second))


def _bytes(data: Any) -> np.ndarray:
    array = data if isinstance(data, np.ndarray) else np.frombuffer(data, np.uint8)
    # As bytes, so that NaN equals itself.
    return np.ascontiguousarray(array).view(np.uint8).ravel()
