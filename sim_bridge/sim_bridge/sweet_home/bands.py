"""What a robot touches of a model: boxes in bands of height, from dense samples of its surface.

The robot is a cylinder from the floor to 0.351 m and a thin mast above it, so all that matters is
where something is within each of those heights, and in the thin band that the LiDAR sees. Each band
is a plan of 2 cm cells: what is wholly enclosed is filled, as a sofa's skin is no place to stand,
and neighbouring cells become one box, which ends where the samples in it end.

The hull fits wherever it does by these boxes; by the surface itself on up to 0.04 of a footprint
more (see ``tests/sim/sweet_home/test_bands.py``). A piece has some 20 to 160 boxes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

BANDS = ((0.01, 0.183), (0.183, 0.203), (0.203, 0.351), (0.351, 1.33))
"""Bottom and top above the floor, metres: hull below the LiDAR's plane, the plane, hull, mast."""
PLANE = 1
"""Index of the LiDAR's band: its boxes fill it, so that the plane cuts them."""
CELL_M = 0.02
HANGING_M = 0.2
"""What begins that far above the bottom of its band shares no box with what does not: a table's top
with its legs."""
SMALL_M = 0.3
"""What is nowhere wider gets one box a band."""
SAMPLES_A_CELL = 8
MOST_SAMPLES = 400_000
THINNEST_M = 0.001
"""Half the least thickness of a box."""
SEED = 0


@dataclass(frozen=True)
class Box:
    """A box with its sides along the model's axes: centre and half extents, metres."""

    centre: tuple[float, float, float]
    half: tuple[float, float, float]


def samples(triangles: np.ndarray) -> np.ndarray:
    """Points spread over a surface, always the same for the same surface.

    Args:
        triangles: float64 [T, 3, 3], corners, metres.

    Returns:
        float64 [N, 3], metres: ``SAMPLES_A_CELL`` for each cell's worth of surface, at most
        ``MOST_SAMPLES``.
    """
    rng = np.random.default_rng(SEED)
    a, b, c = np.moveaxis(triangles, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).cumsum() / 2
    count = int(min(max(area[-1] / CELL_M**2 * SAMPLES_A_CELL, 1000), MOST_SAMPLES))
    at = np.searchsorted(area, (np.arange(count) + rng.random(count)) / count * area[-1])
    at = np.minimum(at, len(area) - 1)
    u, v = rng.random((2, count, 1))
    inside = u + v <= 1
    u, v = np.where(inside, u, 1 - u), np.where(inside, v, 1 - v)
    return a[at] + u * (b - a)[at] + v * (c - a)[at]


def boxes(triangles: np.ndarray, z: float = 0.0) -> list[Box]:
    """The boxes of a model.

    Args:
        triangles: float64 [T, 3, 3], corners in the model's frame, metres.
        z: height of the model's bottom above the floor, metres; above the mast it has none.

    Returns:
        Boxes in the model's frame.
    """
    if z >= BANDS[-1][1]:
        return []
    points, found = samples(triangles), []
    small = np.ptp(points[:, :2], axis=0).max() < SMALL_M
    for i, (low, high) in enumerate(BANDS):
        within = points[(points[:, 2] + z > low) & (points[:, 2] + z < high)]
        if not len(within):
            continue
        ends = [(within.min(0), within.max(0))] if small else _plan(within, low - z)
        for bottom, top in ends:
            if i == PLANE:
                bottom[2], top[2] = low - z, high - z
            x, y, up = ((bottom + top) / 2).tolist()
            p, q, r = np.maximum((top - bottom) / 2, THINNEST_M).tolist()
            found.append(Box((x, y, up), (p, q, r)))
    return found


def _plan(points: np.ndarray, floor: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Lowest and highest corners, float64 [3], of the boxes of a band that begins at ``floor``."""
    # surfaces of round sizes would lie between cells, in one or the other
    start = points[:, :2].min(0) - 0.37 * CELL_M
    cells = ((points[:, :2] - start) / CELL_M).astype(int)
    shape = tuple(cells.max(0) + 1)
    low, high = np.full((*shape, 3), np.inf), np.full((*shape, 3), -np.inf)
    np.minimum.at(low, tuple(cells.T), points)
    np.maximum.at(high, tuple(cells.T), points)
    taken = np.isfinite(low[..., 0])
    filled = ndimage.binary_fill_holes(taken) & ~taken
    corner = start + np.moveaxis(np.indices(shape), 0, -1) * CELL_M
    low[filled, :2], high[filled, :2] = corner[filled], corner[filled] + CELL_M
    low[filled, 2], high[filled, 2] = points[:, 2].min(), points[:, 2].max()
    # what hangs inside a ring of what does not is the top of something hollow
    standing = ndimage.binary_fill_holes(low[..., 2] <= floor + HANGING_M)
    kinds = np.where(standing, 0, np.where(taken | filled, 1, -1))
    for rows, columns in rectangles(kinds):
        yield low[rows, columns].min((0, 1)), high[rows, columns].max((0, 1))


def rectangles(kinds: np.ndarray) -> Iterator[tuple[slice, slice]]:
    """Cover cells of like kind with rectangles that do not overlap.

    Args:
        kinds: int [H, W], -1 where nothing is.

    Yields:
        Rows and columns of each; every one as large as it gets along either axis first.
    """
    left = kinds.copy()
    for i, j in np.argwhere(kinds >= 0):
        if left[i, j] < 0:
            continue
        same = left[i:, j:] == left[i, j]
        wide = _run(same[0])
        flat = _run(same[:, :wide].all(1)), wide
        tall = _run(same[:, 0])
        upright = tall, _run(same[:tall].all(0))
        height, width = max(flat, upright, key=lambda size: size[0] * size[1])
        left[i : i + height, j : j + width] = -1
        yield slice(i, i + height), slice(j, j + width)


def _run(same: np.ndarray) -> int:
    """How many of the first are true."""
    return len(same) if same.all() else int(same.argmin())
