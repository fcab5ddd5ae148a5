"""The LiDAR in every state: ``cfnav rooms scan SCENES --rooms data2:test``.

Writes ``scans.npy`` beside each scene that ``cfnav rooms make`` or ``boxes`` made: float32
[P, 8, 1080], metres, as the driver publishes a turn at each position and heading, with the
simulator's noise.
Rooms that this version of the simulator scanned are kept as they are.
``cfnav data lidar`` makes collision probabilities of them.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tqdm import tqdm

from cfnav_core.files.provenance import made_by, sign
from cfnav_core.files.whole import remove, whole, writing
from cfnav_core.scenes.scene import HEADINGS, LIDAR, SCANS, OfflineScene
from cfnav_core.task.rooms import parse_room, room_folder
from sim_bridge.data.asked import Furniture, Rooms, asked_for
from sim_bridge.robot.lidar_turn import standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels

SCANS_VERSION = 2
"""Rises when the same scene is scanned otherwise; a test holds it."""


@dataclass(frozen=True)
class ScanOptions:
    """Scan every state of rooms whose scenes were made.

    Without --rooms of data2:test.
    """

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of the scenes."""
    rooms: Rooms = field(default_factory=list)
    furniture: Furniture = "built_in"
    noise: float = 1.0
    """Scale of the LiDAR's noise."""

    def run_command(self) -> None:
        """Scan."""
        run(self)


def scans_of(scene: OfflineScene, noise: float) -> str:
    """What the scans of a scene are made of."""
    there = hashlib.sha256(scene.next_state.tobytes() + scene.positions.tobytes()).hexdigest()[:16]
    return f"scans {SCANS_VERSION} of {scene.source}, {there}, noise {noise}"


def turns(scene: OfflineScene, noise: float, most: int | None = None) -> np.ndarray:
    """Turns at every position and heading of a room.

    Args:
        scene: of it; its positions are scanned.
        noise: scale of the simulator's noise, drawn from the room's seed.
        most: the first so many only.

    Returns:
        float32 [8 P, 1080], metres, by position and heading; +inf for no return.

    Raises:
        ValueError: the scene is not of the room as it is made today.
    """
    from sim_bridge.world.grid import remade  # few need MuJoCo

    world, grid = remade(scene)
    _, seed = parse_room(scene.name)
    errors = Noise(NoiseLevels().scaled(noise), seed)
    # the LiDAR does not tilt with the camera
    level = range(0, scene.num_states, len(grid.horizons))[:most]
    return np.stack([standing_turn(world, errors, pose=grid.pose(state)) for state in level])


def run(options: ScanOptions) -> None:
    """Scan every room that was not scanned yet.

    Raises:
        ValueError: bad rooms, or scenes that are not there or made by another version.
        OSError: a file cannot be written.
    """
    rooms = asked_for(options.rooms or ["data2:test"], options.furniture)
    for kind, seed in tqdm(rooms, unit="room"):
        folder = room_folder(options.scenes, kind, seed)
        path = folder / SCANS
        scene = OfflineScene.load(folder)
        source = scans_of(scene, options.noise)
        if made_by(path) == source:
            continue
        made = turns(scene, options.noise)
        remove(folder / LIDAR)  # of the scans before
        with writing(path), whole(path) as partial, partial.open("wb") as file:
            np.save(file, made.reshape(-1, HEADINGS, made.shape[1]))
        sign(path, source)
