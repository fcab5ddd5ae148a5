"""Scenes of a running AI2-THOR in the layout of the published data sets.

Every reachable state is visited once and its picture, visible objects and boxes are written.
Unlike the published graphs, whose edges say that teleporting to the end pose succeeds, a MoveAhead
edge here is a MoveAhead that the simulator really made, so corners cannot be cut; results on such
scenes are not comparable to published ones, nor are those of another AI2-THOR version. Features are
made from the pictures afterwards, see ``features``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from tqdm import tqdm

from cfnav_core.files.whole import whole, writing
from cfnav_core.published.features import IMAGES
from cfnav_core.published.graph import MOVES
from cfnav_core.published.keys import LOOK_DEG, TURN_DEG, Key
from cfnav_core.published.state_file import StateWriter
from cfnav_core.scenes.layouts import room_of
from cfnav_core.task.actions import STEP_M, Action
from cfnav_core.task.visibility import VISIBLE_DISTANCE_M

PICTURE_SIDE = 300
FIELD_OF_VIEW_DEG = 100
"""Of the published environment."""

ON_GRID_M = 0.02
"""Farthest from a point of the grid that a position still is that point."""


class ThorEvent(Protocol):
    """What AI2-THOR answers to an action; see its own documentation."""

    metadata: Mapping[str, Any]
    frame: np.ndarray
    instance_detections2D: Mapping[str, Sequence[int] | None] | None  # noqa: N815


class Controller(Protocol):
    """The part of ``ai2thor.controller.Controller`` that is used."""

    def reset(self, scene: str) -> ThorEvent:
        """Load a scene."""

    def step(self, *, action: str, **arguments: Any) -> ThorEvent:
        """Do one action."""

    def stop(self) -> None:
        """End the simulator."""


@dataclass
class Visits:
    """What was seen in one scene, state by state."""

    grid: list[dict[str, float]] = field(default_factory=list)
    states: dict[Key, dict[str, list[int]]] = field(default_factory=dict)
    ahead: set[Key] = field(default_factory=set)
    visible: dict[str, list[str]] = field(default_factory=dict)


def start() -> Controller:
    """Start AI2-THOR.

    Raises:
        ValueError: it is not installed, or its Unity build cannot be reached or started.
    """
    try:
        from ai2thor.controller import Controller as RealController
    except ImportError as error:
        raise ValueError(
            f"found no ai2thor ({error}), which this command drives; pip install ai2thor"
        ) from error
    try:
        controller: Controller = RealController(
            width=PICTURE_SIDE, height=PICTURE_SIDE, fieldOfView=FIELD_OF_VIEW_DEG,
            gridSize=STEP_M, snapToGrid=False, visibilityDistance=VISIBLE_DISTANCE_M,
            renderInstanceSegmentation=True,
        )  # fmt: skip
    except Exception as error:  # whatever its download and its start can raise
        raise ValueError(
            f"found AI2-THOR installed, but it does not start ({type(error).__name__}: {error}); "
            "it downloads a Unity build and needs a display or its CloudRendering platform"
        ) from error
    return controller


def export_scene(controller: Controller, name: str, out: Path) -> int:
    """Visit every state of a scene and write its files; the folder appears only when complete.

    Args:
        controller: a running simulator.
        name: for example FloorPlan1.
        out: folder of the scenes.

    Returns:
        The number of states.

    Raises:
        ValueError: the scene is none of the published ones, or the simulator gives no positions.
        WriteError: the disk is full or refuses; nothing of the scene is left there.
    """
    room_of(name)
    visits = Visits(grid=_positions(controller, name))
    with whole(out / name) as folder:
        with writing(folder):
            folder.mkdir(parents=True)
        with StateWriter(folder / IMAGES) as images:
            for key, event in _visit(controller, visits):
                images.add(key, np.asarray(event.frame, np.uint8))
        with writing(folder):
            _write(folder, visits)
    return len(visits.states)


def _positions(controller: Controller, name: str) -> list[dict[str, float]]:
    controller.reset(scene=name)
    points = controller.step(action="GetReachablePositions").metadata["actionReturn"]
    if not points:
        raise ValueError(f"found no reachable position in {name}; try it in AI2-THOR itself")
    for point in points:
        if not _is_on_grid(point["x"], point["z"]):
            raise ValueError(f"found position {point} in {name}, expected multiples of {STEP_M} m; "
                             "this AI2-THOR has another grid")  # fmt: skip
    return list(points)


def _is_on_grid(x: float, z: float) -> bool:
    return all(abs(v / STEP_M - np.round(v / STEP_M)) * STEP_M <= ON_GRID_M for v in (x, z))


def _visit(controller: Controller, visits: Visits) -> Iterator[tuple[Key, ThorEvent]]:
    """Go through all poses; where one is possible, note what is seen and whether ahead is free."""
    for point in visits.grid:
        x, z = round(point["x"] / STEP_M), round(point["z"] / STEP_M)
        for rotation in range(0, 360, TURN_DEG):
            for horizon in (LOOK_DEG, 0):  # MoveAhead is tried from the level pose
                event = controller.step(
                    action="Teleport", position=dict(point), horizon=horizon, standing=True,
                    rotation={"x": 0, "y": rotation, "z": 0},
                )  # fmt: skip
                if event.metadata["lastActionSuccess"]:
                    key = Key(x, z, rotation, horizon)
                    _note(visits, key, event)
                    yield key, event
            level = Key(x, z, rotation, 0)
            if level in visits.states and _moves(controller, level):
                visits.ahead.add(level)


def _note(visits: Visits, key: Key, event: ThorEvent) -> None:
    for one in event.metadata["objects"]:
        seen = visits.visible.setdefault(one["objectId"], [])
        if one["visible"]:
            seen.append(str(key))
    boxes = visits.states.setdefault(key, {})
    for instance, box in (event.instance_detections2D or {}).items():
        if box is not None:
            boxes.setdefault(instance.split("|")[0], []).extend(int(v) for v in box)


def _moves(controller: Controller, key: Key) -> bool:
    """Whether MoveAhead from the present pose succeeds and ends on the next point of the grid."""
    end = key.after(Action.MoveAhead)
    assert end is not None  # MoveAhead always aims somewhere
    length = STEP_M * math.hypot(end.x - key.x, end.z - key.z)
    event = controller.step(action="MoveAhead", moveMagnitude=length)
    at = event.metadata["agent"]["position"]
    near = math.hypot(at["x"] - end.x * STEP_M, at["z"] - end.z * STEP_M) <= ON_GRID_M
    return bool(event.metadata["lastActionSuccess"]) and near


def _edges(visits: Visits) -> Iterator[tuple[Key, Key]]:
    for key in visits.states:
        for action in MOVES:
            end = key.after(action)
            ahead = action is not Action.MoveAhead or key._replace(horizon=0) in visits.ahead
            if end in visits.states and end is not None and ahead:
                yield key, end


def _write(folder: Path, visits: Visits) -> None:
    links = [{"source": str(a), "target": str(b)} for a, b in _edges(visits)]
    files = {
        "grid.json": visits.grid,
        "graph.json": {
            "directed": True, "multigraph": False, "graph": {},
            "nodes": [{"id": str(key)} for key in visits.states], "links": links,
        },
        "visible_object_map_1.5.json": visits.visible,
        "objects_bb.json": {str(key): boxes for key, boxes in visits.states.items()},
    }  # fmt: skip
    for name, content in files.items():
        (folder / name).write_text(json.dumps(content))


@dataclass(frozen=True)
class ExportAi2thor:
    """Drive AI2-THOR through scenes and write them in the published layout (needs ai2thor).

    Edges are real MoveAheads, not teleports as in the published graphs. Pictures are written, and
    no features: make them with cfnav data features before converting.
    """

    scenes: tuple[str, ...]
    """Names such as FloorPlan1 FloorPlan201."""
    out: Path
    """Folder of the scenes; those that are there already are kept."""

    def run_command(self) -> None:
        """Export."""
        for name in self.scenes:
            room_of(name)
        todo = [name for name in self.scenes if not (self.out / name).exists()]
        if not todo:
            raise ValueError(f"found no scene to export that is not in {self.out}; name some")
        controller = start()
        try:
            for name in tqdm(todo, unit="scene"):
                states = export_scene(controller, name, self.out)
                tqdm.write(f"{name}: {states} states")
        finally:
            controller.stop()
