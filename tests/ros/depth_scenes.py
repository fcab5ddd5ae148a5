"""Depth pictures of simple places, as a depth camera at a height on the robot sends them."""

from __future__ import annotations

import math
from array import array
from types import SimpleNamespace

import numpy as np

from cfnav_core.task.pinhole import Pinhole

FRAME = "depth_optical_frame"
CAMERA = Pinhole(110.0, 110.0, 79.5, 49.5, 160, 100, FRAME)
"""72 by 49 degrees."""

ROOM = ((-5.0, -5.0, -5.0), (5.0, 5.0, 5.0))


def pose_at(x: float, z: float, down_deg: float = 0.0) -> np.ndarray:
    """float64 [4, 4] of an optical frame in base_link: x, z in metres, looking ahead and down."""
    down = math.radians(down_deg)
    ahead = (math.cos(down), 0.0, -math.sin(down))
    right = (0.0, -1.0, 0.0)
    below = np.cross(ahead, right)
    pose = np.eye(4)
    pose[:3, :3] = np.array([right, below, ahead]).T
    pose[:3, 3] = (x, 0.0, z)
    return pose


MAST_DOWN = pose_at(0.0, 1.3, 30.0)
STOCK = pose_at(-0.06, 0.244)


def quaternion(pose: np.ndarray) -> tuple[float, float, float, float]:
    """x, y, z, w of a pose whose right is the robot's right."""
    down = math.asin(-pose[2, 2])
    # optical axes, then tilted about their x
    q, tilt = np.array([-0.5, 0.5, -0.5, 0.5]), (-math.sin(down / 2), math.cos(down / 2))
    x, y, z, w = q
    s, c = tilt
    turned = (w * s + x * c, y * c + z * s, z * c - y * s, w * c - x * s)
    return tuple(float(value) for value in turned)


def depth_of(
    boxes: list[tuple[tuple[float, ...], tuple[float, ...]]],
    pose: np.ndarray,
    camera: Pinhole = CAMERA,
) -> np.ndarray:
    """Depth [H, W], metres, of boxes (low and high corner in base_link) above a floor at 0."""
    origin, ones = pose[:3, 3], np.ones((camera.height, camera.width), np.float32)
    rays = np.moveaxis(camera.placed(ones, pose), 0, -1) - origin
    with np.errstate(divide="ignore"):
        best = np.where(rays[..., 2] < 0, -origin[2] / rays[..., 2], np.inf)
        for low, high in boxes:
            a, b = (np.array(low) - origin) / rays, (np.array(high) - origin) / rays
            enters, leaves = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
            best = np.where((leaves > enters) & (enters > 0), np.minimum(best, enters), best)
    return np.where(best < 6.0, best, 0.0).astype(np.float32)


def picture(depth: np.ndarray, frame: str = FRAME) -> SimpleNamespace:
    """The fields of a sensor_msgs/Image in millimetres."""
    data = np.rint(depth * 1000).astype("<u2")
    return SimpleNamespace(
        height=depth.shape[0], width=depth.shape[1], encoding="16UC1", is_bigendian=0,
        step=2 * depth.shape[1], data=array("B", data.tobytes()),
        header=SimpleNamespace(frame_id=frame),
    )  # fmt: skip


def cloud(depth: np.ndarray, pose: np.ndarray, frame: str, kind: str = "<f4") -> SimpleNamespace:
    """The fields of a sensor_msgs/PointCloud2 of a depth picture, in the frame of a pose.

    Points have an intensity before their coordinates, those of a picture come in a single row.
    """
    points = CAMERA.placed(np.where(depth > 0, depth, np.nan).astype(np.float32), pose)
    points = points.reshape(3, -1).T.astype(kind)
    size = points.itemsize
    step = 4 + 3 * size
    data = np.zeros((len(points), step), np.uint8)
    data[:, 4:] = np.ascontiguousarray(points).view(np.uint8)
    number = {4: 7, 8: 8}[size]
    fields = [SimpleNamespace(name="intensity", offset=0, datatype=7, count=1)] + [
        SimpleNamespace(name=name, offset=4 + k * size, datatype=number, count=1)
        for k, name in enumerate("xyz")
    ]
    return SimpleNamespace(
        height=1, width=len(points), fields=fields, is_bigendian=int(kind[0] == ">"),
        point_step=step, row_step=step * len(points), data=array("B", data.tobytes()),
        header=SimpleNamespace(frame_id=frame),
    )  # fmt: skip


def table(edge_x: float, height: float = 0.75) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A table top 3 cm thick whose edge is this far ahead of base_link."""
    return (edge_x, -0.5, height - 0.03), (edge_x + 0.6, 0.5, height)
