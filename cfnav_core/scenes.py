"""Which scenes a command line means, in a folder of built-in scenes or a packed store."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cfnav_core.rooms import parse_rooms
from cfnav_core.scene import OfflineScene, SceneError
from cfnav_core.store import HEAD, StoreHead, open_store

SPLITS = ("train", "validation", "test")


def scene_names(folder: Path, rooms: Sequence[str] = ()) -> list[str]:
    """Names of the scenes meant, in order.

    Args:
        folder: of built-in scenes, or a store.
        rooms: TYPE:SEED or TYPE:FIRST-LAST; of a store, names of scenes or of its splits (train,
            validation, test). All scenes when empty.

    Raises:
        SceneError: the store is damaged.
        ValueError: rooms that cannot be read.
    """
    if (folder / HEAD).exists():
        head, names = StoreHead.load(folder), []
        for room in rooms:
            names += head.names(room) if room in SPLITS else [room]
        return names if rooms else head.names()
    if rooms:
        return [f"{kind}:{seed}" for kind, seed in parse_rooms(rooms)]
    found = sorted(p.parent.name for p in folder.glob("*/scene.json"))
    return [f"{kind}:{int(seed)}" for kind, _, seed in (n.rpartition("_") for n in found)]


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
    rooms_on_disk = (name.split(":") for name in names)
    return [OfflineScene.load(folder / f"{kind}_{int(seed):05d}") for kind, seed in rooms_on_disk]
