"""One published scene folder as an ``OfflineScene``; numbers are read state by state."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cfnav_core.published.arrays import ArrayFile, open_detections, open_features
from cfnav_core.published.features import IMAGES, PREPARATIONS
from cfnav_core.published.graph import SceneGraph, SeenObject, read_graph, read_visible, transitions
from cfnav_core.published.keys import LOOK_DEG, Key
from cfnav_core.scenes.layouts import Layout, SceneFolder
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.task.actions import STEP_M
from cfnav_core.task.detections import fields_before_names


@dataclass(frozen=True)
class Choice:
    """What to read of a data set, the same for all of its scenes.

    Attributes:
        layout: the data set.
        objects: rows of its detections.
        features: file of picture features; the first one of the layout that is there when None.
        drop_bad: leave out states with odd keys or without numbers, instead of refusing the scene.
    """

    layout: Layout
    objects: tuple[str, ...]
    features: str | None = None
    drop_bad: bool = False

    @property
    def feature_files(self) -> tuple[str, ...]:
        """In the order they are looked for."""
        return (self.features,) if self.features else self.layout.features


@dataclass(frozen=True)
class Files:
    """Those of a scene that are read; ``detections`` is None for SAVN."""

    graph: Path
    visible: Path
    features: Path
    detections: Path | None


def files_of(folder: Path, choice: Choice) -> Files:
    """Find the files of a scene.

    Raises:
        SceneError: one is missing.
    """
    layout = choice.layout
    return Files(
        first_of(folder, ("graph.json",)), first_of(folder, layout.visible),
        first_of(folder, choice.feature_files),
        first_of(folder, layout.detections) if layout.detections else None,
    )  # fmt: skip


def first_of(folder: Path, names: Sequence[str]) -> Path:
    """The first of the files that is there.

    Raises:
        SceneError: none is.
    """
    for name in names:
        if (folder / name).exists():
            return folder / name
    hint = ""
    if any(n.startswith("det_feature") for n in names) and any(folder.glob("detr_*.hdf5")):
        hint = " (DETR detections are not read here)"
    remedy = "unpack the data set again"
    if set(names) <= {kind.file for kind in PREPARATIONS.values()} and (folder / IMAGES).exists():
        remedy = f"make features from its {IMAGES} with cfnav data features"
    raise SceneError(f"found no {' or '.join(names)} in {folder}{hint}; {remedy}")


def read_scene(folder: SceneFolder, choice: Choice) -> OfflineScene:
    """Read a scene with its numbers; its memory is that of its float16 features.

    Raises:
        SceneError: something is missing, damaged or inconsistent; the message names file and state.
    """
    files = files_of(folder.path, choice)
    with ExitStack() as stack:
        sources = [stack.enter_context(open_features(files.features))]
        if files.detections:
            sources += [stack.enter_context(open_detections(files.detections, choice.objects))]
        keys, room = read_room(folder, choice, sources)
        arrays = [_rows(source, keys) for source in sources]
    if not files.detections:
        arrays.append(np.zeros((len(keys), len(choice.objects), 0), np.float16))
    made_with = [s.path.stem for s in sources]
    return replace(
        room, perception=f"{choice.layout.name}: {', '.join(made_with)}",
        features=arrays[0], detections=arrays[1],
        fields=fields_before_names(arrays[1].shape[2]),
    )  # fmt: skip


def read_room(
    folder: SceneFolder, choice: Choice, sources: Sequence[ArrayFile] = ()
) -> tuple[list[Key], OfflineScene]:
    """Read all of a scene but features and detections.

    Args:
        folder: the scene.
        choice: what to read.
        sources: files that must have numbers for every state.

    Returns:
        The key of each state, and the scene with empty features and detections.

    Raises:
        SceneError: as ``read_scene``.
    """
    path = first_of(folder.path, ("graph.json",))
    graph = read_graph(path)
    if graph.bad and not choice.drop_bad:
        raise SceneError(f"{next(iter(graph.bad.values()))} ({len(graph.bad)} such in {path})")
    keys = _complete(graph, sources, choice.drop_bad)
    objects, _ = read_visible(first_of(folder.path, choice.layout.visible))
    next_state, collided = transitions(keys, graph.edges)
    cells, position = np.unique([(k.x, k.z) for k in keys], axis=0, return_inverse=True)
    positions = cells * STEP_M
    visible, instances, distance = _objects(objects, keys, positions, choice.objects)
    wanted = choice.layout.targets[folder.room_type]
    none = np.empty((len(keys), 0), np.float16)
    return keys, OfflineScene(
        name=folder.name, room_type=folder.room_type, perception="",
        source=f"published {choice.layout.name}", objects=choice.objects,
        goals=tuple(n for n, k in zip(choice.objects, instances, strict=True) if k and n in wanted),
        features=none, detections=none, next_state=next_state, collided=collided, visible=visible,
        position=position.reshape(-1).astype(np.int32),
        heading=np.array([k.heading for k in keys], np.int8),
        horizon=np.array([k.horizon // LOOK_DEG for k in keys], np.int8),
        positions=positions.astype(np.float32), instances=instances,
        distance=distance,
    )  # fmt: skip


def _complete(graph: SceneGraph, sources: Sequence[ArrayFile], drop_bad: bool) -> list[Key]:
    """The states in order of position, heading and horizon, each with numbers in every source."""
    states = set(graph.states)
    for source in sources:
        missing = states.difference(source.known)
        if missing and not drop_bad:
            raise SceneError(
                f"found no state {min(missing)} in {source.path} ({len(missing)} of {len(states)} "
                "missing); download it again, or leave such states out with --drop-bad"
            )
        states -= missing
    if not states:
        raise SceneError(f"found no state with numbers in {sources[0].path.parent}")
    return sorted(states, key=lambda k: (k.x, k.z, k.heading, k.horizon))


def _objects(
    seen: list[SeenObject], keys: list[Key], positions: np.ndarray, objects: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``visible``, ``instances`` and ``distance`` of the objects that some state sees."""
    index = {key: i for i, key in enumerate(keys)}
    row = {name: c for c, name in enumerate(objects)}
    visible = np.zeros((len(keys), len(objects)), bool)
    instances = np.zeros(len(objects), np.int16)
    distance = np.full((len(positions), len(objects)), np.inf, np.float32)
    for one in seen:
        states = [index[key] for key in one.seen_from if key in index]
        if one.kind not in row or not states:
            continue
        c = row[one.kind]
        visible[states, c] = True
        instances[c] += 1
        metres = np.hypot(positions[:, 0] - one.x, positions[:, 1] - one.z)
        distance[:, c] = np.minimum(distance[:, c], metres)
    return visible, instances, distance


def _rows(source: ArrayFile, keys: list[Key]) -> np.ndarray:
    """float16 [S, ...]."""
    out: np.ndarray | None = None
    for i, key in enumerate(keys):
        try:
            row = source.row(key)
        except SceneError as error:
            raise SceneError(f"{error} (state {key} of {source.path})") from error
        if out is None:
            out = np.empty((len(keys), *row.shape), np.float16)
        if row.shape != out.shape[1:]:
            raise SceneError(
                f"found numbers of shape {row.shape} in state {key} of {source.path}, expected "
                f"{out.shape[1:]} as in {keys[0]}; download it again"
            )
        out[i] = row
    assert out is not None  # there is at least one state
    return out
