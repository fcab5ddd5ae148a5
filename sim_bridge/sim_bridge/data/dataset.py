"""Render rooms: ``cfnav rooms make --out DIR``.

Without ``--rooms`` these are the 120 rooms of the splits (see ``cfnav_core.task.rooms``). Without
``--views`` every reachable state of each room goes through the bundle's perception and becomes an
``OfflineScene``. With ``--views N`` N random states become a ``PictureSet`` for training
perception. Rooms already in DIR are kept, so an interrupted run goes on where it stopped; those of
another kind, camera or light are never written over.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from cfnav_core.command import need, run_options
from cfnav_core.files.provenance import made_by, sign
from cfnav_core.files.whole import remove, whole, writing
from cfnav_core.perception.perception import NETWORKS, OnnxPerception, Percept, built_in
from cfnav_core.perception.picture_set import FIELDS, PictureSet
from cfnav_core.perception.sight import CELL, Sight
from cfnav_core.scenes.scene import PICTURES, OfflineScene, SceneError, changed_files, read_head
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.rooms import room_folder
from cfnav_core.task.vocabulary import CATEGORIES
from sim_bridge.data.asked import Furniture, Rooms, asked_for, keep_others, made_of_each
from sim_bridge.data.goals import left_out
from sim_bridge.data.states import bare_scene, in_how_many, sampled_visible
from sim_bridge.room.room import generate_room, room_source
from sim_bridge.world.visual_shift import shifted


@dataclass(frozen=True)
class RoomOptions:
    """Render rooms into offline scenes or labelled pictures.

    Without --rooms the 120 of data2.
    """

    rooms: Rooms = field(default_factory=list)
    out: Path = Path("out/scenes")
    """Folder that gets one sub-folder for each room."""
    perception: Path | None = None
    """perception.onnx; when absent that which comes with cfnav for the camera."""
    keep_pictures: bool = False
    """Keep every picture (68 kB a state), to make features again when perception changes."""
    camera: str = "mast"
    """Whose view: mast, stock_wide or stock_preview (a TurtleBot 4 as sold: its whole picture, or
    the small square one), lite (a TurtleBot 4 Lite), or a JSON file like a scene's camera."""
    visual_shift: float = 0.0
    """Another light and lens than in training, 0 to 1 (sim_bridge.world.visual_shift); keep such
    rooms in a folder of their own."""
    views: int = 0
    """Random views a room instead of every state, for training perception."""
    processes: int = 2
    """Rooms rendered at the same time."""
    furniture: Furniture = "built_in"

    def run_command(self) -> None:
        """Render."""
        run(self)


@dataclass(frozen=True)
class Look:
    """How rooms are looked at.

    Attributes:
        camera: whose view.
        perception: the network's file.
        visual_shift: see ``RoomOptions``. keep_pictures: see ``RoomOptions``.
    """

    camera: CameraSetUp
    perception: Path
    visual_shift: float = 0.0
    keep_pictures: bool = False


def render_scene(kind: str, seed: int, out: Path, look: Look) -> int:
    """Make the scene of a room; returns its number of states.

    Of an earlier run of the same version what another perception leaves as it is stays: what is
    visible where, and pictures that were kept, where it takes such.
    """
    folder, perception = room_folder(out, kind, seed), OnnxPerception(look.perception)
    before, percept = _before(folder, kind, look), perception.gives
    if before and before.objects == percept.objects and _has_pictures(folder, kind, look, percept):
        scene, pictures = before, np.load(folder / PICTURES, mmap_mode="r")
    else:
        scene, pictures = _render(kind, seed, look, percept, before)
        remove(folder / PICTURES)
        if look.keep_pictures:
            _keep(folder, pictures, _pictures_of(kind, look, percept))
    perceived = perception(pictures)
    replace(
        scene, perception=perception.identity, fields=perception.gives.fields,
        features=perceived.features, detections=perceived.detections,
    ).save(folder)  # fmt: skip
    return len(pictures)


def _keep(folder: Path, pictures: np.ndarray, of: str) -> None:
    path = folder / PICTURES
    with writing(path):
        folder.mkdir(parents=True, exist_ok=True)
        with whole(path) as partial, partial.open("wb") as file:
            np.save(file, pictures)
    sign(path, of)


def _pictures_of(kind: str, look: Look, percept: Percept) -> str:
    """What kept pictures are of, so that others are not taken for them."""
    size = " x ".join(map(str, percept.size))
    camera = json.dumps(look.camera.to_json())
    return f"{room_source(kind, look.visual_shift)} by {camera}, made {size}"


def _has_pictures(folder: Path, kind: str, look: Look, percept: Percept) -> bool:
    return made_by(folder / PICTURES) == _pictures_of(kind, look, percept)


def _before(folder: Path, kind: str, look: Look) -> OfflineScene | None:
    """The scene of an earlier run, when it is of the same room seen alike."""
    scene = _whole(folder)
    made_with = room_source(kind, look.visual_shift), look.camera
    return scene if scene and (scene.source, scene.camera) == made_with else None


def _whole(folder: Path) -> OfflineScene | None:
    """The scene of a folder; None when it is missing or damaged, so that it is made again."""
    try:
        changed = changed_files(folder, read_head(folder)["sha256"])
        return None if changed else OfflineScene.load(folder)
    except SceneError:
        return None


def _render(
    kind: str, seed: int, look: Look, percept: Percept, before: OfflineScene | None
) -> tuple[OfflineScene, np.ndarray]:
    """Transitions, visibility and pictures uint8 [S, H, W, 3] of a room, without features.

    What is visible is taken from the scene before, where there is one of the same objects.
    """
    from sim_bridge.world.camera import Camera
    from sim_bridge.world.grid import state_grid
    from sim_bridge.world.world import World

    world = World(generate_room(kind, seed), look.camera.on_mast)
    grid = state_grid(world, look.camera.horizons)
    states, objects = np.arange(len(grid.next_state)), percept.objects
    pictures = np.empty((len(states), *percept.size, 3), np.uint8)
    with Camera(world, look.camera) as camera:
        for state in states:
            rgb = camera.rgb(grid.pose(int(state)))
            pictures[state] = percept.preprocess(shifted(rgb, look.visual_shift))
    if before is not None and before.objects == objects:
        visible = np.array(before.visible)
    else:
        visible = sampled_visible(world, grid, look.camera, objects, states)
    source = room_source(kind, look.visual_shift)
    return bare_scene(world, grid, look.camera, source, objects, visible), pictures


def render_views(kind: str, seed: int, out: Path, look: Look, views: int) -> int:
    """Render random states of a room with labels; returns their number."""
    from sim_bridge.world.camera import Camera, pixels_of
    from sim_bridge.world.grid import state_grid
    from sim_bridge.world.world import World

    world = World(generate_room(kind, seed), look.camera.on_mast)
    grid = state_grid(world, look.camera.horizons)
    objects = world.room.objects
    category = np.array(
        [CATEGORIES.index(o.name) if o.name in CATEGORIES else -1 for o in objects] + [-1]
    )
    flat = np.array([o.name in ("Floor", "Rug") for o in objects] + [False])
    sight, percept = Sight.of(look.camera), built_in(look.camera)
    rng = np.random.default_rng(seed)
    states = rng.choice(len(grid.next_state), min(views, len(grid.next_state)), replace=False)
    rows = []
    with Camera(world, look.camera) as camera:
        for state in states:
            pose = grid.pose(int(state))
            picture = camera.picture(pose)
            seen = camera.visible_things(pose, pixels_of(picture.owner, len(objects)))
            near = np.where(np.append(seen, False), category, -1)
            rows.append((
                percept.preprocess(shifted(picture.rgb, look.visual_shift)),
                _heat(category[picture.owner], sight),
                _heat(near[picture.owner], sight),
                _coarse(picture.depth, sight).astype(np.float16),
                (_coarse(flat[picture.owner], sight) * 255).astype(np.uint8),
            ))  # fmt: skip
    arrays = dict(zip(FIELDS, map(np.stack, zip(*rows, strict=True)), strict=True))
    source = room_source(kind, look.visual_shift)
    PictureSet(
        **arrays, objects=CATEGORIES, camera=look.camera, source=source, states=len(grid.next_state)
    ).save(room_folder(out, kind, seed))
    return len(states)


def _coarse(full: np.ndarray, sight: Sight) -> np.ndarray:
    """Mean of a map of the camera's picture over the coarse cells: float32 [*R]."""
    rows, columns = sight.coarse
    return np.asarray(
        cv2.resize(full.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    )


def _heat(category: np.ndarray, sight: Sight) -> np.ndarray:
    """uint8 [*Q, C] pixels of each category per cell, from int [H, W] ids of the full picture."""
    (rows, columns), side, kinds = sight.heat, 2 * CELL, len(CATEGORIES) + 1
    category = category[: rows * side, : columns * side]  # without what halving an odd side leaves
    spare = rows * side - category.shape[0], columns * side - category.shape[1]
    around = [(gap // 2, gap - gap // 2) for gap in spare]
    padded = np.pad(category, around, constant_values=-1)
    down, across = np.arange(rows * side) // side, np.arange(columns * side) // side
    index = (down[:, None] * columns + across) * kinds + padded + 1
    counts = np.bincount(index.ravel(), minlength=rows * columns * kinds)
    return np.minimum(counts.reshape(rows, columns, -1)[..., 1:], 255).astype(np.uint8)


def _finished(kind: str, seed: int, options: RoomOptions, look: Look) -> bool:
    folder = room_folder(options.out, kind, seed)
    made_with = room_source(kind, look.visual_shift), look.camera
    if options.views:
        try:
            there = PictureSet.load(folder)
        except ValueError:  # missing or damaged
            return False
        asked = min(options.views, there.states)
        return (there.source, there.camera) == made_with and len(there.pictures) >= asked
    scene, perception = _whole(folder), OnnxPerception(look.perception)
    if look.keep_pictures and not _has_pictures(folder, kind, look, perception.gives):
        return False
    return scene is not None and (perception.identity, *made_with) == (
        scene.perception, scene.source, scene.camera
    )  # fmt: skip


def _network(options: RoomOptions) -> Path:
    """What looks at the pictures; views are for training it, and looked at by nobody.

    Raises:
        ValueError: none is given, and none that comes with cfnav learnt from the camera.
    """
    found = options.perception or NETWORKS.get(options.camera)
    if found is None and not options.views:
        raise ValueError(
            f"found no --perception for the camera {options.camera}, and networks come with cfnav "
            f"for {' and '.join(NETWORKS)} alone; train one (cfnav perception) or give one"
        )
    return found or NETWORKS["mast"]


def run(options: RoomOptions) -> None:
    """Render every room that is not there yet.

    Raises:
        ValueError: bad rooms, a room that cannot be rendered (named in the message), or one that is
            there and was made otherwise.
    """
    if options.views < 0:
        raise ValueError(f"found --views {options.views}, expected 1 or more, or none at all")
    if options.views and not options.rooms:
        raise ValueError(
            "found --views without --rooms; perception must not learn from rooms that test, so "
            "name others, for example --rooms kitchen:1000-1124"
        )
    if not 0 <= options.visual_shift <= 1:
        raise ValueError(
            f"found --visual-shift {options.visual_shift}, expected a number from 0 to 1"
        )
    rooms = asked_for(options.rooms or ["data2"], options.furniture)
    need("mujoco")
    from sim_bridge.world import gl  # noqa: F401  (fails here, once, when nothing can draw)

    look = Look(
        CameraSetUp.read(options.camera), _network(options), options.visual_shift,
        options.keep_pictures,
    )  # fmt: skip
    percept = built_in(look.camera) if options.views else OnnxPerception(look.perception).gives
    percept.check_size(*look.camera.size[::-1])
    if percept.camera and not percept.camera.sees_like(look.camera):
        print(
            f"{look.perception} learnt from another camera than {options.camera}: how well it "
            "knows these pictures nobody measured"
        )
    todo = [r for r in rooms if not _finished(*r, options, look)]
    kind = "views" if options.views else "scenes"
    keep_others(todo, options.out, kind, look.camera, options.visual_shift)
    views = (options.views,) if options.views else ()
    made = made_of_each(
        render_views if views else render_scene, todo, options.out, look, *views,
        processes=options.processes,
    )  # fmt: skip
    states, bar = 0, tqdm(made, total=len(todo), unit="room", mininterval=2.0)
    for count in bar:
        states += count
        bar.set_postfix_str(f"{states} states")
    print(f"{len(rooms)} rooms in {options.out} ({len(rooms) - len(todo)} were there already)")
    if not options.views:
        scenes = [OfflineScene.load(room_folder(options.out, *room)) for room in rooms]
        print(left_out([in_how_many(scene) for scene in scenes]))


def main() -> int:
    """Entry point of ``ros2 run sim_bridge dataset``; the exit code is ``ending``'s."""
    return run_options("dataset", RoomOptions)
