"""``graph.json`` and visible-object maps of a published scene, parsed by hand.

The graph is networkx node-link JSON whose edge list is called ``links`` or ``edges``, depending on
the release that wrote it. An edge carries no action: an action succeeds when the key it should
lead to is a successor of the present one.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfnav_core.published.keys import Key
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.actions import NUM_ACTIONS, Action

MOVES = tuple(a for a in Action if a is not Action.Done)


class Keys:
    """Reads many key texts, each once; unusable ones are kept aside with their sentence."""

    def __init__(self) -> None:
        self._known: dict[str, Key | None] = {}
        self.bad: dict[str, str] = {}

    def read(self, text: str) -> Key | None:
        """The key, or None when it is unusable."""
        if text not in self._known:
            try:
                self._known[text] = Key.parse(text)
            except SceneError as error:
                self._known[text], self.bad[str(text)] = None, str(error)
        return self._known[text]

    def read_all(self, texts: Iterable[str]) -> set[Key]:
        """The usable ones."""
        return {key for text in texts if (key := self.read(text)) is not None}


@dataclass(frozen=True)
class SceneGraph:
    """States of a scene, and which may follow which; ``bad`` maps unusable keys to why."""

    states: frozenset[Key]
    edges: frozenset[tuple[Key, Key]]
    bad: dict[str, str]


def read_json(path: Path) -> Any:
    """A JSON file.

    Raises:
        SceneError: it is missing or damaged.
    """
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise SceneError(f"found no readable {path} ({error}); unpack it again") from error


def read_graph(path: Path) -> SceneGraph:
    """Read ``graph.json``.

    Raises:
        SceneError: it is no node-link JSON of state keys.
    """
    data, keys = read_json(path), Keys()
    try:
        links = data["links"] if "links" in data else data["edges"]
        # as networkx does, the ends of an edge are nodes even when they are not listed
        states = keys.read_all(str(node["id"]) for node in data["nodes"])
        ends = [(keys.read(str(e["source"])), keys.read(str(e["target"]))) for e in links]
        directed = data.get("directed", False)
    except (KeyError, TypeError, AttributeError) as error:
        raise SceneError(
            f"found {path} without {error}, expected networkx node-link JSON with nodes and links "
            "of state keys; unpack it again"
        ) from error
    edges = {(a, b) for a, b in ends if a is not None and b is not None}
    if not directed:
        edges |= {(b, a) for a, b in edges}
    states |= {key for edge in edges for key in edge}
    if not states:
        why = next(iter(keys.bad.values()), "it is empty")
        raise SceneError(f"found no usable state in {path} ({why}); unpack it again")
    return SceneGraph(frozenset(states), frozenset(edges), keys.bad)


def transitions(
    states: Sequence[Key], edges: frozenset[tuple[Key, Key]]
) -> tuple[np.ndarray, np.ndarray]:
    """What each action does.

    Args:
        states: the S keys in order.
        edges: of the graph; those that leave ``states`` count as absent.

    Returns:
        next_state int32 [S, 6] and collided bool [S]: a MoveAhead without its edge. Turns and
        looks without one change nothing and are no collision.
    """
    index = {key: i for i, key in enumerate(states)}
    next_state = np.tile(np.arange(len(states), dtype=np.int32)[:, None], NUM_ACTIONS)
    for i, key in enumerate(states):
        for action in MOVES:
            expected = key.after(action)
            if expected in index and (key, expected) in edges:
                next_state[i, action] = index[expected]
    return next_state, next_state[:, Action.MoveAhead] == np.arange(len(states))


@dataclass(frozen=True)
class SeenObject:
    """One object: its class, x and z in metres, and the states that see it, which may be none."""

    kind: str
    x: float
    z: float
    seen_from: frozenset[Key]


def read_visible(path: Path) -> tuple[list[SeenObject], dict[str, str]]:
    """Read a visible-object map of either schema: objects to states, or states to metadata.

    Returns:
        The objects, and unusable state keys with their sentences.

    Raises:
        SceneError: it is neither.
    """
    data, keys = read_json(path), Keys()
    try:
        if _keyed_by_state(data):
            data = _turned_round(data)
        objects = [_seen_object(name, keys.read_all(states)) for name, states in data.items()]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SceneError(
            f"found {path} that cannot be read ({error}), expected object ids with lists of state "
            "keys, or state keys with AI2-THOR metadata; unpack it again"
        ) from error
    return objects, keys.bad


def _keyed_by_state(data: dict[str, Any]) -> bool:
    try:
        float(next(iter(data), "").split("|")[0])
    except ValueError:
        return False
    return True


def _turned_round(by_state: dict[str, Any]) -> dict[str, list[str]]:
    by_object: dict[str, list[str]] = {}
    for key, metadata in by_state.items():
        for entry in metadata["objects"]:
            seen = by_object.setdefault(entry["objectId"], [])
            if entry["visible"]:
                seen.append(key)
    return by_object


def _seen_object(name: str, states: set[Key]) -> SeenObject:
    """From an id such as ``Sink|-01.03|+00.93|+00.34|SinkBasin``; parts keep the first class."""
    kind, x, _, z = name.split("|")[:4]
    return SeenObject(kind, float(x), float(z), frozenset(states))
