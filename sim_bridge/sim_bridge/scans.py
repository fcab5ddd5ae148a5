"""What the LiDAR measures in every state: ``python -m sim_bridge.scans SCENES --rooms data2:test``.

Writes ``scans.npy`` beside each scene that ``sim_bridge.dataset`` made: float32 [P, 8, 1080],
metres, as the driver publishes a turn at each position and heading, with the simulator's noise.
Rooms that this version of the simulator scanned are kept as they are.
``python -m cfnav_ros.lidar_states`` makes collision probabilities of them.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tqdm import tqdm

from cfnav_core.rooms import parse_rooms, room_folder
from cfnav_core.scene import HEADINGS, HORIZONS, SCANS, OfflineScene
from cfnav_core.source import made_by, sign, source_identity
from cfnav_core.whole import whole, writing
from sim_bridge.dataset import room_source
from sim_bridge.noise import Noise, NoiseLevels
from sim_bridge.room import generate_room
from sim_bridge.rplidar import driver_ranges

SCAN_FILES = ("rplidar", "noise", "scans")
"""Modules that decide what the LiDAR measures in a room."""


@dataclass(frozen=True)
class Options:
    """Scan every state of rooms that were rendered."""

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of the scenes."""
    rooms: Annotated[list[str], tyro.conf.UseAppendAction] = field(default_factory=list)
    """TYPE:SEED, TYPE:FIRST-LAST or a split, given as often as needed; data2:test when absent."""
    noise: float = 1.0
    """Scale of the LiDAR's noise."""


def scan_room(kind: str, seed: int, scene: OfflineScene, noise: float) -> np.ndarray:
    """Turns at every position and heading of a room.

    Args:
        kind, seed: of the room.
        scene: of it; its positions are scanned.
        noise: scale of the simulator's noise, drawn from the room's seed.

    Returns:
        float32 [P, 8, 1080], metres, +inf for no return.

    Raises:
        ValueError: the scene is not of the room as it is made today.
    """
    # few need MuJoCo
    from sim_bridge.grid import state_grid
    from sim_bridge.world import World

    world = World(generate_room(kind, seed))
    grid = state_grid(world)
    if not np.array_equal(grid.next_state, scene.next_state):
        raise ValueError(
            f"found a scene of {scene.name} made by another version; make it again with "
            f"python -m sim_bridge.dataset --rooms {scene.name}"
        )
    errors = Noise(NoiseLevels().scaled(noise), seed)
    level = range(0, scene.num_states, HORIZONS)  # the LiDAR does not tilt with the camera
    turns = [driver_ranges(errors.scan(world.scan(grid.pose(state)))) for state in level]
    return np.stack(turns).reshape(-1, HEADINGS, len(turns[0]))


def run(options: Options) -> None:
    """Scan every room that was not scanned yet.

    Raises:
        ValueError: bad rooms, or scenes that are not there or made by another version.
        OSError: a file cannot be written.
    """
    scanner = source_identity(Path(__file__).parent / f"{name}.py" for name in SCAN_FILES)
    source = f"{room_source()} {scanner} noise {options.noise}"
    for kind, seed in tqdm(parse_rooms(options.rooms or ["data2:test"]), unit="room"):
        folder = room_folder(options.scenes, kind, seed)
        path = folder / SCANS
        if made_by(path) == source:
            continue
        turns = scan_room(kind, seed, OfflineScene.load(folder), options.noise)
        with writing(path), whole(path) as partial, partial.open("wb") as file:
            np.save(file, turns)
        sign(path, source)


def main() -> None:
    """Entry point: exit 2 with one sentence on bad input."""
    try:
        run(tyro.cli(Options))
    except (ValueError, ImportError, OSError) as error:
        print(f"scans: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
