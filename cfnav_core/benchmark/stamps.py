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
from cfnav_core.scene import LIDAR, SCENE

ROOMS = "rooms.json"


def check_rooms(places: Places, splits: Iterable[str]) -> None:
    """Note in the grid's folder which rooms it trains in, or compare.

    Raises:
        ValueError: the grid was begun in other rooms.
        OSError: a room is not there.
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
        OSError: something is not there.
    """
    rooms = tuple(sorted({parse_room(start.scene) for start in read_episodes(frozen)}))
    parts = [frozen.read_bytes().hex(), _digest(scenes, rooms, SCENE)]
    if lidar:
        parts.append(_digest(scenes, rooms, LIDAR))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:8]


def _digest(scenes: Path, rooms: tuple[tuple[str, int], ...], name: str) -> str:
    found = hashlib.sha256()
    for room in rooms:
        found.update((room_folder(scenes, *room) / name).read_bytes())
    return found.hexdigest()
