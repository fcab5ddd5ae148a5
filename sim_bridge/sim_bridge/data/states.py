"""The states of a room, and what may be asked for there; not yet what is seen there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cfnav_core.scenes.scene import OfflineScene
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.visibility import MIN_GOAL_STATES
from cfnav_core.task.vocabulary import CATEGORIES
from sim_bridge.room.room import Room

if TYPE_CHECKING:
    from sim_bridge.world.grid import StateGrid
    from sim_bridge.world.world import World


def bare_scene(
    world: World, grid: StateGrid, camera: CameraSetUp, source: str, objects: Sequence[str],
    visible: np.ndarray,
) -> OfflineScene:  # fmt: skip
    """The scene of a room without features and detections.

    Args:
        world: of the room. grid: its states.
        camera: whose view.
        source: see ``room_source``.
        objects: names of C things that may be looked for.
        visible: bool [S, C].
    """
    states, often = len(grid.next_state), visible.sum(0) >= MIN_GOAL_STATES
    none = np.empty((states, 0), np.float16)
    return OfflineScene(
        name=world.room.name, room_type=world.room.room_type, perception="", camera=camera,
        source=source, objects=tuple(objects),
        goals=tuple(name for name, enough in zip(objects, often, strict=True) if enough),
        features=none, detections=none, fields=(),
        next_state=grid.next_state, collided=grid.collided, visible=visible,
        position=grid.position, heading=grid.heading, horizon=grid.horizon,
        positions=grid.positions,
        **_instances(world.room, grid.positions, objects),
    )  # fmt: skip


def sampled_visible(
    world: World, grid: StateGrid, camera: CameraSetUp, objects: Sequence[str], states: np.ndarray
) -> np.ndarray:
    """Which objects are visible in some states of a room: bool [N, C]."""
    from sim_bridge.world.camera import Camera  # few need MuJoCo

    with Camera(world, camera) as look:
        seen = [look.visible_categories(grid.pose(int(state))) for state in states]
    return _columns_of(objects, np.stack(seen))


def _columns_of(objects: Sequence[str], visible: np.ndarray) -> np.ndarray:
    """Columns of named objects, from bool [..., categories]; one that no room has is never seen."""
    out = np.zeros((*visible.shape[:-1], len(objects)), bool)
    for column, name in enumerate(objects):
        if name in CATEGORIES:
            out[..., column] = visible[..., CATEGORIES.index(name)]
    return out


def in_how_many(scene: OfflineScene) -> dict[str, int]:
    """In how many states each thing of a scene is visible."""
    states = scene.visible.sum(0)
    return {name: int(states[c]) for c, name in enumerate(scene.objects) if scene.instances[c]}


def _instances(room: Room, positions: np.ndarray, objects: Sequence[str]) -> dict[str, np.ndarray]:
    """How many of each object a room has, and how far the nearest is from each position."""
    instances = np.zeros(len(objects), np.int16)
    distance = np.full((len(positions), len(objects)), np.inf, np.float32)
    for thing in room.objects:
        if thing.name in objects:
            category = objects.index(thing.name)
            x0, y0, x1, y1 = thing.footprint
            away = np.hypot(*(positions - np.array([(x0 + x1) / 2, (y0 + y1) / 2])).T)
            distance[:, category] = np.minimum(distance[:, category], away)
            instances[category] += 1
    return {"instances": instances, "distance": distance}
