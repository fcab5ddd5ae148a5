"""What the robot did so far, from odometry and bumper: distance, bumps, whether it stands.

Pure; bag evaluation judges by ground truth instead.
"""

from __future__ import annotations

import math

from cfnav_ros.motion import Odometry, jumped

STILL_V, STILL_W = 0.01, 0.03
"""Slower than this (m/s, rad/s) is standing."""

STILL_SAMPLES = 3
"""Odometry samples in a row that must say so."""

BUMP_GAP_S = 0.5
"""Contacts closer in time than this are one bump."""


class Track:
    """Accumulates over one episode; feed it every new message, repeats do no harm."""

    def __init__(self, bumped_at: float = -math.inf) -> None:
        """Start from nothing; the bump reported at ``bumped_at`` (seconds) is an old one."""
        self.path_length = 0.0
        self.bumps = 0
        self._last: Odometry | None = None
        self._bumped_at = bumped_at
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
        if abs(sample.v) >= STILL_V or abs(sample.w) >= STILL_W:
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

    def bump(self, stamp: float) -> bool:
        """Take the stamp of the newest bump report, seconds; True when it is a new contact."""
        before, self._bumped_at = self._bumped_at, stamp
        new = stamp > before + BUMP_GAP_S
        self.bumps += new
        return new
