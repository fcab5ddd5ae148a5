"""What depth pictures have shown in the height of the robot's body, kept while it may count. Pure.

A camera sees little of what the body sweeps next: a table top is before a mast's camera at 1.2 m
and below its picture at 0.3 m. So what was seen is kept in the frame of the odometry, in cells,
until the robot has driven on, time has passed, or a picture shows that nothing is there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfnav_core.robot.settings import setting
from cfnav_core.task.pinhole import Pinhole

CELL_M = 0.02
"""Side of a cell; its points count as one at their mean."""

LEAST_PIXELS, LEAST_M2 = 3, 1e-4
"""What covers fewer pixels, or less of a plane across the view, in a cell is rather a mismatch than
a thing: half a cell's side high at its whole width is twice as much."""

LEAST_PICTURES = 2
"""Pictures in a row that must have shown something in a cell or beside it: mismatches come and go.
"""

EDGE_ROWS, LEVEL = 4, 0.5
"""Over so many rows at the lower edge of a picture a surface that rises by less than this share of
its way is level, such as a table top; steeper ones go on downwards, not towards the robot."""

SURE = 3.0
"""Standard deviations that errors stay within."""

_SIDE = 1 << 20
_BESIDE = [dx * _SIDE + dy for dx in (-1, 0, 1) for dy in (-1, 0, 1)]

_CELLS = np.dtype([
    ("key", "i8"), ("layer", "i1"), ("at", "f8", 3), ("error", "f8"), ("stamp", "f8"),
    ("way", "f8"), ("pictures", "i4"), ("cut", "?"),
])  # fmt: skip


@dataclass(frozen=True)
class DepthParameters:
    """Parameters ``depth.*`` of the LiDAR node: the body over ``base_frame``, and what is believed.

    Sources: heights and mast are the robot's file; ``error`` is 0.2 px of disparity (below 2 % at
    4 m, as Luxonis states for the OAK-D Pro) at 441 px focal length (640 columns) over a baseline
    of 75 mm; ``lowest`` leaves out the floor as a camera sees it that is tilted by half a degree.
    In ``memory_m`` and ``memory_s`` odometry errs by 2 cm and gyroscopes by half a degree.
    """

    stale: float = setting(1.0, "age of a picture that shows nothing any more, s", 0.05, 10.0)
    height: float = setting(0.351, "top of the hull, m", 0.01, 3.0)
    mast_height: float = setting(1.3, "top of the mast, m; below the hull's: none", 0.0, 3.0)
    mast_radius: float = setting(0.03, "of the mast at the middle of the hull, m", 0.0, 1.0)
    lowest: float = setting(0.06, "what ends below this is floor, m", 0.0, 1.0)
    reach: float = setting(2.0, "what is further away is not kept, m", 0.3, 10.0)
    error: float = setting(0.006, "error at 1 m, m; it grows with the square", 0.0001, 0.1)
    drift: float = setting(0.015, "error of the odometry, share of the way", 0.0, 0.2)
    memory_s: float = setting(30.0, "how long what was seen counts, s", 0.0, 600.0)
    memory_m: float = setting(1.5, "how far the robot drives meanwhile, m", 0.0, 10.0)


@dataclass(frozen=True)
class Place:
    """Where the robot is by its odometry: s, m, m, rad, and metres driven so far."""

    stamp: float
    x: float
    y: float
    yaw: float
    way: float = 0.0

    def out(self, points: np.ndarray) -> np.ndarray:
        """Points [N, 3] of the robot's frame in that of the odometry."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y, height = points.T
        return np.array([c * x - s * y + self.x, s * x + c * y + self.y, height]).T

    def back(self, points: np.ndarray) -> np.ndarray:
        """Points [N, 3] of the odometry's frame in that of the robot."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y, height = points.T
        x, y = x - self.x, y - self.y
        return np.array([c * x + s * y, c * y - s * x, height]).T


@dataclass(frozen=True)
class Standing:
    """What stands in the height of a part of the body.

    Attributes:
        points: float64 [N, 3], metres in the robot's frame.
        error: float64 [N], metres, one sigma of each.
        cut: bool [N], where the lower edge of the picture cuts a level surface off, which goes on
            towards the robot.
    """

    points: np.ndarray
    error: np.ndarray
    cut: np.ndarray


@dataclass(frozen=True)
class Cylinder:
    """A part of the body around the middle of ``base_frame``: metres."""

    radius: float
    bottom: float
    top: float


def body(parameters: DepthParameters, radius: float) -> tuple[Cylinder, ...]:
    """Hull and mast; a mast that does not rise over the hull is none."""
    p = parameters
    hull = Cylinder(radius, p.lowest, p.height)
    mast = Cylinder(p.mast_radius, p.height, p.mast_height)
    return (hull, mast) if mast.top > mast.bottom else (hull,)


class DepthMemory:
    """Cells in which something stands, by part of the body.

    Args:
        parts: of the body.
        parameters: see there.
    """

    def __init__(self, parts: tuple[Cylinder, ...], parameters: DepthParameters) -> None:
        self._parts, self._parameters = parts, parameters
        self.forget()

    def forget(self) -> None:
        """Know of nothing any more."""
        self._cells = np.zeros(0, _CELLS)

    def see(self, depth: np.ndarray, camera: Pinhole, pose: np.ndarray, place: Place) -> None:
        """Take one picture.

        What it shows again replaces what is kept there, and what it sees through is forgotten; what
        is beside the picture, in its holes or behind something stays.

        Args:
            depth: float32 [H, W], metres along the axis, 0 where nothing was measured.
            camera: that took it.
            pose: float64 [4, 4], of the camera in the robot's frame.
            place: of the robot then.
        """
        new = self._shown(depth, camera, pose, place)
        old = self._cells[self._counts(place)]
        again = np.zeros(len(old), bool)
        for step in _BESIDE:
            at = np.searchsorted(new["key"], old["key"] + step)
            hit = at < len(new)
            hit[hit] = new["key"][at[hit]] == (old["key"] + step)[hit]
            np.maximum.at(new["pictures"], at[hit], old["pictures"][hit] + 1)
            if step == 0:  # what was seen whole before is known, wherever the picture ends now
                np.logical_and.at(new["cut"], at[hit], old["cut"][hit])
            again |= hit
        points = (place.back(old["at"]) - pose[:3, 3]) @ pose[:3, :3]
        row, column, inside = camera.pixels(points)
        measured = depth[row, column]
        beyond = points[:, 2] + SURE * self._parameters.error * measured**2 + CELL_M
        replaced = inside & (measured > 0) & (again | (measured > beyond))
        replaced |= (old["pictures"] < LEAST_PICTURES) & ~again
        self._cells = np.concatenate((old[~replaced], new))

    def stands(self, place: Place) -> list[Standing]:
        """What stands in the height of each part of the body, for the robot's place now."""
        sure = self._counts(place) & (self._cells["pictures"] >= LEAST_PICTURES)
        cells = self._cells[sure]
        points = place.back(cells["at"])
        drift = self._parameters.drift * (place.way - cells["way"])
        error = np.hypot(cells["error"], drift)
        layers = [cells["layer"] == k for k in range(len(self._parts))]
        return [Standing(points[of], error[of], cells["cut"][of]) for of in layers]

    def _counts(self, place: Place) -> np.ndarray:
        """Which cells are neither too old nor too far back: bool [N]."""
        p, cells = self._parameters, self._cells
        young = place.stamp - cells["stamp"] <= p.memory_s
        return young & (place.way - cells["way"] <= p.memory_m)

    def _shown(
        self, depth: np.ndarray, camera: Pinhole, pose: np.ndarray, place: Place
    ) -> np.ndarray:
        """Cells of one picture, in the order of their keys."""
        x, y, height = camera.placed(depth, pose)
        away = np.hypot(x, y)
        body = (height > self._parts[0].bottom) & (height <= self._parts[-1].top)
        near = body & (depth > 0) & (away <= self._parameters.reach)
        cut = _cut_off(depth, height, away)[near]
        x, y, height, away, depth = (of[near] for of in (x, y, height, away, depth))
        error = np.float32(self._parameters.error) * depth**2
        area = depth**2 / np.float32(camera.fx * camera.fy)
        # by so much an error of the depth lifts a point
        lift = np.float32(SURE) * error * np.abs(height - np.float32(pose[2, 3])) / depth
        layer = np.full(len(x), -1)
        for k, part in enumerate(self._parts):
            inside = (height > part.bottom) & (height <= part.top)
            layer[inside & (away > part.radius)] = k  # nearer is the robot itself
        layer[height <= self._parts[0].bottom + lift] = -1
        sure = layer >= 0
        layer, error, area, cut = layer[sure], error[sure], area[sure], cut[sure]
        points = place.out(np.stack([of[sure] for of in (x, y, height)], axis=1))
        column, row = (np.floor(points[:, k] / CELL_M).astype(np.int64) for k in (0, 1))
        key = (layer * _SIDE + column + _SIDE // 2) * _SIDE + row + _SIDE // 2
        keys, cell, pixels = np.unique(key, return_inverse=True, return_counts=True)
        found = np.zeros(len(keys), _CELLS)
        found["key"], found["layer"] = keys, keys // _SIDE**2
        for k in range(3):
            found["at"][:, k] = np.bincount(cell, points[:, k], len(keys)) / pixels
        found["error"] = np.bincount(cell, error, len(keys)) / pixels
        found["stamp"], found["way"], found["pictures"] = place.stamp, place.way, 1
        found["cut"] = np.bincount(cell, cut, len(keys)) > 0
        covered = np.bincount(cell, area, len(keys))
        return found[(pixels >= LEAST_PIXELS) & (covered >= LEAST_M2)]


def _cut_off(depth: np.ndarray, height: np.ndarray, away: np.ndarray) -> np.ndarray:
    """Pixels at the lower edge of a picture whose surface goes on level below it: bool [H, W]."""
    cut = np.zeros(depth.shape, bool)
    if len(depth) <= EDGE_ROWS:
        return cut
    last, before = -1, -1 - EDGE_ROWS
    nearer, lower = away[before] - away[last], np.abs(height[before] - height[last])
    level = (depth[last] > 0) & (depth[before] > 0) & (nearer > 0) & (lower < LEVEL * nearer)
    cut[before + 1 :] = level
    return cut
