"""A camera as a pinhole without distortion: where its pixels look, and what it sees where."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfnav_core.task.camera import CameraSetUp


@dataclass(frozen=True)
class Pinhole:
    """Where the pixels of a camera look, as its ``CameraInfo`` or its set-up says.

    Attributes:
        fx, fy: focal lengths, pixels; 0 when nobody calibrated it.
        cx, cy: where its axis meets the picture, pixels; the middle of the first one is 0.
        width, height: of its pictures, pixels.
        frame: optical, x right, y down, z along the axis.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    frame: str = ""

    @classmethod
    def of(cls, camera: CameraSetUp, size: tuple[int, int] | None = None) -> Pinhole:
        """A camera by its set-up, in pictures of a width and height; its own when None."""
        (width, height), (across, down) = size or camera.size, camera.focal_share
        fx, fy = across * width, down * height
        return cls(fx, fy, (width - 1) / 2, (height - 1) / 2, width, height)

    @property
    def fov_deg(self) -> tuple[float, float] | None:
        """Horizontal and vertical field of view; None when it says nothing usable."""
        numbers = self.fx, self.fy, self.cx, self.cy
        sizes = self.fx, self.fy, self.width, self.height
        if not all(map(math.isfinite, numbers)) or min(sizes) <= 0:
            return None
        wide, high = self.width / self.fx / 2, self.height / self.fy / 2
        return math.degrees(2 * math.atan(wide)), math.degrees(2 * math.atan(high))

    def scaled(self, width: int, height: int) -> Pinhole:
        """The same view in pictures of another width and height."""
        across, down = width / self.width, height / self.height
        return Pinhole(
            self.fx * across, self.fy * down, (self.cx + 0.5) * across - 0.5,
            (self.cy + 0.5) * down - 0.5, width, height, self.frame,
        )  # fmt: skip

    def thinned(self, every: int) -> Pinhole:
        """The camera whose pictures have only the first of so many rows and columns."""
        return Pinhole(
            self.fx / every, self.fy / every, self.cx / every, self.cy / every,
            -(-self.width // every), -(-self.height // every), self.frame,
        )  # fmt: skip

    def placed(self, depth: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Where each pixel's surface is in another frame.

        Args:
            depth: float32 [H, W], metres along the axis.
            pose: float64 [4, 4], of the camera in that frame.

        Returns:
            float32 [3, H, W], metres.
        """
        turn, at = pose[:3, :3].astype(np.float32), pose[:3, 3].astype(np.float32)
        across = (np.arange(self.width, dtype=np.float32) - np.float32(self.cx)) / self.fx
        down = (np.arange(self.height, dtype=np.float32) - np.float32(self.cy)) / self.fy
        placed = np.empty((3, *depth.shape), np.float32)
        for k in range(3):
            placed[k] = across * turn[k, 0] + (down * turn[k, 1] + turn[k, 2])[:, None]
            placed[k] = placed[k] * depth + at[k]
        return placed

    def pixels(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where points [N, 3], metres, are seen: row and column int [N], and whether they are."""
        ahead = np.where(points[:, 2] > 0, points[:, 2], np.inf)
        column = np.rint(self.cx + self.fx * points[:, 0] / ahead)
        row = np.rint(self.cy + self.fy * points[:, 1] / ahead)
        inside = (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        inside &= points[:, 2] > 0
        return np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int), inside
