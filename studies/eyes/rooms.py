"""Rendered rooms to be looked at: random views, and the box of everything in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cfnav_core.perception.boxes import Box
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.rooms import parse_rooms

if TYPE_CHECKING:
    from sim_bridge.world.camera import Rendering


def views_of_rooms(
    rooms: Sequence[str], count: int, set_up: CameraSetUp = MAST
) -> Iterator[tuple[str, Rendering, list[str]]]:
    """Random views of rooms: the room's name, what the camera sees, and the names of its things.

    Args:
        rooms: TYPE:SEED or TYPE:FIRST-LAST.
        count: views of each.
        set_up: the camera.

    Raises:
        ValueError: rooms that do not exist here.
    """
    from sim_bridge.room.room import generate_room
    from sim_bridge.world.camera import Camera
    from sim_bridge.world.grid import state_grid
    from sim_bridge.world.world import World

    for kind, seed in parse_rooms(rooms):
        world = World(generate_room(kind, seed), set_up.on_mast)
        names = [thing.name for thing in world.room.objects]
        with Camera(world, set_up) as camera:
            grid = state_grid(world, set_up.horizons)
            rng = np.random.default_rng(seed)
            for state in rng.choice(len(grid.next_state), count, replace=False):
                yield f"{kind}:{seed}", camera.picture(grid.pose(int(state))), names


def boxes_of(owner: np.ndarray, names: Sequence[str]) -> Iterator[tuple[str, Box, int]]:
    """Name, box and number of pixels of each thing that is seen.

    Args:
        owner: int [H, W], index into ``names`` of what is seen there, -1 for none.
        names: of things.
    """
    for k, name in enumerate(names):
        rows, columns = np.nonzero(owner == k)
        if len(rows):
            left, right = float(columns.min()), float(columns.max() + 1)
            yield name, (left, float(rows.min()), right, float(rows.max() + 1)), len(rows)
