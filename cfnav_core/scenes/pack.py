"""A folder of built-in scenes as one store; goes on where an interrupted run stopped."""

from __future__ import annotations

from pathlib import Path

from tqdm import tqdm

from cfnav_core.scenes.check import check_room
from cfnav_core.scenes.scene import SceneError
from cfnav_core.scenes.store import BUILT_IN, StoreHead
from cfnav_core.scenes.store_writer import StoreWriter
from cfnav_core.task.rooms import FURNITURE, furniture_of, parse_rooms, rooms_in, split_of


def pack(folder: Path, split: str, out: Path) -> StoreHead:
    """Append the scenes to a store in the order of the split's rooms; each is checked first.

    Args:
        folder: of built-in scenes, of one furniture.
        split: row of ``rooms.SPLITS``.
        out: folder of the store; must not be there yet.

    Returns:
        The head of the finished store.

    Raises:
        SceneError: a scene is damaged or in no split (those before it are kept for the next run),
            the disk is full, or the store is there already.
    """
    rooms, known = set(rooms_in(folder)), parse_rooms([split], FURNITURE)
    if strange := sorted(rooms.difference(known)):
        kind, seed = strange[0]
        raise SceneError(
            f"found {kind}:{seed} in {folder}, which is in no split of {split} ({len(strange)} "
            "such); move it to another folder"
        )
    if len(kinds := sorted({furniture_of(kind) for kind, _ in rooms})) > 1:
        raise SceneError(
            f"found rooms of {' and '.join(kinds)} furniture in {folder}, expected one; move the "
            "others to another folder"
        )
    writer = StoreWriter(out, BUILT_IN, f"built-in rooms, split as {split}", folder)
    there = set(writer.head.names())
    for kind, seed in tqdm([room for room in known if room in rooms], unit="scene"):
        if f"{kind}:{seed}" in there:
            continue
        scene, problems = check_room(folder, kind, seed)
        if scene is None or problems:
            raise SceneError(problems[0])
        writer.append(scene, split_of(split, seed))
    writer.finish()
    return writer.head
