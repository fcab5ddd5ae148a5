"""What results were made of: those of other rooms, episodes or LiDAR do not count."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from cfnav_core.benchmark.jobs import Places
from cfnav_core.json_file import write_json
from cfnav_core.published.start_states import read_episodes
from cfnav_core.rooms import parse_room, parse_rooms, room_folder
from cfnav_core.scene import LIDAR, SceneError, read_head

ROOMS = "rooms.json"

LAST_BITS = ("features", "detections")
"""Arrays of a scene whose last bits are the machine's: the same perception made them."""


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
        now = _digest(places.scenes, tuple(rooms), _scene)
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
    parts = [frozen.read_bytes().hex(), _digest(scenes, rooms, _scene)]
    if lidar:
        parts.append(_digest(scenes, rooms, _lidar))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:8]


def _digest(
    scenes: Path, rooms: Iterable[tuple[str, int]], content: Callable[[Path], bytes]
) -> str:
    found = hashlib.sha256()
    for kind, seed in rooms:
        found.update(content(room_folder(scenes, kind, seed)))
    return found.hexdigest()


def _scene(folder: Path) -> bytes:
    """What a room is, what made its pictures, and which perception saw them."""
    head = read_head(folder)
    for name in LAST_BITS:
        head["sha256"].pop(name, None)
    return json.dumps(head, sort_keys=True).encode()


def _lidar(folder: Path) -> bytes:
    try:
        return (folder / LIDAR).read_bytes()
    except OSError as error:
        raise SceneError(
            f"found no readable {LIDAR} in {folder} ({error.strerror}); make it with "
            f"python -m sim_bridge.scans SCENES, then python -m cfnav_ros.lidar_states SCENES"
        ) from error
