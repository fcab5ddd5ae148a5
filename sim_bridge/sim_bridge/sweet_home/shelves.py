"""Where things can stand inside a piece of furniture: its boards that are open to the front."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sim_bridge.sweet_home.bands import samples

CELL_M = 0.02
LEAST_M = 0.16
"""Width, and height, of the smallest place."""
BOARD = 0.3
"""Share of the footprint that a board has at least."""
OPEN = 0.35
"""Share of a place's front that may be covered."""


@dataclass(frozen=True)
class Shelf:
    """A place in a model's frame.

    Attributes:
        x: its middle, metres.
        width: along x, metres.
        z: height of its board, metres.
        clear: height that is free above that, metres.
    """

    x: float
    width: float
    z: float
    clear: float


def shelves(triangles: np.ndarray, size: tuple[float, float, float]) -> list[Shelf]:
    """Find them, lowest first.

    Args:
        triangles: float64 [T, 3, 3], corners in the model's frame, metres.
        size: width, depth and height, metres.
    """
    points = samples(triangles)
    found = []
    for z, above in pairwise([*_boards(triangles, size), size[2]]):
        clear = above - z - 0.03
        if clear < LEAST_M:
            continue
        slab = points[(points[:, 2] > z + 0.03) & (points[:, 2] < above - 0.04)]
        inner = slab[np.abs(slab[:, 1]) < 0.3 * size[1]]
        front = slab[slab[:, 1] > 0.3 * size[1]]
        for low, high in _gaps(inner[:, 0], size[0]):
            before = front[(front[:, 0] > low + 0.02) & (front[:, 0] < high - 0.02), 0]
            cells = len(np.unique((before / CELL_M).astype(int)))
            if high - low >= LEAST_M and cells * CELL_M < OPEN * (high - low):
                found.append(Shelf((low + high) / 2, high - low, z, clear))
    return found


def _boards(triangles: np.ndarray, size: tuple[float, float, float]) -> Iterator[float]:
    """Heights of large flat tops, metres."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1) / 2
    flat = np.abs(cross[:, 2]) > 1.9 * area
    bins = np.round(triangles[flat].mean(1)[:, 2] / 0.01).astype(int).clip(0)
    sums = np.bincount(bins, area[flat] * (cross[flat, 2] > 0), minlength=1)
    wide = np.convolve(sums, np.ones(3), "same") > BOARD * size[0] * size[1]
    for k in np.nonzero(wide)[0]:
        if k + 1 == len(wide) or not wide[k + 1]:
            top = k if sums[k] > 0 else k - 1
            if top * 0.01 < size[2] - LEAST_M:
                yield float(top) * 0.01


def _gaps(x: np.ndarray, width: float) -> Iterator[tuple[float, float]]:
    """Ranges of x where nothing is."""
    cells = int(width / CELL_M) + 1
    taken = np.zeros(cells + 2, bool)
    taken[[0, -1]] = True
    taken[((x + width / 2) / CELL_M).astype(int).clip(0, cells - 1) + 1] = True
    edges = np.nonzero(taken)[0]
    for before, after in pairwise(edges):
        if after - before > 1:
            yield before * CELL_M - width / 2, (after - 1) * CELL_M - width / 2
