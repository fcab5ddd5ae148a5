"""Which scenes a command line means, in a folder of built-in scenes or a packed store."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cfnav_core.rooms import SPLIT_NAMES, parse_room, parse_rooms, room_folder, rooms_in
from cfnav_core.scene import OfflineScene, SceneError
from cfnav_core.store import HEAD, StoreHead, open_store


def scene_names(folder: Path, rooms: Sequence[str] = ()) -> list[str]:
    """Names of the scenes meant, in order.

    Args:
        folder: of built-in scenes, or a store.
        rooms: see ``rooms.parse_rooms``; of a store, names of scenes or of its splits (train,
            validation, test). All scenes when empty.

    Raises:
        SceneError: the store is damaged.
        ValueError: rooms that cannot be read.
    """
    if (folder / HEAD).exists():
        head, names = StoreHead.load(folder), []
        for room in rooms:
            names += head.names(room) if room in SPLIT_NAMES else [room]
        return names if rooms else head.names()
    return [f"{kind}:{seed}" for kind, seed in (parse_rooms(rooms) if rooms else rooms_in(folder))]


def open_scenes(folder: Path, rooms: Sequence[str] = ()) -> list[OfflineScene]:
    """Open the scenes meant; their large arrays stay on disk.

    Raises:
        SceneError: there are none, one named is missing, or one is damaged.
        ValueError: rooms that cannot be read.
    """
    names = scene_names(folder, rooms)
    if not names:
        raise SceneError(
            f"found no scenes in {folder}; make some with python -m sim_bridge.dataset or "
            "cfnav data convert"
        )
    if (folder / HEAD).exists():
        return open_store(folder, names)
    return [OfflineScene.load(room_folder(folder, *parse_room(name))) for name in names]
