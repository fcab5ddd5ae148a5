"""Which scenes a command line means, in a folder of built-in scenes or a packed store."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from cfnav_core.scenes.draw import Law, chances
from cfnav_core.scenes.layouts import LAYOUTS
from cfnav_core.scenes.scene import LIDAR, SCANS, OfflineScene, SceneError
from cfnav_core.scenes.store import BUILT_IN, HEAD, StoreHead, open_store
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.rooms import SPLIT_NAMES, parse_room, parse_rooms, room_folder, rooms_in


def scene_names(folder: Path, rooms: Sequence[str] = ()) -> list[str]:
    """Names of the scenes meant, in order.

    Args:
        folder: of built-in scenes, or a store.
        rooms: see ``rooms.parse_rooms``; of a store also its splits (train, validation, test), and
            names of scenes where it is of published data. All scenes when empty.

    Raises:
        SceneError: the store is damaged.
        ValueError: rooms that cannot be read.
    """
    if (folder / HEAD).exists():
        head, names = StoreHead.load(folder), []
        for room in rooms:
            if room in SPLIT_NAMES:
                names += head.names(room)
            else:
                names += _built_in([room]) if head.layout == BUILT_IN else [room]
        return list(dict.fromkeys(names)) if rooms else head.names()
    return _built_in(rooms) if rooms else [f"{kind}:{seed}" for kind, seed in rooms_in(folder)]


def _built_in(rooms: Sequence[str]) -> list[str]:
    return [f"{kind}:{seed}" for kind, seed in parse_rooms(rooms)]


def open_scenes(folder: Path, rooms: Sequence[str] = ()) -> list[OfflineScene]:
    """Open the scenes meant; their large arrays stay on disk.

    Raises:
        SceneError: there are none, one named is missing, or one is damaged.
        ValueError: rooms that cannot be read.
    """
    names = scene_names(folder, rooms)
    if not names:
        raise SceneError(
            f"found no scenes in {folder}; make some with cfnav rooms make or cfnav data convert"
        )
    if (folder / HEAD).exists():
        return open_store(folder, names)
    return [OfflineScene.load(room_folder(folder, *parse_room(name))) for name in names]


def camera_of(scenes: Sequence[OfflineScene]) -> CameraSetUp | None:
    """The camera that saw all scenes; None where data do not say it, or there are several.

    Raises:
        SceneError: there are several, and pictures were looked at: a network knows those of one.
    """
    cameras = {s.camera for s in scenes}
    if len(cameras) == 1:
        return scenes[0].camera
    if any(s.fields != SIGHTINGS for s in scenes):
        raise SceneError(
            f"found scenes of {len(cameras)} cameras ({', '.join(sorted(map(str, cameras)))}); "
            "make all of them with the same --camera"
        )
    return None


def without(scenes: Sequence[OfflineScene], names: Sequence[str]) -> list[OfflineScene]:
    """Scenes where some objects are neither asked for nor detected; without a goal they drop out.

    Raises:
        ValueError: nobody knows an object, or no scene is left.
    """
    objects = scenes[0].objects
    if unknown := set(names) - set(objects):
        raise ValueError(
            f"found the goals {', '.join(sorted(unknown))} to leave out, expected some of "
            f"{', '.join(objects)}"
        )
    kept = []
    for scene in scenes:
        if goals := tuple(g for g in scene.goals if g not in names):
            # nor is anything paid for bringing them into view
            detections, visible = np.array(scene.detections), np.array(scene.visible)
            rows = [objects.index(name) for name in names]
            detections[:, rows], visible[:, rows] = 0, False
            kept.append(replace(scene, goals=goals, detections=detections, visible=visible))
    if not kept:
        raise ValueError(
            f"found no room with another goal than {', '.join(names)}, expected one; "
            "leave out fewer goals or give more rooms"
        )
    return kept


def has_lidar(folder: Path, names: Sequence[str]) -> bool:
    """Whether ``lidar_of`` has something to read for every scene."""
    return all((room_folder(folder, *parse_room(name)) / LIDAR).exists() for name in names)


def lidar_of(folder: Path, names: Sequence[str]) -> np.ndarray:
    """What the LiDAR node says in every state of scenes.

    Args:
        folder: of built-in scenes.
        names: of the scenes, as in ``SceneBank``.

    Returns:
        float32 [S] over all scenes in order: its probability that MoveAhead collides.

    Raises:
        SceneError: a scene has none, or one of another version of it.
    """
    found = []
    for name in names:
        room = room_folder(folder, *parse_room(name))
        try:
            states = len(np.load(room / "collided.npy", mmap_mode="r"))
            p = np.load(room / LIDAR)
        except (OSError, EOFError, ValueError):
            raise SceneError(
                f"found no readable {LIDAR} in {room}; make it with cfnav rooms scan "
                f"{folder} --rooms {name}, then cfnav data lidar {folder}"
            ) from None
        if p.shape != (states,):
            raise SceneError(
                f"found {LIDAR} of shape {p.shape} in {room}, expected {(states,)}; remove it "
                f"and {SCANS}, then make both again"
            )
        found.append(p)
    return np.concatenate(found)


def law_of(folder: Path) -> Law | None:
    """How the code of the published data in a store draws episodes; None for built-in scenes.

    Raises:
        SceneError: the store is damaged.
    """
    name = StoreHead.load(folder).layout if (folder / HEAD).exists() else BUILT_IN
    if name == BUILT_IN:
        return None
    if name not in LAYOUTS:
        raise SceneError(f"found layout {name!r} in {folder / HEAD}, expected {BUILT_IN}, "
                         f"{', '.join(LAYOUTS)}; make the store again")  # fmt: skip
    return partial(chances, LAYOUTS[name])
