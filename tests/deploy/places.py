"""Where the robot is put: the widest free place of a room, so that a step meets nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from sim_bridge.room import generate_room, parse_room
from sim_bridge.world import HULL_RADIUS, World

ROOM = "bedroom:16"
"""The built-in training room with the widest free place: a disc of 1.5 m radius."""

CELL_M = 0.05
ASTERN_M = 0.85
"""How far behind the centre of the free place a drive begins."""


@dataclass(frozen=True)
class FreePlace:
    """A disc of floor with nothing on it: centre and radius in metres."""

    x: float
    y: float
    radius: float

    def start(self, heading: int) -> tuple[float, float, float]:
        """A pose (m, m, rad) that looks across the disc along one of eight headings."""
        yaw = heading % 8 * math.pi / 4
        return self.x - ASTERN_M * math.cos(yaw), self.y - ASTERN_M * math.sin(yaw), yaw

    @property
    def reach(self) -> float:
        """Metres from the centre at which the hull still stands well inside the disc."""
        return self.radius - HULL_RADIUS - 0.15


def widest_place(room: str = ROOM) -> FreePlace:
    """Find the largest free disc of a room."""
    world = World(generate_room(*parse_room(room)))
    occupied = np.pad(world.occupancy(CELL_M) > 0, 1, constant_values=True)
    distance = distance_transform_edt(~occupied) * CELL_M
    row, column = np.unravel_index(distance.argmax(), distance.shape)
    return FreePlace((column - 0.5) * CELL_M, (row - 0.5) * CELL_M, float(distance.max()) - CELL_M)
