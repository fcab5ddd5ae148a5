"""What is missing or inconsistent in a published data set: counted, with a first example."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from cfnav_core.published.arrays import ArrayFile, open_detections, open_features
from cfnav_core.published.graph import MOVES, SceneGraph, read_graph, read_json, read_visible
from cfnav_core.published.keys import Key
from cfnav_core.published.reader import Choice, first_of, read_room
from cfnav_core.scenes.check import check_targets, counted
from cfnav_core.scenes.layouts import Layout, SceneFolder, scene_names
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.actions import Action


@dataclass(frozen=True)
class Checked:
    """Of one scene: what is wrong, a sentence each, and the files its numbers come from."""

    problems: list[str]
    made_with: str


def check_root(root: Path, layout: Layout, folders: Sequence[SceneFolder]) -> list[str]:
    """Scenes that are missing, and folders that are no scene of the data set."""
    names = [name for name, _, _ in scene_names(layout)]
    missing = [name for name in names if name not in {f.name for f in folders}]
    known = {f.path.name for f in folders}
    others = [p.name for p in sorted(root.glob("FloorPlan*")) if p.name not in known]
    return [
        *counted(missing, f"of {len(names)} scenes are not there"),
        *counted(others, "folders are no scene of the data set, or one a second time"),
    ]


def check_scene(folder: SceneFolder, choice: Choice, quick: bool = False) -> Checked:
    """Look through all files of a scene.

    Args:
        folder: the scene.
        choice: what a conversion would read.
        quick: leave the numbers unread; shapes and keys are still compared.
    """
    problems: list[str] = []
    sources: list[ArrayFile] = []
    graph: SceneGraph | None = None
    path, layout = folder.path, choice.layout
    with _noting(problems):
        _check_grid(first_of(path, ("grid.json",)))
    with _noting(problems):
        graph = read_graph(first_of(path, ("graph.json",)))
    with ExitStack() as stack:
        with _noting(problems):
            features = open_features(first_of(path, choice.feature_files))
            sources.append(stack.enter_context(features))
        with _noting(problems):
            if layout.detections:
                tables = open_detections(first_of(path, layout.detections), choice.objects)
                sources.append(stack.enter_context(tables))
        for source in sources:
            problems += _numbers(source, quick)
            problems += _key_sets(graph, source) if graph else []
        with _noting(problems):
            if graph:
                problems += _edges(graph, path / "graph.json")
                problems += _visible(first_of(path, layout.visible), graph)
                # states that cannot be used were counted above
                problems += check_targets(
                    read_room(folder, replace(choice, drop_bad=True), sources)[1]
                )
    return Checked(problems, ", ".join(s.path.name for s in sources))


@contextmanager
def _noting(problems: list[str]) -> Iterator[None]:
    try:
        yield
    except SceneError as error:
        problems.append(str(error))


def _check_grid(path: Path) -> None:
    data = read_json(path)
    points = data if isinstance(data, list) else []
    if not points or not all(isinstance(p, dict) and {"x", "y", "z"} <= set(p) for p in points):
        raise SceneError(f"found {path} that is no list of x, y, z; unpack it again")


def _numbers(source: ArrayFile, quick: bool) -> list[str]:
    wrong: dict[str, list[Key]] = {}
    for key in sorted(source.known):
        try:
            (source.look if quick else source.row)(key)
        except SceneError as error:
            wrong.setdefault(str(error), []).append(key)
    return [
        line for why, keys in wrong.items()
        for line in counted(keys, f"states of {source.path}: {why}")
    ]  # fmt: skip


def _key_sets(graph: SceneGraph, source: ArrayFile) -> list[str]:
    known = set(source.known)
    return [
        *counted(list(source.bad), f"odd keys in {source.path}"),
        *counted(sorted(graph.states - known), f"states of the graph are not in {source.path}"),
        *counted(sorted(known - graph.states), f"states of {source.path} are not in the graph"),
    ]


def _edges(graph: SceneGraph, path: Path) -> list[str]:
    turns = [a for a in MOVES if a is not Action.MoveAhead]
    missing = [
        f"{action.name} at {key}" for key in sorted(graph.states) for action in turns
        if (end := key.after(action)) is not None and (key, end) not in graph.edges
    ]  # fmt: skip
    strange = [
        f"{a} to {b}" for a, b in sorted(graph.edges) if b not in {a.after(move) for move in MOVES}
    ]
    return [
        *counted(list(graph.bad), f"odd keys in {path}"),
        *counted(missing, f"turns and looks have no edge in {path}"),
        *counted(strange, f"edges of {path} are no action's"),
    ]


def _visible(path: Path, graph: SceneGraph) -> list[str]:
    objects, bad = read_visible(path)
    unknown = {key for one in objects for key in one.seen_from} - graph.states
    return [
        *counted(list(bad), f"odd keys in {path}"),
        *counted(sorted(unknown), f"states of {path} are not in the graph"),
    ]
