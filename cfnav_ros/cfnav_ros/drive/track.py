"""What the robot did so far, from odometry and bumper: distance, bumps, what it met, if it stands.

Pure; bag evaluation judges by ground truth instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cfnav_core.task.actions import STEP_M, TURN_RAD
from cfnav_ros.drive.disturbance import Slip
from cfnav_ros.drive.motion import Odometry, Status, wrap

STILL_V, STILL_W = 0.01, 0.03
"""A twist slower than this (m/s, rad/s) is standing."""

DRIFT_V, DRIFT_W = 0.04, 0.1
"""A pose that moves faster than this (m/s, rad/s) is not standing, whatever the twist says."""

STILL_SAMPLES = 3
"""Odometry samples in a row that must say so."""

MIN_DT_S = 0.02
"""Samples closer in time than this are compared as if they were this far apart, seconds."""

JUMP_M, JUMP_M_PER_S = 0.10, 0.46
JUMP_RAD, JUMP_RAD_PER_S = math.radians(20.0), 1.9
"""Odometry that moves more between two samples, beyond the base's top speed, was reset."""

BUMP_GAP_S = 0.5
"""Contacts closer in time than this are one bump."""

ASIDE_M = 0.10
"""A MoveAhead that passes a stop by no more than this leads to it, metres: about half a hull's
radius."""


class Track:
    """Accumulates over one episode; feed it every new message, repeats do no harm."""

    def __init__(self, bumped_at: float = -math.inf) -> None:
        """Start from nothing; a bump that was known at ``bumped_at``, seconds, is old."""
        self.path_length = 0.0
        self.bumps = 0
        self.slip = Slip()
        self._last: Odometry | None = None
        self.bumped_at = bumped_at
        """When the bumper was last known to be pressed, seconds."""
        self._still_samples = 0
        self._still_from = 0.0

    @property
    def still_since(self) -> float | None:
        """Stamp of the first sample of the present standstill, seconds; None while moving."""
        return self._still_from if self._still_samples >= STILL_SAMPLES else None

    def odometry(self, sample: Odometry) -> bool:
        """Take odometry; False when it jumped (the leap is not counted as distance)."""
        before = self._last
        if before and before.stamp == sample.stamp:
            return True
        self._last = sample
        self.slip.take(sample)
        if abs(sample.v) >= STILL_V or abs(sample.w) >= STILL_W or _drifts(before, sample):
            self._still_samples = 0
        else:
            self._still_from = self._still_from if self._still_samples else sample.stamp
            self._still_samples += 1
        if before is None:
            return True
        if jumped(before, sample):
            return False
        self.path_length += math.hypot(sample.x - before.x, sample.y - before.y)
        return True

    def bump(self, came: float) -> bool:
        """Take when the bumper was last known to be pressed; True when it is a new contact."""
        before, self.bumped_at = self.bumped_at, max(came, self.bumped_at)
        new = came - before > BUMP_GAP_S
        self.bumps += new
        return new


@dataclass(frozen=True)
class Stop:
    """A MoveAhead that something stopped: where, how it ended, and one sentence on it."""

    at: Odometry
    status: Status
    reason: str


class Met:
    """Remembers for one drive where something stopped a MoveAhead: that way is not free.

    A LiDAR sees one plane. A table top that reaches over it stays unseen however often the robot
    runs into it, and from the same place a policy decides the same again.
    """

    def __init__(self) -> None:
        self._stops: list[Stop] = []

    def take(self, stop: Stop) -> None:
        """Something stopped a MoveAhead."""
        self._stops.append(stop)

    def ahead(self, at: Odometry) -> Stop | None:
        """The stop to which a MoveAhead from this pose would lead, the newest of several.

        It leads there when it passes the place within ``ASIDE_M`` with the same heading, to half
        a turn.
        """
        return next((stop for stop in reversed(self._stops) if _leads_to(at, stop.at)), None)


def jumped(before: Odometry, after: Odometry) -> bool:
    """Whether the pose moved further between two samples than a base can drive."""
    dt = max(after.stamp - before.stamp, 0.0)
    leap = math.hypot(after.x - before.x, after.y - before.y)
    turn = abs(wrap(after.yaw - before.yaw))
    return leap > JUMP_M + JUMP_M_PER_S * dt or turn > JUMP_RAD + JUMP_RAD_PER_S * dt


def _drifts(before: Odometry | None, sample: Odometry) -> bool:
    """Whether the pose moved between two samples."""
    if before is None:
        return False
    dt = max(sample.stamp - before.stamp, MIN_DT_S)
    way = math.hypot(sample.x - before.x, sample.y - before.y)
    return way > DRIFT_V * dt or abs(wrap(sample.yaw - before.yaw)) > DRIFT_W * dt


def _leads_to(at: Odometry, stop: Odometry) -> bool:
    dx, dy = stop.x - at.x, stop.y - at.y
    ahead = dx * math.cos(at.yaw) + dy * math.sin(at.yaw)
    aside = dy * math.cos(at.yaw) - dx * math.sin(at.yaw)
    along = -ASIDE_M <= ahead <= STEP_M and abs(aside) <= ASIDE_M
    return along and abs(wrap(stop.yaw - at.yaw)) <= TURN_RAD / 2
