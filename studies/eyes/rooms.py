"""Rendered rooms to be looked at: random views, and the box of everything in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cfnav_core.detect.errors import Thing
from cfnav_core.perception.boxes import Box
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.rooms import parse_rooms

if TYPE_CHECKING:
    from sim_bridge.room.room import Room
    from sim_bridge.world.camera import Camera, Rendering
    from sim_bridge.world.world import Pose


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
    for camera, poses, room in _looks(rooms, count, set_up):
        names = [thing.name for thing in room.objects]
        for pose in poses:
            yield room.name, camera.picture(pose), names


@dataclass(frozen=True)
class ThingsInView:
    """A view and the goals in it.

    Attributes:
        room: its name.
        rgb: uint8 [H, W, 3].
        things: with their true boxes.
    """

    room: str
    rgb: np.ndarray
    things: tuple[Thing, ...]


def things_of_rooms(
    rooms: Sequence[str], count: int, set_up: CameraSetUp
) -> Iterator[ThingsInView]:
    """The same views with the goals in them.

    Args:
        rooms, count, set_up: as for ``views_of_rooms``.

    Raises:
        ValueError: rooms that do not exist here.
    """
    from sim_bridge.world.things import Things

    for camera, poses, room in _looks(rooms, count, set_up):
        things = Things(camera)
        for pose in poses:
            picture = camera.picture(pose)
            yield ThingsInView(room.name, picture.rgb, tuple(things.seen(pose, picture.owner)))


def _looks(
    rooms: Sequence[str], count: int, set_up: CameraSetUp
) -> Iterator[tuple[Camera, list[Pose], Room]]:
    """A camera in each room, and random poses for it."""
    from sim_bridge.room.room import generate_room
    from sim_bridge.world.camera import Camera
    from sim_bridge.world.grid import state_grid
    from sim_bridge.world.world import World

    for kind, seed in parse_rooms(rooms):
        world = World(generate_room(kind, seed), set_up.on_mast)
        with Camera(world, set_up) as camera:
            grid = state_grid(world, set_up.horizons)
            rng = np.random.default_rng(seed)
            chosen = rng.choice(len(grid.next_state), count, replace=False)
            yield camera, [grid.pose(int(state)) for state in chosen], world.room


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
