"""A turn of the LiDAR: each sample is cast from where the robot was when it was taken."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from sim_bridge.robot.rplidar import (
    SCAN_PERIOD,
    SENSITIVITY,
    ScanMode,
    bearings,
    driver_ranges,
    sample_angles,
)

if TYPE_CHECKING:
    from sim_bridge.robot.noise import Noise
    from sim_bridge.world.world import Pose, World


class LidarTurn:
    """Collects the robot's poses through a turn and casts its samples when it is complete.

    Attributes:
        began: simulated s, when the turn began; the driver stamps the scan with it.
    """

    def __init__(self) -> None:
        self.restart(0.0)

    def restart(self, t: float) -> None:
        """Begin a turn at simulated time t, s."""
        self.began = t
        self._poses: list[tuple[float, Pose]] = []

    def complete(self, t: float, pose: Pose) -> bool:
        """Take the pose after a step.

        Args:
            t: simulated s.
            pose: of the robot then.

        Returns:
            Whether the turn is complete; then ``ranges`` and ``next`` follow.
        """
        share = (t - self.began + 1e-9) / SCAN_PERIOD
        self._poses.append((360.0 * share, pose))
        return share >= 1.0

    def ranges(self, world: World, noise: Noise, mode: ScanMode = SENSITIVITY) -> np.ndarray:
        """The complete turn as the driver says it: float32 [mode.bins], metres."""
        return _measured(lambda angles: self._cast(world, angles), noise, mode)

    def _cast(self, world: World, angles: np.ndarray) -> np.ndarray:
        out = np.empty(len(angles), np.float32)
        done = 0
        for k, (turned, pose) in enumerate(self._poses):
            # One cast for all samples from one pose: most turns see a robot that stands.
            if k + 1 < len(self._poses) and self._poses[k + 1][1] == pose:
                continue
            count = int(np.searchsorted(angles, turned, "right"))
            out[done:count] = world.scan(bearings(angles[done:count]), pose)
            done = count
        return out

    def next(self) -> None:
        """Begin the turn that follows without a pause."""
        self.restart(self.began + SCAN_PERIOD)


def standing_turn(
    world: World, noise: Noise, mode: ScanMode = SENSITIVITY, pose: Pose | None = None
) -> np.ndarray:
    """A turn of a robot that stands, as the driver says it.

    Args:
        world: where it stands.
        noise: of the LiDAR.
        mode: of the device.
        pose: where it stands; its present pose when None.

    Returns:
        float32 [mode.bins], metres, +inf for no return.
    """
    return _measured(lambda angles: world.scan(bearings(angles), pose), noise, mode)


def _measured(cast: Callable[[np.ndarray], np.ndarray], noise: Noise, mode: ScanMode) -> np.ndarray:
    angles = sample_angles(mode, noise.phase())
    return driver_ranges(angles, noise.scan(cast(angles)), mode)
