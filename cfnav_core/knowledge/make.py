"""Make knowledge from training scenes: one pass, a scene at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfnav_core.knowledge.together import adjacency, layout_prior, pair_counts, parent_rewards
from cfnav_core.knowledge.zones import ZoneGraph, merge, zone_graph
from cfnav_core.models.base import Knowledge
from cfnav_core.models.parts.reading import columns_of
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.task.detections import Fields
from cfnav_core.task.vocabulary import ROOM_TYPES


def detected(detections: np.ndarray, fields: Fields) -> np.ndarray:
    """Which objects the detector reports in each view.

    Args:
        detections: float16 [S, C, D].
        fields: names of the D columns.

    Returns:
        bool [S, C].
    """
    columns = columns_of(fields)
    return np.asarray(detections[:, :, columns.confidence]) > columns.threshold


def make_knowledge(
    scenes: Sequence[OfflineScene], words: np.ndarray | None, seed: int,
    text: np.ndarray | None = None, links: np.ndarray | None = None,
) -> Knowledge:  # fmt: skip
    """Everything that can be known from training scenes.

    Args:
        scenes: training rooms, all with the same objects and perception; a room type without any
            gets zones that show nothing, a layout prior of ones, and no parents.
        words: float32 [C, W], word vectors of their objects.
        seed: of the zones.
        text: float32 [C, X], features of a text encoder.
        links: float32 [C, C], the user's own adjacency instead of counting.

    Returns:
        Every table; no zones and no layout where the scenes have no detections.

    Raises:
        SceneError: there are no scenes, or they do not go together.
    """
    objects = _common_objects(scenes)
    near = np.zeros((len(ROOM_TYPES), len(objects), len(objects)))
    goals: list[set[str]] = [set() for _ in ROOM_TYPES]
    for scene in scenes:
        room = ROOM_TYPES.index(scene.room_type)
        near[room] += pair_counts(scene.visible)
        goals[room] |= set(scene.goals)
    parents = [parent_rewards(n, objects, g) for n, g in zip(near, goals, strict=True)]
    return Knowledge(
        words=words, text=text, parents=np.stack(parents),
        adjacency=adjacency(near.sum(0)) if links is None else links,
        **(_from_detections(scenes, seed) if scenes[0].detections.shape[2] else {}),
    )  # fmt: skip


def _from_detections(scenes: Sequence[OfflineScene], seed: int) -> dict[str, np.ndarray]:
    """Zones, their edges, and the layout prior."""
    count, rng = len(scenes[0].objects), np.random.default_rng(seed)
    pairs = np.zeros((len(ROOM_TYPES), count, count))
    rooms: list[list[ZoneGraph]] = [[] for _ in ROOM_TYPES]
    for scene in scenes:
        room, seen = ROOM_TYPES.index(scene.room_type), detected(scene.detections, scene.fields)
        pairs[room] += pair_counts(seen)
        rooms[room].append(zone_graph(seen, scene.position, scene.positions, rng))
    merged = [merge(graphs, count) for graphs in rooms]
    return {
        "zones": np.stack([g.nodes for g in merged]).astype(np.float32),
        "zone_edges": np.stack([g.edges for g in merged]).astype(np.float32),
        "layout": layout_prior(pairs),
    }


def _common_objects(scenes: Sequence[OfflineScene]) -> tuple[str, ...]:
    """The scenes' objects; raises unless all scenes share them and a perception."""
    if not scenes:
        raise SceneError("found no scenes; name the training rooms to learn from")
    first = scenes[0]
    for scene in scenes:
        if (scene.objects, scene.perception) != (first.objects, first.perception):
            raise SceneError(
                f"found {scene.name} with {len(scene.objects)} objects by perception "
                f"{scene.perception} beside {first.name} with {len(first.objects)} by "
                f"{first.perception}; make all of them with the same one"
            )
    return first.objects
