"""A turn of the LiDAR gathered while the robot moves: each beam is cast from where it was then."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sim_bridge.rplidar import RETURNS, SCAN_PERIOD

if TYPE_CHECKING:
    from sim_bridge.world import Pose, World

FIRST_BEARING_DEG = 270
"""The driver's highest bin: samples run clockwise, so bearings fall from here through a turn.

Source: rplidar_ros ``src/rplidar_node.cpp``, which reverses what the device sends.
"""


class LidarTurn:
    """Collects the robot's poses through a turn and casts its beams when it is complete.

    Attributes:
        began: simulated s, when the turn began; the driver stamps the scan with it.
    """

    def __init__(self) -> None:
        self.restart(0.0)

    def restart(self, t: float) -> None:
        """Begin a turn at simulated time t, s."""
        self.began = t
        self._poses: list[tuple[int, Pose]] = []

    def complete(self, t: float, pose: Pose) -> bool:
        """Take the pose after a step.

        Args:
            t: simulated s.
            pose: of the robot then.

        Returns:
            Whether the turn is complete; then ``distances`` and ``next`` follow.
        """
        share = (t - self.began + 1e-9) / SCAN_PERIOD
        self._poses.append((min(RETURNS, math.floor(share * RETURNS)), pose))
        return share >= 1.0

    def distances(self, world: World) -> np.ndarray:
        """float32 [360], metres, of the complete turn; entry i at bearing i degrees."""
        out = np.empty(RETURNS, np.float32)
        done = 0
        for k, (count, pose) in enumerate(self._poses):
            # One cast for all beams from one pose: most turns see a robot that stands.
            stands = k + 1 < len(self._poses) and self._poses[k + 1][1] == pose
            if stands or count == done:
                continue
            beams = (FIRST_BEARING_DEG - np.arange(done, count)) % RETURNS
            out[beams] = world.scan(pose, beams)
            done = count
        return out

    def next(self) -> None:
        """Begin the turn that follows without a pause."""
        self.restart(self.began + SCAN_PERIOD)
