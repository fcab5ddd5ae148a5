"""Many scenes as one memory-mapped store: ``store.json`` and one ``.npy`` for each array.

Opened, its scenes are slices of the memory maps: memory does not grow with the store. So
``visible`` lies there as one byte each; bits would have to be unpacked into memory.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np

from cfnav_core.scenes.scene import ARRAYS, OfflineScene, SceneError
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.detections import Fields, fields_before_names

SCHEMA = 1
HEAD = "store.json"
BUILT_IN = "built-in"
"""Layout of a store of built-in scenes."""

OVER_POSITIONS = ("positions", "distance")
"""Arrays with a row for each position; ``instances`` has one a scene, all others one a state."""


@dataclass(frozen=True)
class StoredScene:
    """One scene and where it lies.

    Attributes:
        name: for example ``FloorPlan21``.
        room_type: one of ``ROOM_TYPES``.
        split: train, validation or test.
        goals: those that may be asked for.
        first, states: its rows of the arrays over states.
        first_position, positions: its rows of those over positions.
    """

    name: str
    room_type: str
    split: str
    goals: tuple[str, ...]
    first: int
    states: int
    first_position: int
    positions: int


@dataclass(frozen=True)
class StoreHead:
    """``store.json``.

    Attributes:
        layout: name of the published data set, or ``BUILT_IN``.
        made_from: what the store was made from and how; until it is finished, also where.
        perception: identity of what made features and detections.
        source: identity of what made the rooms.
        objects: rows of the detections.
        fields: names of their columns.
        camera: that saw the rooms; None where the data set does not say.
        rows: dtype and shape of one row, by array.
        scenes: in order.
        sha256: of the file of each array.
    """

    layout: str
    made_from: str
    perception: str = ""
    source: str = ""
    objects: tuple[str, ...] = ()
    fields: Fields = ()
    camera: CameraSetUp | None = None
    rows: dict[str, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    scenes: tuple[StoredScene, ...] = ()
    sha256: dict[str, str] = field(default_factory=dict)

    @classmethod
    def load(cls, folder: Path) -> StoreHead:
        """Read it.

        Raises:
            SceneError: it is missing, damaged or of another schema.
        """
        try:
            data = json.loads((folder / HEAD).read_text())
            if data.pop("schema") != SCHEMA:
                raise ValueError(f"another schema than {SCHEMA}")
            data["objects"] = tuple(data["objects"])
            data |= _fields_and_camera(data)
            data["rows"] = {key: (dtype, tuple(row)) for key, (dtype, row) in data["rows"].items()}
            data["scenes"] = tuple(
                StoredScene(**{**scene, "goals": tuple(scene["goals"])}) for scene in data["scenes"]
            )
            return cls(**data)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise SceneError(
                f"found no readable {folder / HEAD} ({error}); make the store again with "
                "cfnav data convert"
            ) from error

    def save(self, folder: Path) -> None:
        """Write it, all at once."""
        partial = folder / (HEAD + ".partial")
        with partial.open("w") as file:
            camera = self.camera.to_json() if self.camera else None
            said = asdict(self) | {"camera": camera}
            json.dump({"schema": SCHEMA, **said}, file, indent=1)
            to_disk(file)
        partial.replace(folder / HEAD)

    def names(self, split: str | None = None) -> list[str]:
        """Scenes of a split, or all."""
        return [s.name for s in self.scenes if split in (None, s.split)]

    def shape(self, key: str) -> tuple[int, ...]:
        """Of an array over all scenes."""
        count = len(self.scenes)
        if key != "instances":
            over = "positions" if key in OVER_POSITIONS else "states"
            count = sum(getattr(s, over) for s in self.scenes)
        return (count, *self.rows[key][1])


def _fields_and_camera(data: Mapping[str, Any]) -> dict[str, Any]:
    """A store that was made before it said so has the mast's rooms, or published ones."""
    if "fields" in data:
        camera = data["camera"]
        return {
            "fields": tuple(data["fields"]),
            "camera": CameraSetUp.from_json(camera) if camera else None,
        }
    _, row = data["rows"]["detections"]
    return {
        "fields": fields_before_names(row[-1]),
        "camera": MAST if data["layout"] == BUILT_IN else None,
    }


def to_disk(file: IO[Any]) -> None:
    """After this a sudden stop of the machine loses nothing that was written."""
    file.flush()
    os.fsync(file.fileno())


def open_store(folder: Path, names: Sequence[str] | None = None) -> list[OfflineScene]:
    """Open scenes of a store; their arrays are slices of its memory maps.

    Args:
        folder: of the store.
        names: which scenes, all when None; ``StoreHead.names`` gives those of a split.

    Raises:
        SceneError: the store is missing or damaged, or has no such scene.
    """
    head = StoreHead.load(folder)
    try:
        maps = {key: np.load(folder / f"{key}.npy", mmap_mode="c") for key in ARRAYS}
    except (OSError, EOFError, ValueError) as error:
        raise SceneError(f"found no readable store in {folder} ({error}); make it again with "
                         "cfnav data convert") from error  # fmt: skip
    for key, array in maps.items():
        if (array.shape, array.dtype.str) != (head.shape(key), head.rows[key][0]):
            raise SceneError(f"found {key}.npy of shape {array.shape} in {folder}, expected "
                             f"{head.shape(key)}; make the store again")  # fmt: skip
    rows = {s.name: i for i, s in enumerate(head.scenes)}
    if missing := [name for name in names or () if name not in rows]:
        raise SceneError(f"found no scene {missing[0]} in {folder}, which has {', '.join(rows)}")
    return [_slice(folder, head, maps, rows[n]) for n in (rows if names is None else names)]


def _slice(folder: Path, head: StoreHead, maps: dict[str, np.ndarray], i: int) -> OfflineScene:
    here = head.scenes[i]
    arrays = {}
    for key, array in maps.items():
        if key == "instances":
            arrays[key] = array[i]
        elif key in OVER_POSITIONS:
            arrays[key] = array[here.first_position : here.first_position + here.positions]
        else:
            arrays[key] = array[here.first : here.first + here.states]
    scene = OfflineScene(
        here.name, here.room_type, head.perception, head.source, head.objects, here.goals,
        **arrays, fields=head.fields, camera=head.camera,
    )  # fmt: skip
    scene.check(f"{here.name} of {folder}", here.states)
    return scene
