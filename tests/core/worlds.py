"""Small hand-made scenes: an open hall with a few pillars, in two kinds of pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from cfnav_core.perception.perception import FEATURES
from cfnav_core.scenes.scene import HEADINGS, HORIZONS, OfflineScene
from cfnav_core.task.actions import NUM_ACTIONS, Action
from cfnav_core.task.camera import MAST
from cfnav_core.task.detections import SCORES, SIGHTINGS
from cfnav_core.task.vocabulary import CATEGORIES, CATEGORY_ID

STEPS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))


def hall(
    width: int = 6, depth: int = 5, pillars: tuple[tuple[int, int], ...] = ((2, 2),),
    goals: dict[str, tuple[int, int]] | None = None, seed: int = 0, name: str = "kitchen:0",
) -> OfflineScene:  # fmt: skip
    """A grid of cells; a goal is visible from states up to one cell away that face it level.

    The features of a state are a fixed random code, so a network can learn every state by heart.
    """
    if goals is None:
        goals = {"Laptop": (width - 1, depth - 1), "Mug": (0, depth - 1)}
    cells = [(i, j) for i in range(width) for j in range(depth) if (i, j) not in pillars]
    index = {c: k for k, c in enumerate(cells)}
    per = HEADINGS * HORIZONS
    states = len(cells) * per
    next_state = np.tile(np.arange(states, dtype=np.int32)[:, None], (1, NUM_ACTIONS))
    collided = np.zeros(states, bool)
    visible = np.zeros((states, len(CATEGORIES)), bool)
    for s in range(states):
        (i, j), heading, horizon = cells[s // per], s // HORIZONS % HEADINGS, s % HORIZONS
        di, dj = STEPS[heading]
        target = index.get((i + di, j + dj))
        corner = (i + di, j) in index and (i, j + dj) in index
        collided[s] = target is None or (di and dj and not corner)
        base = s // per * per
        if not collided[s]:
            next_state[s, Action.MoveAhead] = target * per + heading * HORIZONS + horizon
        next_state[s, Action.RotateLeft] = base + (heading + 1) % HEADINGS * HORIZONS + horizon
        next_state[s, Action.RotateRight] = base + (heading - 1) % HEADINGS * HORIZONS + horizon
        next_state[s, Action.LookUp] = base + heading * HORIZONS
        next_state[s, Action.LookDown] = base + heading * HORIZONS + 1
        for goal, (gi, gj) in goals.items():
            here = (i, j) == (gi, gj) or (i + di, j + dj) == (gi, gj)
            visible[s, CATEGORY_ID[goal]] = here and horizon == 0
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(states, FEATURES)).astype(np.float16)
    detections = np.zeros((states, len(CATEGORIES), 5), np.float16)
    detections[..., 0] = detections[..., 4] = visible
    positions = np.array(cells, np.float32) * 0.25
    index, names = np.arange(states), tuple(goals)
    distance = np.full((len(cells), len(CATEGORIES)), np.inf, np.float32)
    for goal, cell in goals.items():
        distance[:, CATEGORY_ID[goal]] = np.hypot(*(positions - np.array(cell) * 0.25).T)
    return OfflineScene(
        name=name, room_type=name.split(":")[0], perception="test", source="test",
        objects=CATEGORIES, goals=names, features=features, detections=detections,
        next_state=next_state, collided=collided, visible=visible,
        position=(index // per).astype(np.int32),
        heading=(index // HORIZONS % HEADINGS).astype(np.int8),
        horizon=(index % HORIZONS).astype(np.int8), positions=positions,
        instances=np.array([c in names for c in CATEGORIES], np.int16), distance=distance,
        fields=SCORES, camera=MAST,
    )  # fmt: skip


def seen_hall(seed: int, name: str, wanted: tuple[str, ...] = ("Laptop", "Mug")) -> OfflineScene:
    """A hall of 5 x 5 cells with five pillars at random, whose pictures say what stands around.

    Features are the free cells in each of eight directions, seen from the robot, and the tilt.
    Detections are bearing and distance of a goal within 45 degrees. A goal is visible up to two
    cells away. So what is learnt in some halls holds in others.
    """
    rng = np.random.default_rng(seed)
    cells = [divmod(int(k), 5) for k in rng.permutation(25)]
    goals = dict(zip(wanted, cells, strict=False))
    scene = hall(5, 5, tuple(cells[2:7]), goals, seed, name)
    free, at = np.zeros(scene.num_states), np.arange(scene.num_states)
    for _ in range(2):
        free += ~scene.collided[at]
        at = scene.next_state[at, Action.MoveAhead]
    features, turned = np.zeros_like(scene.features), np.arange(scene.num_states)
    for direction in range(HEADINGS):
        features[:, direction] = free[turned] / 2
        turned = scene.next_state[turned, Action.RotateLeft]
    features[:, HEADINGS] = scene.horizon
    detections, visible = np.zeros_like(scene.detections), np.zeros_like(scene.visible)
    for goal, cell in goals.items():
        away = np.array(cell) - scene.positions[scene.position] / 0.25
        cells_away = np.hypot(*away.T)
        bearing = np.arctan2(away[:, 1], away[:, 0]) - scene.heading * np.pi / 4
        seen = (np.cos(bearing) > 0.7) | (cells_away == 0)
        near = seen & (cells_away <= 2) & (scene.horizon == 0)
        columns = np.ones_like(bearing), np.sin(bearing), np.cos(bearing), cells_away / 5, near
        detections[:, CATEGORY_ID[goal]] = np.stack(columns, 1) * seen[:, None]
        visible[:, CATEGORY_ID[goal]] = near
    return replace(scene, features=features, detections=detections, visible=visible)


def two_halls(folder: Path) -> Path:
    """Two rooms of one plan, to train in and to validate in, as scenes in a folder."""
    for seed in range(2):
        hall(4, 3, seed=0, name=f"kitchen:{seed}").save(folder / f"kitchen_{seed:05d}")
    return folder


def sighted(seen: OfflineScene, made_by: str = "boxes") -> OfflineScene:
    """The same scene through a detector that sees what is visible."""
    sightings = np.zeros((seen.num_states, len(CATEGORIES), len(SIGHTINGS)), np.float16)
    sightings[seen.visible] = [0.9, 0.1, 0, 0.1, 0.1, 1.0]
    return replace(seen, fields=SIGHTINGS, detections=sightings, perception=made_by)
