"""What results were made of: those of other rooms, episodes or LiDAR do not count."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from cfnav_core.files.json_file import write_json
from cfnav_core.published.start_states import read_episodes
from cfnav_core.scenes.scene import LIDAR, read_head
from cfnav_core.scenes.select import has_lidar, lidar_of
from cfnav_core.task.rooms import parse_room, parse_rooms, room_folder, shift_of
from studies.engine.jobs import GridFolders

ROOMS, TESTS = "rooms.json", "tests.json"

LOOKS = ("features", "detections")
"""Arrays that follow from pictures and perception; their last bits are the machine's."""


def check_rooms(places: GridFolders, splits: Iterable[str]) -> None:
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
                f"of {places.out} were trained, or an older version noted them; give another --out"
            )
    write_json(path, noted)


@dataclass(frozen=True)
class Made:
    """What the tests of a grid are made of, noted in its folder.

    Attributes:
        perception: identity of what made the scenes' features.
        tests: by split, and by split and LIDAR where the LiDAR has a part in the test: eight hex
            digits of the episodes, their rooms, and what the LiDAR says there.
    """

    perception: str
    tests: dict[str, str]

    @classmethod
    def of(cls, scenes: Path, frozen: Mapping[str, Path], lidar: Collection[str]) -> Made:
        """Look at what there is.

        Args:
            scenes: folder of the rooms.
            frozen: files of the test episodes by split.
            lidar: splits whose LiDAR is needed; that of others is looked at where it is there.

        Raises:
            SceneError: a room is not there, or what the LiDAR says in it.
        """
        perception, tests = "", {}
        for split, path in frozen.items():
            rooms = sorted({parse_room(start.scene) for start in read_episodes(path)})
            episodes = path.read_bytes().hex()
            seen = _digest(scenes, rooms, _scene)
            tests[split] = _short(episodes, seen)
            names = [f"{kind}:{seed}" for kind, seed in rooms]
            if split in lidar or has_lidar(scenes, names):
                lidar_of(scenes, names)  # says what is missing, or of another version
                tests[f"{split} {LIDAR}"] = _short(episodes, seen, _digest(scenes, rooms, _lidar))
            perception = read_head(room_folder(scenes, *rooms[0]))["perception"]
        return cls(perception, tests)

    def write(self, out: Path) -> None:
        """Note it in a grid's folder, beside what that says of other splits.

        Raises:
            ValueError: what is there cannot be read.
        """
        kept = Made.read(out) if (out / TESTS).exists() else self
        alike = kept.tests if kept.perception == self.perception else {}
        others = {of: tests for of, tests in alike.items() if of.split()[0] not in self.tests}
        write_json(out / TESTS, asdict(replace(self, tests=others | self.tests)))

    @classmethod
    def read(cls, out: Path) -> Made:
        """What was noted in a grid's folder.

        Raises:
            ValueError: nothing was.
        """
        try:
            return cls(**json.loads((out / TESTS).read_text()))
        except (OSError, ValueError, TypeError) as error:
            raise ValueError(
                f"found no readable {TESTS} in {out} ({error}); make them with cfnav benchmark, "
                "or unpack recorded results there"
            ) from error


def identity_of_rooms(scenes: Path, rooms: str) -> str:
    """Eight hex digits of rooms and of what the LiDAR says there.

    Args:
        scenes: folder of the rooms.
        rooms: as "data1:validation".

    Raises:
        SceneError: a room is not there, or what the LiDAR says in it.
    """
    found = parse_rooms([rooms])
    lidar_of(scenes, [f"{kind}:{seed}" for kind, seed in found])
    return _short(*(_digest(scenes, found, content) for content in (_scene, _lidar)))


def _short(*parts: str) -> str:
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:8]


def _digest(
    scenes: Path, rooms: Iterable[tuple[str, int]], content: Callable[[Path], bytes]
) -> str:
    found = hashlib.sha256()
    for kind, seed in rooms:
        found.update(content(room_folder(scenes, kind, seed)))
    return found.hexdigest()


def room_of(head: Mapping[str, Any]) -> dict[str, Any]:
    """What of a scene's head says which room it is, whatever made it and however it looks."""
    arrays = {name: digest for name, digest in head["sha256"].items() if name not in LOOKS}
    return {name: head[name] for name in ("name", "objects", "goals")} | {"sha256": arrays}


def _scene(folder: Path) -> bytes:
    """Which room it is, how its pictures look, and which perception saw them."""
    head = read_head(folder)
    seen = {"perception": head["perception"], "shift": shift_of(head["source"])}
    return json.dumps(room_of(head) | seen, sort_keys=True).encode()


def _lidar(folder: Path) -> bytes:
    return (folder / LIDAR).read_bytes()
