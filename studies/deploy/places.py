"""Where the robot is put: in the widest free place of a room, or before what bounds that place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from sim_bridge.room.room import generate_room, parse_room
from sim_bridge.world.world import HULL_RADIUS, LIDAR_X, Pose, World

ROOM = "bedroom:16"
"""The built-in training room with the widest free place: a disc of 1.5 m radius."""

CELL_M = 0.05
ASTERN_M = 0.85
"""How far behind the centre of the free place a drive begins."""

AHEAD_M = 0.40
"""Free way of the hull before a wall: one MoveAhead is allowed, a second one would touch."""

SEEN_M = 0.10
"""The laser must see the wall no further than this behind where the hull would touch it."""


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

    def towards(self, way: float, yaw: float) -> tuple[float, float]:
        """The point that lies ``way`` metres from the centre, in a direction in rad."""
        return self.x + way * math.cos(yaw), self.y + way * math.sin(yaw)

    @property
    def reach(self) -> float:
        """Metres from the centre at which the hull still stands well inside the disc."""
        return self.radius - HULL_RADIUS - 0.15


@dataclass(frozen=True)
class StartPlaces:
    """Where runs begin: in the open, or at poses (m, m, rad) with ``AHEAD_M`` before a wall."""

    open: FreePlace
    walls: tuple[tuple[float, float, float], ...]

    def before_wall(self, number: int) -> tuple[float, float, float]:
        """One of the poses before a wall, in turn."""
        return self.walls[number // 2 % len(self.walls)]


def find_places(room: str = ROOM) -> StartPlaces:
    """Find the widest place of a room, and what the laser sees around it that a drive would touch.

    Raises:
        ValueError: the room has no wall of this kind.
    """
    world = World(generate_room(*parse_room(room)))
    middle = widest_place(room)
    walls = []
    for yaw in (k * math.pi / 4 for k in range(8)):
        ways = np.arange(middle.reach, 6.0, 0.01)
        touched = next(w for w in ways if not world.free(*middle.towards(w, yaw)))
        x, y = middle.towards(touched - AHEAD_M, yaw)
        seen = float(world.scan(np.zeros(1), Pose(x, y, yaw))[0]) + LIDAR_X - HULL_RADIUS
        if abs(seen - AHEAD_M) < SEEN_M:
            walls.append((float(x), float(y), yaw))
    if not walls:
        raise ValueError(f"found no wall around the widest place of {room}; choose another room")
    return StartPlaces(middle, tuple(walls))


def widest_place(room: str = ROOM) -> FreePlace:
    """Find the largest free disc of a room."""
    world = World(generate_room(*parse_room(room)))
    occupied = np.pad(world.occupancy(CELL_M) > 0, 1, constant_values=True)
    distance = distance_transform_edt(~occupied) * CELL_M
    row, column = np.unravel_index(distance.argmax(), distance.shape)
    x, y = float((column - 0.5) * CELL_M), float((row - 0.5) * CELL_M)
    return FreePlace(x, y, float(distance.max()) - CELL_M)
