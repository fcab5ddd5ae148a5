"""``cfnav data restamp``: take over rooms whose heads name the source text that made them.

Until version 0.1 a scene said which source files had made it, as a hash of their text, and was made
again whenever one of them was put in order. Now it says the version of the rooms, and is taken over
as it is when it still is what that version makes: its arrays are whole, the room's grid is the
same array by array, and sampled states look the same. So are its scans and the LiDAR's estimates.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tqdm import tqdm

from cfnav_core.agent.config import Rooms
from cfnav_core.command import DONE, PARTLY
from cfnav_core.files.provenance import made_by, sign
from cfnav_core.scenes.scene import LIDAR, SCANS, OfflineScene, SceneError, changed_files
from cfnav_core.scenes.scene import read_head as read_scene_head
from cfnav_core.task.camera import MAST
from cfnav_core.task.rooms import parse_room, parse_rooms, room_folder, rooms_in, shift_of

SAMPLED = 24
"""States of a room that are drawn again, and turns of the LiDAR that are judged again."""

NOISE = re.compile(r" noise ([\d.]+)$")


@dataclass(frozen=True)
class RestampData:
    """Take over rooms that an earlier version made, where they are what this one makes.

    A room that is not is named and left as it is; exit code 1 when there is one.
    """

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of built-in scenes."""
    rooms: Rooms = ()
    """TYPE:SEED, TYPE:FIRST-LAST or a split, given as often as needed; all when absent."""

    def run_command(self) -> int:
        """Restamp and print what was not taken over.

        Raises:
            SceneError: the folder has no rooms.
        """
        rooms = parse_rooms(self.rooms) if self.rooms else rooms_in(self.scenes)
        if not rooms:
            raise SceneError(f"found no rooms in {self.scenes}; name a folder of built-in scenes")
        others = 0
        for kind, seed in tqdm(rooms, unit="room"):
            if other := restamp(room_folder(self.scenes, kind, seed)):
                others += 1
                tqdm.write(f"{kind}:{seed} is left as it is: {other}")
        print(f"{len(rooms) - others} of {len(rooms)} rooms in {self.scenes} taken over")
        return PARTLY if others else DONE


def restamp(folder: Path) -> str:
    """Restamp one room; returns what is other than this version makes it, "" when nothing is.

    Raises:
        SceneError: the scene cannot be read.
    """
    # few need MuJoCo and a GL library
    from sim_bridge.data.states import sampled_visible
    from sim_bridge.room.room import generate_room, room_source
    from sim_bridge.world.grid import state_grid
    from sim_bridge.world.world import World

    head = read_scene_head(folder)
    if changed := changed_files(folder, head["sha256"]):
        return f"damaged: {', '.join(changed)}"
    scene = OfflineScene.load(folder)
    camera = scene.camera or MAST
    world = World(generate_room(*parse_room(scene.name)), camera.on_mast)
    grid = state_grid(world, camera.horizons)
    for name in ("next_state", "collided", "positions", "position", "heading", "horizon"):
        if not np.array_equal(getattr(scene, name), getattr(grid, name)):
            return f"another room: {name} differ"
    states = np.linspace(0, scene.num_states - 1, SAMPLED).astype(int)
    if not np.array_equal(
        scene.visible[states], sampled_visible(world, grid, camera, scene.objects, states)
    ):
        return "another room: other objects are visible"
    source = room_source(parse_room(scene.name)[0], shift_of(scene.source))
    replace(scene, source=source, camera=camera).write_head(folder, head["sha256"])
    return _restamp_scans(folder, replace(scene, source=source))


def _restamp_scans(folder: Path, scene: OfflineScene) -> str:
    from cfnav_ros.lidar.states import estimates_of, probabilities
    from sim_bridge.data.scans import scans_of, turns

    path, judged = folder / SCANS, folder / LIDAR
    noted = NOISE.search(made_by(path))
    if not path.exists():
        return ""
    if noted is None:
        return f"{SCANS} says not with which noise it was made"
    noise, kept = float(noted[1]), np.load(path, mmap_mode="r")
    again = turns(scene, noise, most=SAMPLED)
    if not np.array_equal(kept.reshape(-1, kept.shape[-1])[: len(again)], again):
        return f"{SCANS} holds other turns; make them again with cfnav rooms scan"
    sign(path, scans_of(scene, noise))
    if not judged.exists():
        return ""
    each = scene.num_states // (kept.shape[0] * kept.shape[1])
    if not np.array_equal(np.load(judged)[::each][: len(again)], probabilities(again)):
        return f"{LIDAR} holds other estimates"
    sign(judged, estimates_of(path))
    return ""
