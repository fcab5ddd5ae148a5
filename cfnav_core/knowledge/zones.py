"""Zone graphs of rooms: views that show the same objects, and which of them lie side by side.

Source: HOZ (Zhang et al. 2021) and its public code. Two departures: a zone that no view fell to is
drawn again from the views (there, uniform numbers, which few views are ever nearest to), and a
zone that stays without views is left out of the mean over rooms (there, a division by zero).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

ZONES = 8
ITERATIONS = 300
NEIGHBOUR_M = 0.5
"""Largest L1 distance of neighbouring views, metres."""


@dataclass(frozen=True)
class ZoneGraph:
    """Zones of one room, or of a room type.

    Attributes:
        nodes: float64 [Z, C], share of a zone's views that show each object.
        edges: float64 [Z, Z], share of neighbours among the pairs of views, diagonal 1.
        views: int64 [Z], how many views each zone has.
    """

    nodes: np.ndarray
    edges: np.ndarray
    views: np.ndarray


def zone_distance(seen: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """||a - c|| + 1 / (a c + 0.1) between views [S, C] and centres [Z, C], float64 [S, Z]."""
    common = seen @ centres.T
    square = (seen**2).sum(1)[:, None] + (centres**2).sum(1) - 2 * common
    return np.sqrt(square.clip(0)) + 1 / (common + 0.1)


def k_means(seen: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The zone of every view, int64 [S], from what each shows, bool [S, C]."""
    views = np.asarray(seen, np.float64)
    centres = rng.random((ZONES, views.shape[1]))
    for _ in range(ITERATIONS):
        zone = zone_distance(views, centres).argmin(1)
        count = np.bincount(zone, minlength=ZONES)
        member = zone == np.arange(ZONES)[:, None]
        means = member @ views / count.clip(1)[:, None]
        drawn = views[rng.integers(len(views), size=ZONES)]
        before, centres = centres, np.where(count[:, None] > 0, means, drawn)
        if (centres == before).all():
            break
    return zone


def zone_graph(
    seen: np.ndarray, position: np.ndarray, positions: np.ndarray, rng: np.random.Generator
) -> ZoneGraph:
    """Divide a room's views into zones.

    Args:
        seen: bool [S, C], the view shows the object.
        position: int32 [S], row of ``positions``.
        positions: float32 [P, 2], metres.
        rng: draws the first centres.
    """
    zone = k_means(seen, rng)
    at = np.zeros((len(positions), ZONES))
    np.add.at(at, (position, zone), 1)
    views = at.sum(0).astype(np.int64)
    nodes = (zone == np.arange(ZONES)[:, None]) @ np.asarray(seen, np.float64)
    # rounding must not part views that are half a metre apart
    near = cdist(positions, positions, "cityblock") <= NEIGHBOUR_M + 1e-3
    some = views.clip(1)
    edges = at.T @ near @ at / some[:, None] / some
    np.fill_diagonal(edges, 1)
    return ZoneGraph(nodes / some[:, None], edges, views)


def merge(rooms: Sequence[ZoneGraph], objects: int) -> ZoneGraph:
    """The graph of a room type: zones matched from each room to the next, and averaged.

    Args:
        rooms: graphs of its training rooms, in order; without any, no zone shows anything.
        objects: C.
    """
    if not rooms:
        nothing = np.zeros((ZONES, objects))
        return ZoneGraph(nothing, np.eye(ZONES), np.zeros(ZONES, np.int64))
    order = [np.arange(ZONES)]
    for room, following in pairwise(rooms):
        weight = 1 / zone_distance(room.nodes, following.nodes)
        _, partner = linear_sum_assignment(weight, maximize=True)
        order.append(partner[order[-1]])
    views = np.stack([g.views[o] for g, o in zip(rooms, order, strict=True)])
    there = (views > 0).astype(float)
    nodes = np.stack([g.nodes[o] for g, o in zip(rooms, order, strict=True)])
    edges = np.stack([g.edges[np.ix_(o, o)] for g, o in zip(rooms, order, strict=True)])
    both = there[:, :, None] * there[:, None]
    nodes = (nodes * there[:, :, None]).sum(0) / there.sum(0).clip(1)[:, None]
    edges = (edges * both).sum(0) / both.sum(0).clip(1)
    np.fill_diagonal(edges, 1)
    return ZoneGraph(nodes, edges, views.sum(0))
