"""What is missing or inconsistent in built-in scenes and in stores, a sentence each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import numpy as np
from tqdm import tqdm

from cfnav_core.scenes.scene import OfflineScene, SceneError, changed_files, read_head
from cfnav_core.scenes.store import StoreHead, open_store
from cfnav_core.task.actions import Action
from cfnav_core.task.rooms import room_folder, rooms_in

CHUNK_BYTES = 1 << 24


def check_rooms(folder: Path, quick: bool = False) -> list[str]:
    """Look through a folder of built-in scenes.

    Args:
        folder: see ``rooms.rooms_in``.
        quick: leave the numbers unread: shapes and transitions only.
    """
    lines: list[str] = []
    made_with: dict[str, str] = {}
    rooms = rooms_in(folder)
    finished = {room_folder(folder, *room) for room in rooms}
    others = [p.name for p in sorted(folder.glob("*_[0-9]*/")) if p not in finished]
    lines += counted(others, f"folders in {folder} are no finished rooms")
    for kind, seed in tqdm(rooms, unit="scene", leave=False):
        scene, found = check_room(folder, kind, seed, quick)
        lines += found
        if scene:
            made_with[scene.name] = f"perception {scene.perception} and program {scene.source}"
    return [*check_alike(made_with), *lines]


def check_room(
    folder: Path, kind: str, seed: int, quick: bool = False
) -> tuple[OfflineScene | None, list[str]]:
    """Look through one scene of a folder of built-in scenes.

    Returns:
        The scene, if it can be opened, and what is wrong.
    """
    path = room_folder(folder, kind, seed)
    again = f"remove {path} and run cfnav rooms make (or rooms boxes) again"
    lines: list[str] = []
    try:
        lines += check_sums(path, {} if quick else read_head(path)["sha256"], again)
        scene = OfflineScene.load(path)
    except SceneError as error:
        return None, [*lines, str(error)]
    if scene.name != f"{kind}:{seed}":
        lines.append(f"found {scene.name} in {path}, expected {kind}:{seed}; {again}")
    return scene, [*lines, *check_values(scene, path, again, quick)]


def check_store(folder: Path, quick: bool = False) -> list[str]:
    """Look through a store.

    Args:
        folder: of the store.
        quick: leave the numbers unread: shapes and transitions only.

    Raises:
        SceneError: its head cannot be read.
    """
    head, again = StoreHead.load(folder), "make the store again"
    lines: list[str] = []
    try:
        lines += check_sums(folder, {} if quick else head.sha256, again)
    except SceneError as error:
        lines.append(str(error))
    for name in tqdm(head.names(), unit="scene", leave=False):
        try:
            (scene,) = open_store(folder, [name])
        except SceneError as error:
            lines.append(str(error))
        else:
            lines += check_values(scene, folder, again, quick)
    # an array of another length is said by every scene
    return list(dict.fromkeys(lines))


def check_alike(made_with: Mapping[str, str]) -> list[str]:
    """Scenes made with something else than most of the others: they make no one set.

    Args:
        made_with: what each scene was made with, by its name.
    """
    most = Counter(made_with.values()).most_common(1)
    others = [name for name, one in made_with.items() if one != most[0][0]]
    return counted(others, f"scenes were not made with {most[0][0]} as most were" if most else "")


def check_sums(folder: Path, sums: Mapping[str, str], again: str) -> list[str]:
    """Arrays that changed since they were written.

    Raises:
        SceneError: one cannot be read.
    """
    return [f"found {folder / key}.npy changed since it was written; {again}"
            for key in changed_files(folder, sums)]  # fmt: skip


def check_values(scene: OfflineScene, folder: Path, again: str, quick: bool = False) -> list[str]:
    """Numbers that are not finite, moves that contradict each other, and no target.

    Args:
        scene: whose shapes and ranges fit together.
        folder: that it lies in, for the message.
        again: what to do.
        quick: leave features and detections unread.
    """
    lines = []
    for key, row in (("features", "state"), ("detections", "state"), ("positions", "position")):
        wrong = [] if quick else list(not_finite(getattr(scene, key)))
        lines += counted([f"{row} {i} of {scene.name}; {again}" for i in wrong],
                         f"{row}s in {folder / key}.npy are not finite")  # fmt: skip
    stays = scene.next_state[:, Action.MoveAhead] == np.arange(scene.num_states)
    lines += counted(
        [f"state {i} of {scene.name}; {again}" for i in np.nonzero(stays != scene.collided)[0]],
        f"states in {folder / 'collided.npy'} contradict next_state.npy",
    )
    return [*lines, *check_targets(scene)]


def check_targets(scene: OfflineScene) -> list[str]:
    """Episodes need a level state that does not see the target yet but can reach it."""
    level = scene.horizon == 0
    for goal in scene.goals:
        if np.any(level & (scene.actions_to(scene.objects.index(goal)) >= 1)):
            return []
    return [f"no target of {scene.name} can be reached (visible from anywhere: "
            f"{', '.join(scene.goals) or 'none'})"]  # fmt: skip


def counted(examples: Collection[object], what: str) -> list[str]:
    """One sentence for any number of them, none for none."""
    return [f"{len(examples)} {what}, first {next(iter(examples))}"] if examples else []


def not_finite(array: np.ndarray) -> Iterator[int]:
    """Rows that hold a NaN or an infinity; a few rows in memory at a time."""
    step = max(1, CHUNK_BYTES // max(1, array[:1].nbytes))
    for first in range(0, len(array), step):
        rows = array[first : first + step]
        finite = np.isfinite(rows).all(axis=tuple(range(1, rows.ndim)))
        yield from (first + int(i) for i in np.nonzero(~finite)[0])
