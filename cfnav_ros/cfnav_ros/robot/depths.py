"""Depth pictures and point clouds of a stereo or time-of-flight camera, as metres a pixel. Pure.

Sources: REP-118, which says how sensor_msgs/Image holds depth: 16UC1 in mm, 0 for nothing; 32FC1 in
m, NaN and infinity for nothing. sensor_msgs/PointCloud2, whose points x, y, z are metres in its
frame, NaN for nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.robot.pictures import MAX_PIXELS

ENCODINGS = {"16UC1": ("u2", 1e-3), "mono16": ("u2", 1e-3), "32FC1": ("f4", 1.0)}
"""Type of a pixel and metres in its unit; depthai_bridge and others call millimetres mono16."""

POINT_TYPES = {7: "f4", 8: "f8"}
"""Numbers that sensor_msgs/PointField gives to the types of a coordinate."""

MOST_COLUMNS = 320
"""Of a wider picture only every so manieth pixel is taken: points need not lie closer."""


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


def cloud_to_metres(message: Any, camera: Pinhole, pose: np.ndarray) -> np.ndarray:
    """The depth picture that a camera would take of a point cloud: in each pixel its nearest point.

    Args:
        message: with the fields of sensor_msgs/PointCloud2, ordered as a picture or not.
        camera: of the depth that the cloud was made from.
        pose: float64 [4, 4], of the cloud's frame in the camera's.

    Returns:
        float32 [H, W], metres along the optical axis, 0 where no point lies.

    Raises:
        ValueError: no coordinates, too many points, too little data; one sentence.
    """
    height, width, step, row = message.height, message.width, message.point_step, message.row_step
    at = {field.name: field for field in message.fields if field.name in ("x", "y", "z")}
    kinds = {POINT_TYPES.get(field.datatype) for field in at.values()}
    if len(at) < 3 or kinds not in ({"f4"}, {"f8"}):
        raise ValueError("The depth cloud has no x, y, z of float32 or float64: let it have them.")
    if height * width > MAX_PIXELS:
        raise ValueError(
            f"The depth cloud has {height * width} points, expected at most {MAX_PIXELS}."
        )
    (kind,) = kinds
    coordinate = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    fits = max(field.offset for field in at.values()) + coordinate.itemsize <= step
    if not fits or row < width * step or len(message.data) < row * height:
        raise ValueError(
            f"The depth cloud holds {len(message.data)} bytes in rows of {row} and points of "
            f"{step}, expected {height} rows of {width} points with x, y and z."
        )
    rows = np.asarray(message.data, np.uint8)[: row * height].reshape(height, row)
    offsets = [at[axis].offset for axis in "xyz"]
    layout = np.dtype({
        "names": ["x", "y", "z"], "formats": [coordinate] * 3, "offsets": offsets, "itemsize": step,
    })  # fmt: skip
    found = np.ascontiguousarray(rows[:, : width * step]).view(layout).ravel()
    points = np.stack([found[axis] for axis in "xyz"], axis=1).astype(float)
    points = points[np.isfinite(points).all(axis=1)] @ pose[:3, :3].T + pose[:3, 3]
    rows_of, columns_of, inside = camera.pixels(points)
    depth = np.full((camera.height, camera.width), np.inf, np.float32)
    np.minimum.at(depth, (rows_of[inside], columns_of[inside]), points[inside, 2])
    return np.where(np.isfinite(depth), depth, np.float32(0.0))
