"""Render rooms: ``python -m sim_bridge.dataset --out DIR``.

Without ``--rooms`` these are the 120 rooms of the splits (see ``cfnav_core.rooms``). Without
``--views`` every reachable state of each room goes through the bundle's perception and becomes an
``OfflineScene``. With ``--views N`` N random states become a ``PictureSet`` for training
perception. Rooms already in DIR are kept, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import signal
import sys
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tqdm import tqdm

from cfnav_core.bundle import shipped_bundle
from cfnav_core.perception import INPUT_SIZE, Perception, preprocess
from cfnav_core.picture_set import COARSE, HEAT, PictureSet
from cfnav_core.rooms import parse_rooms, room_folder
from cfnav_core.scene import PICTURES, OfflineScene, SceneError, changed_files, read_head
from cfnav_core.source import source_identity
from cfnav_core.vocabulary import CATEGORIES
from cfnav_core.whole import whole, writing
from sim_bridge.room import Room, generate_room
from sim_bridge.visual_shift import shifted

BATCH = 64
MIN_GOAL_STATES = 4
"""A goal seen from fewer states of a room is not asked for there."""


@dataclass(frozen=True)
class Options:
    """Render rooms into offline scenes or labelled pictures."""

    rooms: Annotated[list[str], tyro.conf.UseAppendAction] = field(default_factory=list)
    """TYPE:SEED, TYPE:FIRST-LAST or a split such as data2:train, given as often as needed; the 120
    rooms of all splits when absent."""
    out: Path = Path("out/scenes")
    """Folder that gets one sub-folder for each room."""
    perception: Path | None = None
    """perception.onnx; the shipped bundle's when absent."""
    keep_pictures: bool = False
    """Keep every picture (68 kB a state), to make features again when perception changes."""
    visual_shift: float = 0.0
    """Another light and lens than in training, 0 to 1 (sim_bridge.visual_shift); keep such rooms in
    a folder of their own."""
    views: int = 0
    """Random views a room instead of every state, for training perception."""
    processes: int = 2
    """Rooms rendered at the same time."""


ROOM_FILES = (
    "parts", "textures", "furniture", "fixtures", "objects", "room", "meshes", "world", "camera",
    "grid",
)  # fmt: skip
"""Modules that decide what rooms and their pictures are."""


def room_source(visual_shift: float = 0.0) -> str:
    """Identity of the program that makes rooms and pictures."""
    found = source_identity(Path(__file__).parent / f"{name}.py" for name in ROOM_FILES)
    return found + (f" shifted by {visual_shift}" if visual_shift else "")


def render_scene(
    kind: str, seed: int, out: Path, perception: Path, keep_pictures: bool, visual_shift: float = 0
) -> int:
    """Make the scene of a room; returns its number of states.

    Pictures kept from an earlier run of the same program are not rendered again.
    """
    folder, observe = room_folder(out, kind, seed), Perception(perception)
    old = _kept(folder, visual_shift)
    if old is None:
        scene, pictures = _render(kind, seed, visual_shift)
        if keep_pictures:
            _keep(folder, pictures)
    else:
        scene, pictures = old, np.load(folder / PICTURES, mmap_mode="r")
    rows = [observe(pictures[i : i + BATCH]) for i in range(0, len(pictures), BATCH)]
    replace(
        scene, perception=observe.identity,
        features=np.concatenate([r.features for r in rows]),
        detections=np.concatenate([r.detections for r in rows]),
    ).save(folder)  # fmt: skip
    return len(pictures)


def _keep(folder: Path, pictures: np.ndarray) -> None:
    path = folder / PICTURES
    with writing(path):
        folder.mkdir(parents=True, exist_ok=True)
        with whole(path) as partial, partial.open("wb") as file:
            np.save(file, pictures)


def _kept(folder: Path, visual_shift: float) -> OfflineScene | None:
    """The scene whose pictures can be used again."""
    scene = _whole(folder)
    same = scene and scene.source == room_source(visual_shift) and (folder / PICTURES).exists()
    return scene if same else None


def _whole(folder: Path) -> OfflineScene | None:
    """The scene of a folder; None when it is missing or damaged, so that it is made again."""
    try:
        changed = changed_files(folder, read_head(folder)["sha256"])
        return None if changed else OfflineScene.load(folder)
    except SceneError:
        return None


def _render(kind: str, seed: int, visual_shift: float) -> tuple[OfflineScene, np.ndarray]:
    """Transitions, visibility and pictures uint8 [S, 150, 150, 3] of a room, without features."""
    from sim_bridge.camera import Camera
    from sim_bridge.grid import state_grid
    from sim_bridge.world import World

    world = World(generate_room(kind, seed))
    grid = state_grid(world)
    states = len(grid.next_state)
    pictures = np.empty((states, INPUT_SIZE, INPUT_SIZE, 3), np.uint8)
    visible = np.zeros((states, len(CATEGORIES)), bool)
    with Camera(world) as camera:
        for state in range(states):
            pose = grid.pose(state)
            picture = camera.picture(pose)
            pictures[state] = preprocess(shifted(picture.rgb, visual_shift))
            visible[state] = camera.visible_categories(
                pose, picture.pixels(len(world.room.objects))
            )
    none = np.empty((states, 0), np.float16)
    often = visible.sum(0) >= MIN_GOAL_STATES
    goals = tuple(name for name, enough in zip(CATEGORIES, often, strict=True) if enough)
    scene = OfflineScene(
        name=f"{kind}:{seed}", room_type=kind, perception="",
        source=room_source(visual_shift),
        objects=CATEGORIES, goals=goals, features=none, detections=none,
        next_state=grid.next_state, collided=grid.collided, visible=visible,
        position=grid.position, heading=grid.heading, horizon=grid.horizon,
        positions=grid.positions,
        **_instances(world.room, grid.positions),
    )  # fmt: skip
    return scene, pictures


def _instances(room: Room, positions: np.ndarray) -> dict[str, np.ndarray]:
    """How many of each category a room has, and how far the nearest is from each position."""
    instances = np.zeros(len(CATEGORIES), np.int16)
    distance = np.full((len(positions), len(CATEGORIES)), np.inf, np.float32)
    for thing in room.objects:
        if thing.name in CATEGORIES:
            category = CATEGORIES.index(thing.name)
            x0, y0, x1, y1 = thing.footprint
            away = np.hypot(*(positions - np.array([(x0 + x1) / 2, (y0 + y1) / 2])).T)
            distance[:, category] = np.minimum(distance[:, category], away)
            instances[category] += 1
    return {"instances": instances, "distance": distance}


def render_views(kind: str, seed: int, out: Path, views: int, visual_shift: float = 0) -> int:
    """Render random states of a room with labels; returns their number."""
    from sim_bridge.camera import Camera
    from sim_bridge.grid import state_grid
    from sim_bridge.world import World

    world = World(generate_room(kind, seed))
    grid = state_grid(world)
    objects = world.room.objects
    category = np.array(
        [CATEGORIES.index(o.name) if o.name in CATEGORIES else -1 for o in objects] + [-1]
    )
    flat = np.array([o.name in ("Floor", "Rug") for o in objects] + [False])
    rng = np.random.default_rng(seed)
    states = rng.choice(len(grid.next_state), min(views, len(grid.next_state)), replace=False)
    rows = []
    with Camera(world) as camera:
        for state in states:
            pose = grid.pose(int(state))
            picture = camera.picture(pose)
            rows.append((
                preprocess(shifted(picture.rgb, visual_shift)), _heat(category[picture.owner]),
                _coarse(picture.depth).astype(np.float16),
                (_coarse(flat[picture.owner]) * 255).astype(np.uint8),
                camera.visible_categories(pose, picture.pixels(len(objects))),
            ))  # fmt: skip
    PictureSet(*map(np.stack, zip(*rows, strict=True))).save(room_folder(out, kind, seed))
    return len(states)


def _coarse(full: np.ndarray) -> np.ndarray:
    """Mean of a [300, 300] map over 10x10 cells."""
    return full.reshape(COARSE, 30, COARSE, 30).mean((1, 3))


def _heat(category: np.ndarray) -> np.ndarray:
    """uint8 [19, 19, C] pixels of each category per cell, from int [300, 300] category ids."""
    padded = np.pad(category, 2, constant_values=-1)
    cell = np.arange(HEAT * 16) // 16
    index = (cell[:, None] * HEAT + cell[None]) * (len(CATEGORIES) + 1) + padded + 1
    counts = np.bincount(index.ravel(), minlength=HEAT * HEAT * (len(CATEGORIES) + 1))
    return np.minimum(counts.reshape(HEAT, HEAT, -1)[..., 1:], 255).astype(np.uint8)


def _finished(folder: Path, options: Options, perception: Path) -> bool:
    if options.views:
        return (folder / "set.json").exists()
    scene = _whole(folder)
    made_with = (Perception(perception).identity, room_source(options.visual_shift))
    return scene is not None and (scene.perception, scene.source) == made_with


def run(options: Options) -> None:
    """Render every room that is not there yet.

    Raises:
        ValueError: bad rooms, or a room that cannot be rendered (named in the message).
    """
    if options.views and not options.rooms:
        raise ValueError(
            "found --views without --rooms; perception must not learn from rooms that test, so "
            "name others, for example --rooms kitchen:1000-1124"
        )
    if not 0 <= options.visual_shift <= 1:
        raise ValueError(
            f"found --visual-shift {options.visual_shift}, expected a number from 0 to 1"
        )
    rooms = parse_rooms(options.rooms or ["data2"])
    from sim_bridge import gl  # noqa: F401  (fails here, once, when nothing can draw)

    perception = options.perception or shipped_bundle() / "perception.onnx"
    if not options.views:
        Perception(perception)
    todo = [r for r in rooms if not _finished(room_folder(options.out, *r), options, perception)]
    with ProcessPoolExecutor(options.processes, get_context("spawn")) as pool:
        jobs = {
            pool.submit(render_views, *room, options.out, options.views, options.visual_shift)
            if options.views
            else pool.submit(
                render_scene,
                *room,
                options.out,
                perception,
                options.keep_pictures,
                options.visual_shift,
            ): room
            for room in todo
        }
        bar = tqdm(as_completed(jobs), total=len(jobs), unit="room", mininterval=2.0)
        states = 0
        try:
            for job in bar:
                states += _result(job, jobs[job])
                bar.set_postfix_str(f"{states} states")
        except BaseException:
            # rooms in work are finished and kept, the others not begun
            pool.shutdown(cancel_futures=True)
            raise
    print(f"{len(rooms)} rooms in {options.out} ({len(rooms) - len(todo)} were there already)")


def _result(job: Future[int], room: tuple[str, int]) -> int:
    try:
        return job.result()
    except Exception as error:
        kind, seed = room
        raise ValueError(f"room {kind}:{seed} could not be rendered: {error}") from error


def main() -> None:
    """Entry point: exit 2 with one sentence on bad input."""
    # a plain SIGTERM would leave the workers behind
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("dataset: ended by SIGTERM"))
    try:
        run(tyro.cli(Options))
    except (ValueError, ImportError, OSError) as error:
        print(f"dataset: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
