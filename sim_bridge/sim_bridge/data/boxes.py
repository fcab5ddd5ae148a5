"""What a detector would say in every state of rooms: ``cfnav rooms boxes --out DIR``.

Scenes of sightings: true boxes with a detector's errors, seen as directions, and a distance as a
robot would know it. No picture is looked at. Their features, from which a predictor learns, are
what the LiDAR measures ahead. Rooms already in DIR are kept.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from tqdm import tqdm

from cfnav_core.command import need
from cfnav_core.detect.detector import LEAST
from cfnav_core.detect.errors import SHIPPED, ErrorModel, Thing
from cfnav_core.detect.sightings import (
    SIZES,
    Ranging,
    Sighting,
    by_ranges,
    by_size,
    known_sizes,
    sighted,
    table,
)
from cfnav_core.files.provenance import sha256
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.pinhole import Pinhole
from cfnav_core.task.rooms import room_folder
from cfnav_core.task.vocabulary import CATEGORIES
from sim_bridge.data.asked import Furniture, Rooms, asked_for, keep_others, made_of_each
from sim_bridge.data.goals import left_out
from sim_bridge.data.states import bare_scene, in_how_many
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.room.room import generate_room, room_source

BOXES_VERSION = 4
"""Rises when the same scene gets other boxes or features; a test holds it."""

By = Literal["size", "lidar", "depth", "nothing"]

MIXED: tuple[By, ...] = ("size", "lidar", "depth")

DEPTH_ERROR, DEPTH_BLIND = 0.04, 0.1
"""Standard deviation of a stereo camera's distance as a share of it, and of how many things it has
none; ours, for want of a robot to measure it on."""

BEAMS = np.radians(np.arange(-89.75, 90.0, 0.5))
"""Bearings of the LiDAR that a box can lie in: all that a camera which looks ahead can see."""

SECTOR = 4
"""Beams that a feature is the nearest of."""


@dataclass(frozen=True)
class BoxOptions:
    """Make scenes of a detector's boxes, from which a policy learns that needs no more.

    Without --rooms of data2:train.
    """

    out: Path
    """Folder that gets one sub-folder for each room."""
    rooms: Rooms = field(default_factory=list)
    furniture: Furniture = "built_in"
    camera: str = "stock_wide"
    """Whose view: mast, stock_wide, stock_preview, lite, or a JSON file like a scene's camera."""
    errors: Path = SHIPPED
    """The detector's errors (python -m studies.eyes.errors)."""
    distance: Literal["size", "lidar", "depth", "nothing", "mixed"] = "mixed"
    """How it is known how far a thing is: by how large things of its name are, by the LiDAR in the
    direction of its box, by a depth camera, or not; mixed: one of the first three in each room."""
    least: float = LEAST
    """Score of what counts, as the policy node's ``detections.least``."""
    processes: int = 2
    """Rooms made at the same time."""

    def run_command(self) -> None:
        """Make them."""
        run(self)

    @property
    def kind(self) -> str:
        """What makes the boxes."""
        errors, sizes = sha256(self.errors)[:8], sha256(SIZES)[:8]
        made = f"boxes {BOXES_VERSION}, errors {errors}, sizes {sizes}, far by {self.distance}"
        return made if self.least == LEAST else f"{made}, from {self.least:g} on"


def way_of(kind: str, seed: int, options: BoxOptions) -> By:
    """How distances are known in a room."""
    if options.distance != "mixed":
        return options.distance
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed, BOXES_VERSION, 1])
    return MIXED[rng.integers(len(MIXED))]


def box_scene(kind: str, seed: int, options: BoxOptions) -> None:
    """Make one room's."""
    # few need MuJoCo
    from sim_bridge.world.camera import Camera, pixels_of
    from sim_bridge.world.grid import state_grid
    from sim_bridge.world.things import Things
    from sim_bridge.world.world import World

    set_up = CameraSetUp.read(options.camera)
    world = World(generate_room(kind, seed), set_up.on_mast)
    grid = state_grid(world, set_up.horizons)
    model, pinhole = ErrorModel.load(options.errors), Pinhole.of(set_up)
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed, BOXES_VERSION])
    noise, far = Noise(NoiseLevels(), seed), _rangings(rng)[way_of(kind, seed, options)]
    degree = pinhole.fx * np.radians(1)
    visible, features, rows = [], [], []
    with Camera(world, set_up) as camera:
        things = Things(camera)
        for state in range(len(grid.next_state)):
            pose = grid.pose(state)
            owner = camera.owners(pose)
            pixels = pixels_of(owner, len(world.room.objects))
            visible.append(camera.visible_categories(pose, pixels))
            ranges = noise.scan(world.scan(BEAMS, pose))
            features.append(nearness(ranges))
            ranging = far(ranges)
            said = model.says(things.seen(pose, owner), CATEGORIES, set_up.size, degree, rng)
            seen = [
                (sighted(found, pinhole, pose.tilt), thing)
                for found, thing in said if found.score >= options.least
            ]  # fmt: skip
            rows.append(table((replace(s, distance=ranging(s, of)) for s, of in seen), CATEGORIES))
    scene = bare_scene(world, grid, set_up, room_source(kind), CATEGORIES, np.stack(visible))
    replace(
        scene, perception=options.kind, fields=SIGHTINGS,
        features=np.stack(features), detections=np.stack(rows),
    ).save(room_folder(options.out, kind, seed))  # fmt: skip


def nearness(ranges: np.ndarray) -> np.ndarray:
    """How near the nearest return is in every sector: float16 [N / SECTOR], 0 of none, 1 of 0 m.

    Args:
        ranges: float [N], metres, inf where nothing returns.
    """
    nearest = ranges.reshape(-1, SECTOR).min(1)
    return (1 / (1 + nearest)).astype(np.float16)


Far = Callable[[Sighting, Thing | None], float]
"""How far away a sighting is taken to be, by what the thing is that it is of; metres, 0 unknown."""


def _rangings(rng: np.random.Generator) -> dict[By, Callable[[np.ndarray], Far]]:
    """For each way to know distances, how they are known where ``BEAMS`` have some ranges."""
    from sim_bridge.world.world import LIDAR_X

    sizes = by_size(known_sizes())

    def around(ranges: np.ndarray) -> Ranging:
        returned = np.isfinite(ranges)
        far, bearing = ranges[returned], BEAMS[returned]
        x, y = LIDAR_X + far * np.cos(bearing), far * np.sin(bearing)
        return by_ranges(np.arctan2(y, x), np.hypot(x, y))

    def lidar(ranges: np.ndarray) -> Far:
        ranging = around(ranges)
        return lambda sighting, _: ranging(sighting)

    def depth(ranges: np.ndarray) -> Far:
        behind = around(ranges)  # a camera measures something also where nothing is that was said

        def far(sighting: Sighting, thing: Thing | None) -> float:
            if rng.random() < DEPTH_BLIND:
                return 0.0
            true = thing.distance if thing else behind(sighting)
            return true * max(1 + rng.normal(0, DEPTH_ERROR), 0.0)

        return far

    return {
        "size": lambda _: lambda sighting, _: sizes(sighting),
        "lidar": lidar,
        "depth": depth,
        "nothing": lambda _: lambda *_: 0.0,
    }


def _there(kind: str, seed: int, options: BoxOptions) -> bool:
    """Whether a room's is there and would be the same again."""
    try:
        made = OfflineScene.load(room_folder(options.out, kind, seed))
    except SceneError:
        return False
    expected = options.kind, room_source(kind), CameraSetUp.read(options.camera)
    return (made.perception, made.source, made.camera) == expected


def run(options: BoxOptions) -> None:
    """Make every room's that is not there yet.

    Raises:
        ValueError: bad rooms, camera, errors or score, or furniture that is not installed.
        OSError: a file cannot be written.
    """
    need("mujoco")
    from sim_bridge.world import gl  # noqa: F401  (fails here, once, when nothing can draw)

    ErrorModel.load(options.errors)
    CameraSetUp.read(options.camera)
    if not 0 <= options.least <= 1:
        raise ValueError(f"found --least {options.least:g}, expected a score from 0 to 1")
    rooms = asked_for(options.rooms or ["data2:train"], options.furniture)
    todo = [room for room in rooms if not _there(*room, options)]
    keep_others(todo, options.out, "sightings", CameraSetUp.read(options.camera))
    made = made_of_each(box_scene, todo, options, processes=options.processes)
    for _ in tqdm(made, total=len(todo), unit="room"):
        pass
    print(f"{len(rooms)} rooms in {options.out} ({len(rooms) - len(todo)} were there already)")
    print(left_out([in_how_many(OfflineScene.load(room_folder(options.out, *r))) for r in rooms]))
