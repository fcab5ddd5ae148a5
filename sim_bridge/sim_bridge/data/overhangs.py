"""Overhangs that no LiDAR sees: ``cfnav rooms overhangs --rooms kitchen:20``.

The LiDAR scans one plane near the floor. Table tops, open drawers and seats reach over it and stop
the mast all the same. This counts, over every grid position and heading, the blocked MoveAheads
that would be free if only the parts that cross the plane stood in the room.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from tqdm import tqdm

from cfnav_core.scenes.scene import HEADINGS
from cfnav_core.task.actions import STEP_M, Action
from sim_bridge.data.asked import Furniture, Rooms, asked_for
from sim_bridge.room.room import Room, generate_room
from sim_bridge.world.grid import DIRECTIONS, state_grid
from sim_bridge.world.world import World, crosses_plane


@dataclass(frozen=True)
class OverhangOptions:
    """Count the collisions that no scan of the LiDAR's plane can foresee."""

    rooms: Rooms = field(default_factory=list)
    furniture: Furniture = "built_in"

    def run_command(self) -> None:
        """Count and print.

        Raises:
            ValueError: there are no such rooms.
        """
        rooms = asked_for(self.rooms, self.furniture)
        moves, unseen, with_some = (Counter[str]() for _ in range(3))
        for kind, seed in tqdm(rooms, unit="room", mininterval=2.0):
            found = blocked_moves(generate_room(kind, seed))
            for key in (kind, "all"):
                moves[key] += found.moves
                unseen[key] += found.unseen
                with_some[key] += found.unseen > 0
        for key in moves:
            count = len(rooms) if key == "all" else sum(kind == key for kind, _ in rooms)
            print(
                f"{key}: {Action.MoveAhead.name} blocked at {moves[key]} places and headings, "
                f"{unseen[key] / moves[key]:.1%} unseen by the LiDAR; {with_some[key]} of {count} "
                "rooms have such places"
            )


@dataclass(frozen=True)
class Blocked:
    """Blocked MoveAheads of one room, and how many of them the LiDAR's plane does not show."""

    moves: int
    unseen: int


def blocked_moves(room: Room) -> Blocked:
    """Count over all reachable positions and headings of the grid."""
    grid = state_grid(World(room))
    seen = World(replace(room, parts=tuple(filter(crosses_plane, room.parts))))
    moves = list(_blocked(grid.positions, grid.collided))
    return Blocked(len(moves), sum(seen.sweep_free(*move) for move in moves))


def _blocked(
    positions: np.ndarray, collided: np.ndarray
) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Yield start and end (m) of every MoveAhead that collides; tilts do not count twice."""
    level = collided.reshape(len(positions), HEADINGS, -1)[:, :, 0]
    for k, heading in zip(*np.nonzero(level), strict=True):
        start = positions[k].astype(float)
        end = start + np.array(DIRECTIONS[heading]) * STEP_M
        yield (float(start[0]), float(start[1])), (float(end[0]), float(end[1]))
