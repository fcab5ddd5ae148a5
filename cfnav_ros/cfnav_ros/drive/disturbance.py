"""What odometry tells of a base that does not do what it is told: it slips, or moves by itself.

Pure; time is that of the samples' stamps.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from cfnav_ros.drive.motion import Odometry, wrap

SLIP_WINDOW_S = 0.35
"""Looked back over: seven samples of a Create 3, so one late sample does not matter."""

SLIP_M, SLIP_RAD = 0.02, math.radians(4.0)
"""Motion that the twist must promise within the window before the pose is held against it: what
0.06 m/s or 0.2 rad/s give, more than creeping."""

SLIP_SHARE = 0.2
"""Share of the promised motion below which the pose stands."""

PUSH_M, PUSH_RAD = 0.03, math.radians(3.0)
"""Displacement of a base that was told to stand, from where it came to rest. A coasting base is
not at rest yet; drift of the gyroscope while it stands stays far below."""


class Slip:
    """Notices that the twist says the base moves while its pose stands."""

    def __init__(self) -> None:
        self._samples: deque[Odometry] = deque()

    def take(self, sample: Odometry) -> None:
        """Take the newest odometry; repeats do no harm."""
        samples = self._samples
        if samples and sample.stamp <= samples[-1].stamp:
            if sample.stamp < samples[-1].stamp:
                samples.clear()
                samples.append(sample)
            return
        samples.append(sample)
        while sample.stamp - samples[0].stamp > SLIP_WINDOW_S:
            samples.popleft()

    def complaint(self) -> str:
        """One sentence while the base slips, else empty."""
        promised = promised_turn = way = turn = 0.0
        samples = list(self._samples)
        for before, after in pairwise(samples):
            dt = after.stamp - before.stamp
            promised += abs(after.v) * dt
            promised_turn += abs(after.w) * dt
            way += math.hypot(after.x - before.x, after.y - before.y)
            turn += abs(wrap(after.yaw - before.yaw))
        slides = promised >= SLIP_M and way < SLIP_SHARE * promised
        spins = promised_turn >= SLIP_RAD and turn < SLIP_SHARE * promised_turn
        if not (slides or spins):
            return ""
        newest = samples[-1]
        return (
            f"The base slips, or its odometry is frozen: the twist says {newest.v:.2f} m/s and "
            f"{newest.w:.2f} rad/s while the pose stands."
        )


class Standing:
    """Notices that a base that was told to stand, and stood, moves."""

    def __init__(self) -> None:
        self._anchor: Odometry | None = None

    def release(self) -> None:
        """The base is told to move from now on."""
        self._anchor = None

    def moved(self, sample: Odometry, resting: bool) -> bool:
        """Take the newest odometry of a base that is told to stand.

        Args:
            sample: newest odometry.
            resting: whether the base has come to rest.

        Returns:
            True once for every time that it is moved from where it rested.
        """
        anchor = self._anchor
        if anchor is None:
            self._anchor = sample if resting else None
            return False
        way = math.hypot(sample.x - anchor.x, sample.y - anchor.y)
        if way <= PUSH_M and abs(wrap(sample.yaw - anchor.yaw)) <= PUSH_RAD:
            return False
        self._anchor = None
        return True
