"""``OfflineScene``: every reachable state of one room, rendered once and stored as arrays.

Knows the format, not who made it. A state is (position, heading, horizon) with index
``(position * 8 + heading) * 2 + horizon``; heading h has yaw h * 45 degrees counter-clockwise,
horizon 0 is level and 1 is 30 degrees down.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from cfnav_core.actions import NUM_ACTIONS, STEP_M, Action
from cfnav_core.vocabulary import CATEGORIES, ROOM_TYPES

HEADINGS, HORIZONS = 8, 2
SCHEMA = 1
PICTURES = "pictures.npy"
"""Optional beside the arrays: uint8 [S, 150, 150, 3], to make the features again from."""

ARRAYS = ("features", "detections", "next_state", "collided", "visible", "positions")


class SceneError(ValueError):
    """A scene on disk is missing, damaged or of another format; the message says what to do."""


@dataclass(frozen=True)
class OfflineScene:
    """One room as arrays.

    Attributes:
        name: for example ``kitchen:21``.
        room_type: one of ``ROOM_TYPES``.
        perception: identity of the perception that made the features.
        source: identity of the program that made the room and its pictures.
        features: float16 [S, F].
        detections: float16 [S, C, 5]: score, x, y, size, near (see ``perception.Observation``).
        next_state: int32 [S, 6]: where each action leads; itself when nothing changes.
        collided: bool [S]: MoveAhead would collide.
        visible: bool [S, C]: the category is visible (``visibility.visible``).
        positions: float32 [P, 2], metres.
    """

    name: str
    room_type: str
    perception: str
    source: str
    features: np.ndarray
    detections: np.ndarray
    next_state: np.ndarray
    collided: np.ndarray
    visible: np.ndarray
    positions: np.ndarray

    @property
    def num_states(self) -> int:
        """S."""
        return len(self.next_state)

    def save(self, folder: Path) -> None:
        """Write the scene; ``folder`` appears only when complete."""
        partial = folder.with_name(folder.name + ".partial")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        for key in ARRAYS:
            value = getattr(self, key)
            np.save(partial / f"{key}.npy", np.packbits(value, 1) if key == "visible" else value)
        head = {
            "schema": SCHEMA, "name": self.name, "room_type": self.room_type,
            "perception": self.perception, "source": self.source, "states": self.num_states,
            "categories": CATEGORIES,
        }  # fmt: skip
        (partial / "scene.json").write_text(json.dumps(head, indent=1))
        if (folder / PICTURES).exists():
            (folder / PICTURES).replace(partial / PICTURES)
        shutil.rmtree(folder, ignore_errors=True)
        partial.replace(folder)

    @classmethod
    def load(cls, folder: Path) -> OfflineScene:
        """Open a scene, its large arrays memory-mapped.

        Raises:
            SceneError: something is missing, of another schema, or of the wrong shape.
        """
        try:
            head = json.loads((folder / "scene.json").read_text())
            arrays = {k: np.load(folder / f"{k}.npy", mmap_mode="r") for k in ARRAYS}
        except (OSError, ValueError) as error:
            raise SceneError(
                f"found no readable scene in {folder} ({error}); "
                "make it again with python -m sim_bridge.dataset"
            ) from error
        if head.get("schema") != SCHEMA or tuple(head.get("categories", ())) != CATEGORIES:
            raise SceneError(
                f"found scene schema {head.get('schema')} in {folder}, expected {SCHEMA} with this "
                "version's categories; make it again with python -m sim_bridge.dataset"
            )
        arrays["visible"] = np.unpackbits(arrays["visible"], 1)[:, : len(CATEGORIES)].astype(bool)
        text = (head[k] for k in ("name", "room_type", "perception", "source"))
        scene = cls(*text, **arrays)
        scene._check(folder, head["states"])
        return scene

    def _check(self, folder: Path, states: int) -> None:
        shapes = {
            "features": (states, self.features.shape[-1]),
            "detections": (states, len(CATEGORIES), 5),
            "next_state": (states, NUM_ACTIONS), "collided": (states,),
            "visible": (states, len(CATEGORIES)),
            "positions": (states // (HEADINGS * HORIZONS), 2),
        }  # fmt: skip
        for key, expected in shapes.items():
            found = getattr(self, key).shape
            if found != expected:
                raise SceneError(f"found {key} of shape {found} in {folder}, expected {expected}")
        if self.next_state.min() < 0 or self.next_state.max() >= states:
            raise SceneError(f"found a next state outside 0..{states - 1} in {folder}")
        if self.room_type not in ROOM_TYPES:
            raise SceneError(f"found room type {self.room_type!r} in {folder}")

    def actions_to(self, goal: int) -> np.ndarray:
        """int32 [S]: fewest actions, Done not counted, to see the category; -1 never."""
        return actions_to(self.next_state, self.visible[:, goal])

    def metres_to(self, goal: int) -> np.ndarray:
        """float64 [P]: shortest driven way (m) to a position that sees the category; inf never."""
        return metres_to(self.next_state, self.visible[:, goal])


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


def metres_to(next_state: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Shortest way in metres from every position to a position with a target state.

    Args:
        next_state: int32 [S, 6].
        targets: bool [S].

    Returns:
        float64 [P]; inf where none can be reached. Turning costs nothing.
    """
    per = HEADINGS * HORIZONS
    n = len(next_state) // per
    level = np.arange(0, len(next_state), HORIZONS)
    ahead = np.asarray(next_state)[level, Action.MoveAhead]
    moved = ahead != level
    length = np.where((level // HORIZONS % HEADINGS) % 2, STEP_M * np.sqrt(2), STEP_M)
    goals = np.unique(np.nonzero(targets)[0] // per)
    # the virtual node n leads to every goal; its links are 1 m long (scipy drops zeros) and that
    # metre is taken off again
    rows = np.r_[ahead[moved] // per, np.full(len(goals), n)]
    columns = np.r_[level[moved] // per, goals]
    weights = np.r_[length[moved], np.ones(len(goals))]
    graph = csr_array((weights, (rows, columns)), (n + 1, n + 1))
    return dijkstra(graph, indices=n)[:n] - 1.0
