"""What results were made of: those of other rooms, episodes or LiDAR do not count."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from cfnav_core.benchmark.jobs import Places
from cfnav_core.json_file import write_json
from cfnav_core.published.start_states import read_episodes
from cfnav_core.rooms import parse_room, parse_rooms, room_folder
from cfnav_core.scene import LIDAR, SCENE, SceneError

ROOMS = "rooms.json"

REMEDY = {
    SCENE: "make the rooms with python -m sim_bridge.dataset --out SCENES",
    LIDAR: "make it with python -m sim_bridge.scans SCENES, then python -m cfnav_ros.lidar_states "
    "SCENES",
}


def check_rooms(places: Places, splits: Iterable[str]) -> None:
    """Note in the grid's folder which rooms it trains in, or compare.

    Raises:
        ValueError: the grid was begun in other rooms.
        SceneError: a room is not there.
    """
    path = places.out / ROOMS
    noted = json.loads(path.read_text()) if path.exists() else {}
    for split in splits:
        rooms = parse_rooms([f"{split}:train", f"{split}:validation"])
        now = _digest(places.scenes, tuple(rooms), SCENE)
        if noted.setdefault(split, now) != now:
            raise ValueError(
                f"found rooms of {split} in {places.scenes} that are not those in which the runs "
                f"of {places.out} were trained; give another --out"
            )
    write_json(path, noted)


@cache
def made_of(scenes: Path, frozen: Path, lidar: bool) -> str:
    """Eight hex digits of what a test is made of: the episodes, their rooms, what the LiDAR says.

    Raises:
        SceneError: a room is not there, or what the LiDAR says in it.
    """
    rooms = tuple(sorted({parse_room(start.scene) for start in read_episodes(frozen)}))
    parts = [frozen.read_bytes().hex(), _digest(scenes, rooms, SCENE)]
    if lidar:
        parts.append(_digest(scenes, rooms, LIDAR))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:8]


def _digest(scenes: Path, rooms: tuple[tuple[str, int], ...], name: str) -> str:
    found = hashlib.sha256()
    for kind, seed in rooms:
        try:
            found.update((room_folder(scenes, kind, seed) / name).read_bytes())
        except OSError as error:
            raise SceneError(
                f"found no readable {name} of {kind}:{seed} in {scenes} ({error.strerror}); "
                f"{REMEDY[name]}"
            ) from error
    return found.hexdigest()
