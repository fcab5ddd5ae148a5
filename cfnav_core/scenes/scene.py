"""``OfflineScene``: every reachable state of one room, with what is seen there, as arrays.

Knows the format, not who made it: rooms rendered here and published data sets look alike from here
on. A state is (position, heading, horizon): heading h has yaw h * 45 degrees counter-clockwise,
horizon 0 is level, and each further one looks further down, as its camera says.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from cfnav_core.files.provenance import note_of, sha256
from cfnav_core.files.whole import whole, writing
from cfnav_core.task.actions import NUM_ACTIONS, STEP_M, Action
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.detections import Fields, fields_before_names, width
from cfnav_core.task.rooms import AGAIN
from cfnav_core.task.vocabulary import ROOM_TYPES

HEADINGS, HORIZONS = 8, 2
SCHEMA, READABLE = 3, (2, 3)
"""Until 2 a scene said neither its camera, which was the mast's, nor the names of its fields."""
SCENE = "scene.json"
"""Who made it with what, and the SHA-256 of every array."""

PICTURES = "pictures.npy"
"""Optional beside the arrays: uint8 [S, H, W, 3], to make the features again from."""

SCANS = "scans.npy"
"""Optional: float32 [P, 8, N], what a LiDAR measures at each position and heading, metres."""

LIDAR = "lidar.npy"
"""Optional: float32 [S], the LiDAR node's probability that MoveAhead collides."""

ARRAYS = (
    "features", "detections", "next_state", "collided", "visible", "position", "heading", "horizon",
    "positions", "instances", "distance",
)  # fmt: skip

_HEAD = ("name", "room_type", "perception", "source", "states", "objects", "goals", "sha256")


class SceneError(ValueError):
    """A scene on disk is missing, damaged or of another format; the message says what to do."""


@dataclass(frozen=True)
class OfflineScene:
    """One room as arrays.

    Attributes:
        name: for example ``kitchen:21`` or ``FloorPlan21``.
        room_type: one of ``ROOM_TYPES``.
        perception: identity of what made features and detections.
        source: identity of the program or data set that made the room.
        objects: names of the C objects that are looked for in pictures.
        goals: those that may be asked for in this room.
        features: float16 [S, *F]: (256,) built-in, (512, 7, 7) ResNet18 maps, (2048, 7, 7) CLIP.
        detections: float16 [S, C, D].
        fields: names of the D numbers, see ``task.detections``.
        camera: that saw the room; None where the data set does not say.
        next_state: int32 [S, 6]: where each action leads; itself when nothing changes.
        collided: bool [S]: MoveAhead would collide.
        visible: bool [S, C]: the object is visible, so that Done here is a success.
        position: int32 [S], row of ``positions``.
        heading: int8 [S], 0..7.
        horizon: int8 [S], 0..H-1.
        positions: float32 [P, 2], metres.
        instances: int16 [C], how many of an object are visible from anywhere; published data
            draw goals in proportion to it.
        distance: float32 [P, C], metres in a straight line to the middle of the nearest instance,
            inf without. Visible is what is near by its nearest edge.
    """

    name: str
    room_type: str
    perception: str
    source: str
    objects: tuple[str, ...]
    goals: tuple[str, ...]
    features: np.ndarray
    detections: np.ndarray
    next_state: np.ndarray
    collided: np.ndarray
    visible: np.ndarray
    position: np.ndarray
    heading: np.ndarray
    horizon: np.ndarray
    positions: np.ndarray
    instances: np.ndarray
    distance: np.ndarray
    fields: Fields = ()
    camera: CameraSetUp | None = None

    @property
    def num_states(self) -> int:
        """S."""
        return len(self.next_state)

    def save(self, folder: Path) -> None:
        """Write the scene; ``folder`` appears only when complete.

        Raises:
            WriteError: the disk is full or refuses; what was there before stays whole.
        """
        with writing(folder), whole(folder) as partial:
            partial.mkdir(parents=True)
            self._write(partial)
            for kept in (folder / PICTURES, note_of(folder / PICTURES)):
                if kept.exists():
                    _link(kept, partial / kept.name)

    def _write(self, folder: Path) -> None:
        for key in ARRAYS:
            value = getattr(self, key)
            np.save(folder / f"{key}.npy", np.packbits(value, 1) if key == "visible" else value)
        self.write_head(folder, {key: sha256(folder / f"{key}.npy") for key in ARRAYS})

    def write_head(self, folder: Path, sums: Mapping[str, str]) -> None:
        """Write ``scene.json``.

        Args:
            folder: of the scene.
            sums: SHA-256 of each array's file.
        """
        head = {
            "schema": SCHEMA, "name": self.name, "room_type": self.room_type,
            "perception": self.perception, "source": self.source, "states": self.num_states,
            "objects": self.objects, "goals": self.goals,
            "fields": self.fields,
            "camera": self.camera.to_json() if self.camera else None,
            "sha256": sums,
        }  # fmt: skip
        (folder / SCENE).write_text(json.dumps(head, indent=1))

    @classmethod
    def load(cls, folder: Path) -> OfflineScene:
        """Open a scene, its large arrays memory-mapped.

        Raises:
            SceneError: something is missing, of another schema, or of the wrong shape.
        """
        head = read_head(folder)
        try:
            arrays = {k: np.load(folder / f"{k}.npy", mmap_mode="c") for k in ARRAYS}
        except (OSError, EOFError, ValueError) as error:
            raise SceneError(f"found no readable scene in {folder} ({error}); {AGAIN}") from error
        objects = tuple(head["objects"])
        arrays["visible"] = np.unpackbits(arrays["visible"], 1)[:, : len(objects)].astype(bool)
        text = {k: head[k] for k in ("name", "room_type", "perception", "source")}
        try:
            fields, camera = _fields_and_camera(head, arrays["detections"].shape[-1])
        except ValueError as error:
            raise SceneError(f"found no readable scene in {folder} ({error}); {AGAIN}") from error
        scene = cls(
            **text, objects=objects, goals=tuple(head["goals"]), **arrays, fields=fields,
            camera=camera,
        )  # fmt: skip
        scene.check(folder, head["states"])
        return scene

    def check(self, folder: Path | str, states: int) -> None:
        """Raise ``SceneError`` unless the arrays fit together; ``folder`` is for the message."""
        c, p = len(self.objects), len(self.positions)
        if not states or not p:
            raise SceneError(f"found a scene of {states} states and {p} positions in {folder}")
        shapes = {
            "features": (states, *self.features.shape[1:]),
            "detections": (states, c, width(self.fields)),
            "next_state": (states, NUM_ACTIONS), "collided": (states,), "visible": (states, c),
            "position": (states,), "heading": (states,), "horizon": (states,),
            "positions": (p, 2), "instances": (c,), "distance": (p, c),
        }  # fmt: skip
        for key, expected in shapes.items():
            found = getattr(self, key).shape
            if found != expected:
                raise SceneError(f"found {key} of shape {found} in {folder}, expected {expected}")
        if self.next_state.min() < 0 or self.next_state.max() >= states:
            raise SceneError(f"found a next state outside 0..{states - 1} in {folder}")
        if self.position.min() < 0 or self.position.max() >= p:
            raise SceneError(f"found a position outside 0..{p - 1} in {folder}")
        if not (0 <= self.heading.min() <= self.heading.max() < HEADINGS):
            raise SceneError(f"found a heading outside 0..{HEADINGS - 1} in {folder}")
        horizons = len(self.camera.horizons) if self.camera else HORIZONS
        if not (0 <= self.horizon.min() <= self.horizon.max() < horizons):
            raise SceneError(f"found a horizon outside 0..{horizons - 1} in {folder}")
        if self.room_type not in ROOM_TYPES:
            raise SceneError(f"found room type {self.room_type!r} in {folder}")
        if unknown := set(self.goals) - set(self.objects):
            raise SceneError(f"found goals {sorted(unknown)} in {folder} that are no objects")

    def actions_to(self, goal: int) -> np.ndarray:
        """int32 [S]: fewest actions, Done not counted, to see the category; -1 never."""
        return actions_to(self.next_state, self.visible[:, goal])

    def metres_to(self, goal: int) -> np.ndarray:
        """float64 [P]: shortest driven way (m) to a position that sees the category; inf never."""
        return metres_to(self.next_state, self.visible[:, goal], self.position, self.heading)


def read_head(folder: Path) -> dict[str, Any]:
    """Read ``scene.json``.

    Returns:
        ``name`` to ``goals`` as in ``OfflineScene``, ``states``, ``sha256`` of each array's file.

    Raises:
        SceneError: it is missing, damaged or of another schema.
    """
    path = folder / SCENE
    try:
        head: dict[str, Any] = json.loads(path.read_text())
        schema, missing = head.get("schema"), sorted(set(_HEAD) - head.keys())
    except (OSError, ValueError, AttributeError) as error:
        raise SceneError(f"found no readable scene in {folder} ({error}); {AGAIN}") from error
    if schema not in READABLE:
        raise SceneError(f"found scene schema {schema} in {path}, expected {SCHEMA}; {AGAIN}")
    if missing:
        raise SceneError(f"found no {', '.join(missing)} in {path}; {AGAIN}")
    return head


def _fields_and_camera(head: Mapping[str, Any], columns: int) -> tuple[Fields, CameraSetUp | None]:
    """What a scene's head says of its detections and its camera.

    Raises:
        ValueError: it makes no sense.
    """
    if head["schema"] < SCHEMA:
        return fields_before_names(columns), MAST
    fields, camera = tuple(head["fields"]), head["camera"]
    return fields, CameraSetUp.from_json(camera) if camera else None


def changed_files(folder: Path, sums: Mapping[str, str]) -> list[str]:
    """Names of a folder's arrays whose files no longer have the hashes they were written with.

    Args:
        folder: holds ``<name>.npy``.
        sums: SHA-256 by name.

    Raises:
        SceneError: one cannot be read.
    """
    try:
        return [key for key, expected in sums.items() if sha256(folder / f"{key}.npy") != expected]
    except OSError as error:
        raise SceneError(f"found an unreadable array in {folder} ({error})") from error


def actions_to(next_state: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Fewest actions from every state to any target.

    Args:
        next_state: int32 [S, 6].
        targets: bool [S].

    Returns:
        int32 [S], -1 where no target can be reached.
    """
    n = len(next_state)
    sources = np.tile(np.arange(n), NUM_ACTIONS - 1)
    ends = np.asarray(next_state)[:, : Action.Done].T.ravel()
    # the virtual node n leads to every target, so that one search serves all of them
    goals = np.nonzero(targets)[0]
    rows, columns = np.r_[ends, np.full(len(goals), n)], np.r_[sources, goals]
    moved = rows != columns
    graph = csr_array((np.ones(moved.sum()), (rows[moved], columns[moved])), (n + 1, n + 1))
    distance = dijkstra(graph, indices=n, unweighted=True)[:n] - 1
    return np.where(np.isfinite(distance), distance, -1).astype(np.int32)


def step_m(heading: np.ndarray) -> np.ndarray:
    """Length of a MoveAhead between positions of the grid, metres: float64 of int headings."""
    return np.where(heading % 2, STEP_M * np.sqrt(2), STEP_M)


def metres_to(
    next_state: np.ndarray, targets: np.ndarray, position: np.ndarray, heading: np.ndarray
) -> np.ndarray:
    """Shortest way in metres from every position to a position with a target state.

    Args:
        next_state: int32 [S, 6].
        targets: bool [S].
        position: int32 [S].
        heading: int8 [S].

    Returns:
        float64 [P]; inf where none can be reached. Turning costs nothing.
    """
    n = int(position.max()) + 1
    ahead = np.asarray(next_state)[:, Action.MoveAhead]
    moved = np.nonzero(ahead != np.arange(len(ahead)))[0]
    start, end = position[moved], position[ahead[moved]]
    # states that differ in tilt alone make the same move
    (start, end), first = np.unique(np.stack([start, end]), axis=1, return_index=True)
    length = step_m(heading[moved[first]])
    goals = np.unique(position[np.nonzero(targets)[0]])
    # the virtual node n leads to every goal; its links are 1 m long (scipy drops zeros) and that
    # metre is taken off again
    rows, columns = np.r_[end, np.full(len(goals), n)], np.r_[start, goals]
    weights = np.r_[length, np.ones(len(goals))]
    graph = csr_array((weights, (rows, columns)), (n + 1, n + 1))
    return dijkstra(graph, indices=n)[:n] - 1.0


def _link(file: Path, name: Path) -> None:
    """Give a file another name, or a copy that name where the file system has no links."""
    try:
        os.link(file, name)
    except OSError:
        shutil.copyfile(file, name)
