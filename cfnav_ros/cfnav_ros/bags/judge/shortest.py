"""Length of the shortest way through a recorded map. Pure."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from cfnav_core.task.visibility import VISIBLE_DISTANCE_M
from cfnav_ros.bags.files.events import OccupancyMap
from cfnav_ros.lidar.estimate import SweptDisc

CELL_M = 0.05
"""Finer maps are looked at so coarsely: a quarter of the robot's radius, by which every obstacle
is grown first, so that none can be stepped over."""

MOST_CELLS = 1_000_000
"""2500 square metres. Dijkstra's graph over more would need gigabytes."""

NEAR_M = 0.3
"""A robot that stands nearer to an obstacle than its radius starts from the next free place this
near: odometry and map disagree by as much."""

STEPS = ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))
"""To 16 neighbours, counting those the other way: lengths are at most 3 % too long."""


def shortest_path(
    room: OccupancyMap,
    start: tuple[float, float],
    goal: tuple[float, float],
    radius: float = SweptDisc().radius,
) -> float:
    """How far a disc must drive to come near enough to see a goal.

    It is near enough within ``VISIBLE_DISTANCE_M``; what stands between, the map cannot tell of
    the camera. Cells that nobody has seen count as free.

    Args:
        room: the map.
        start: x, y in the map, metres.
        goal: the same.
        radius: of the disc, metres.

    Returns:
        Metres.

    Raises:
        ValueError: there is no such way; one sentence says why.
    """
    free, size = _free(room, radius)
    x = room.origin[0] + (np.arange(free.shape[1]) + 0.5) * size
    y = room.origin[1] + (np.arange(free.shape[0])[:, None] + 0.5) * size
    from_start = np.hypot(x - start[0], y - start[1])
    to_goal = np.hypot(x - goal[0], y - goal[1])
    if not free.any() or not from_start[free].min() <= NEAR_M:
        raise ValueError(
            f"the drive's start ({start[0]:.1f}, {start[1]:.1f}) is no free place of the map"
        )
    ends = free & (to_goal <= VISIBLE_DISTANCE_M)
    if not ends.any():
        raise ValueError(
            f"the map has no free place within {VISIBLE_DISTANCE_M:g} m of the goal at "
            f"({goal[0]:.1f}, {goal[1]:.1f})"
        )
    first = int(np.where(free, from_start, np.inf).argmin())
    lengths = dijkstra(_graph(free, size), directed=False, indices=first)
    length = float(lengths[ends.ravel()].min())
    if not math.isfinite(length):
        raise ValueError("the map has no way from the drive's start to the goal")
    return length


def _free(room: OccupancyMap, radius: float) -> tuple[np.ndarray, float]:
    """Where a disc's centre may be, bool [H, W], and the size of its cells, metres."""
    occupied, resolution = room.occupied, room.resolution
    if occupied.ndim != 2 or not occupied.size or not 0 < resolution < radius:
        raise ValueError(
            f"the map has cells of {resolution:g} m in the shape {occupied.shape}; expected "
            f"some, of less than the robot's radius of {radius:g} m"
        )
    every = max(round(CELL_M / resolution), 1)
    if occupied.size / every**2 > MOST_CELLS:
        raise ValueError(
            f"the map of {occupied.shape[1]} x {occupied.shape[0]} cells is too large to search; "
            f"expected at most {MOST_CELLS} of {CELL_M:g} m"
        )
    # Without an obstacle there is none to keep away from.
    away = distance_transform_edt(~occupied) if occupied.any() else np.full(occupied.shape, np.inf)
    middle = every // 2
    return (away * resolution > radius)[middle::every, middle::every], resolution * every


def _graph(free: np.ndarray, size: float) -> coo_array:
    """The ways between neighbouring free cells, metres: [H * W, H * W]."""
    number = np.arange(free.size).reshape(free.shape)
    rows, columns, lengths = [], [], []
    height, width = free.shape
    for down, right in STEPS:
        here = (slice(0, max(height - down, 0)), _columns(right, width))
        there = (slice(down, height), _columns(-right, width))
        both = free[here] & free[there]
        rows.append(number[here][both])
        columns.append(number[there][both])
        lengths.append(np.full(len(rows[-1]), math.hypot(down, right) * size))
    ends = (np.concatenate(rows), np.concatenate(columns))
    return coo_array((np.concatenate(lengths), ends), shape=(free.size, free.size)).tocsr()


def _columns(right: int, width: int) -> slice:
    """The columns that have another so far to the right."""
    return slice(max(-right, 0), max(width - max(right, 0), 0))
