"""Depth pictures of a stereo or time-of-flight camera as points in space. Pure.

Source: REP-118, which says how sensor_msgs/Image holds depth: 16UC1 in mm, 0 for nothing; 32FC1 in
m, NaN and infinity for nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfnav_ros.robot.pictures import MAX_PIXELS

ENCODINGS = {"16UC1": ("u2", 1e-3), "mono16": ("u2", 1e-3), "32FC1": ("f4", 1.0)}
"""Type of a pixel and metres in its unit; depthai_bridge and others call millimetres mono16."""

MOST_COLUMNS = 320
"""Of a wider picture only every so manieth pixel is taken: points need not lie closer."""


@dataclass(frozen=True)
class DepthCamera:
    """A pinhole camera by its CameraInfo.

    Attributes:
        fx, fy: focal lengths, pixels.
        cx, cy: principal point, pixels.
        width, height: of its pictures, pixels.
        frame: optical, x right, y down, z along the axis.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    frame: str

    @property
    def fault(self) -> str:
        """One sentence when these numbers are no camera's, else empty."""
        numbers = self.fx, self.fy, self.cx, self.cy
        if all(map(math.isfinite, numbers)) and min(self.fx, self.fy, self.width, self.height) > 0:
            return ""
        return (
            f"The depth camera's calibration has focal lengths {self.fx:g} and {self.fy:g} for "
            f"{self.width}x{self.height} pixels, expected positive numbers: calibrate it."
        )

    def thinned(self, every: int) -> DepthCamera:
        """The camera whose pictures have only the first of so many rows and columns."""
        return DepthCamera(
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


def thinning(width: int) -> int:
    """Of how many columns one is taken, so that at most ``MOST_COLUMNS`` are left."""
    return max(1, -(-width // MOST_COLUMNS))


def depth_to_metres(message: Any, every: int = 1) -> np.ndarray:
    """Decode a depth picture.

    Args:
        message: with the fields of sensor_msgs/Image; rows may be padded (``step``).
        every: of so many rows, and of so many columns, the first is taken; 1 takes all.

    Returns:
        float32 [H, W], metres along the optical axis, 0 where nothing was measured; H and W divided
        by ``every``, rounded up.

    Raises:
        ValueError: another encoding, an empty or too large picture, too little data; one sentence.
    """
    height, width = message.height, message.width
    if message.encoding not in ENCODINGS:
        raise ValueError(
            f"The depth picture is encoded as {message.encoding!r}, expected one of "
            f"{', '.join(ENCODINGS)}: let the driver publish depth, no disparity and no colours."
        )
    kind, unit = ENCODINGS[message.encoding]
    pixel = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(
            f"The depth picture is {width}x{height}, expected 1 to {MAX_PIXELS} pixels."
        )
    row = width * pixel.itemsize
    if message.step < row or len(message.data) < message.step * height:
        raise ValueError(
            f"The depth picture holds {len(message.data)} bytes in rows of {message.step}, "
            f"expected {height} rows of {row} or more."
        )
    data = np.asarray(message.data, np.uint8)[: message.step * height].reshape(height, -1)
    values = np.ascontiguousarray(data[::every, :row]).view(pixel)[:, ::every]
    metres = values.astype(np.float32) * np.float32(unit)
    return np.where(np.isfinite(metres) & (metres > 0), metres, np.float32(0.0))
