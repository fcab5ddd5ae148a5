"""What the LiDAR saw around a drive, as points in the odometry frame. Pure.

No map is made of them: odometry drifts, and nothing corrects it here. They show where walls and
furniture were when a bag holds no map.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from cfnav_ros.bags.files.events import Event, LaserTurn, Pose
from cfnav_ros.bags.judge.clocks import Clocks
from cfnav_ros.bags.judge.drive_log import Drive
from cfnav_ros.bags.judge.drives import MOST
from cfnav_ros.drive.motion import wrap
from cfnav_ros.lidar.estimate import SweptDisc
from cfnav_ros.lidar.returns import Mount, malformed, points_around

APART_M, APART_RAD = 0.2, math.radians(20.0)
"""A scan is kept when the robot has moved so far since the last that was."""

TURNING = 0.2
"""rad/s; a robot that turns faster smears its scan."""

FAR_M = 8.0
"""Returns further off are too inaccurate to be drawn."""

CELL_M = 0.04
"""Points of one drive are told apart by so much."""

MOST_SCANS = 1000
"""Kept of a drive, some 200 m of way; of a longer one the oldest are lost."""


class ScanMap:
    """Keeps the points of a drive until it is over."""

    def __init__(self) -> None:
        self._clocks = Clocks()
        self._pose: Pose | None = None
        self._last: Pose | None = None
        self._kept: deque[tuple[int, np.ndarray]] = deque(maxlen=MOST_SCANS)

    def see(self, event: Event, mount: Mount | None) -> None:
        """Take the next event.

        Args:
            event: odometry and scans count.
            mount: of the scanner that a scan comes from, None while it is not known.
        """
        if isinstance(event, Pose):
            if all(abs(number) <= MOST for number in (event.x, event.y, event.yaw)):
                self._pose = event
        elif isinstance(event, LaserTurn):
            t_ns = self._clocks.time(event)
            if mount is not None and self._pose is not None and self._is_new(self._pose):
                points = _points(event, mount, self._pose)
                if len(points):
                    self._last = self._pose
                    self._kept.append((t_ns, points))

    def cut(self, drive: Drive) -> np.ndarray:
        """The points of a finished drive; those before its end are dropped.

        Returns:
            float32 [N, 2], metres in the odometry frame.
        """
        inside = [points for t, points in self._kept if drive.start_ns <= t <= drive.end_ns]
        later = [kept for kept in self._kept if kept[0] > drive.end_ns]
        self._kept = deque(later, maxlen=MOST_SCANS)
        self._last = None
        if not inside:
            return np.empty((0, 2), np.float32)
        cells = np.unique(np.round(np.concatenate(inside) / CELL_M).astype(np.int64), axis=0)
        return (cells * CELL_M).astype(np.float32)

    def _is_new(self, pose: Pose) -> bool:
        """Whether a scan from here shows something else than the last."""
        last = self._last
        if abs(pose.w) > TURNING:
            return False
        if last is None:
            return True
        moved = math.hypot(pose.x - last.x, pose.y - last.y)
        return moved >= APART_M or abs(wrap(pose.yaw - last.yaw)) >= APART_RAD


def _points(turn: LaserTurn, mount: Mount, pose: Pose) -> np.ndarray:
    """The returns of a scan from beyond the hull: float64 [N, 2], metres, odometry frame."""
    if malformed(turn.scan):
        return np.empty((0, 2))
    points = points_around(turn.scan, mount, SweptDisc.radius)
    x, y = points[np.hypot(*(points - [mount.x, mount.y]).T) <= FAR_M].T
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.column_stack([pose.x + c * x - s * y, pose.y + s * x + c * y])
