"""What a detector would say in every state: ``cfnav rooms boxes SCENES --out DIR``.

Copies scenes that ``cfnav rooms make`` made, with sightings in place of what their perception
detects: true boxes with a detector's errors, seen as directions, and a distance as a robot would
know it. Their features stay: a predictor learns from them in training, and a policy that reads
boxes only is driven by the LiDAR instead. Rooms already in DIR are kept.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import tyro
from tqdm import tqdm

from cfnav_core.command import need
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
from cfnav_core.task.camera import MAST
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.pinhole import Pinhole
from cfnav_core.task.rooms import parse_rooms, room_folder
from sim_bridge.robot.noise import Noise, NoiseLevels

if TYPE_CHECKING:
    from sim_bridge.world.world import Pose, World

BOXES_VERSION = 3
"""Rises when the same scene gets other boxes; a test holds it."""

By = Literal["size", "lidar", "depth", "nothing"]

MIXED: tuple[By, ...] = ("size", "lidar", "depth")

DEPTH_ERROR, DEPTH_BLIND = 0.04, 0.1
"""Standard deviation of a stereo camera's distance as a share of it, and of how many things it has
none; ours, for want of a robot to measure it on."""

BEAMS = np.radians(np.arange(-90.0, 90.5, 0.5))
"""Bearings of the LiDAR that a box can lie in: all that a camera which looks ahead can see."""


@dataclass(frozen=True)
class BoxOptions:
    """Give scenes the boxes of a detector, from which a policy learns that needs no more."""

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of the scenes (cfnav rooms make)."""
    out: Path
    """Folder for the new ones."""
    rooms: Annotated[list[str], tyro.conf.UseAppendAction] = field(default_factory=list)
    """TYPE:SEED, TYPE:FIRST-LAST or a split, given as often as needed; data2:train when absent."""
    errors: Path = SHIPPED
    """The detector's errors (python -m studies.eyes.errors)."""
    distance: Literal["size", "lidar", "depth", "nothing", "mixed"] = "mixed"
    """How it is known how far a thing is: by how large things of its name are, by the LiDAR in the
    direction of its box, by a depth camera, or not; mixed: one of the first three in each room."""
    processes: int = 2
    """Rooms made at the same time."""

    def run_command(self) -> None:
        """Make them."""
        run(self)

    @property
    def kind(self) -> str:
        """What makes the boxes."""
        errors, sizes = sha256(self.errors)[:8], sha256(SIZES)[:8]
        return f"boxes {BOXES_VERSION}, errors {errors}, sizes {sizes}, far by {self.distance}"


def way_of(kind: str, seed: int, options: BoxOptions) -> By:
    """How distances are known in a room."""
    if options.distance != "mixed":
        return options.distance
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed, BOXES_VERSION, 1])
    return MIXED[rng.integers(len(MIXED))]


def box_scene(kind: str, seed: int, options: BoxOptions) -> None:
    """Make one room's.

    Raises:
        ValueError: there is no scene of it, or one of another version.
    """
    # few need MuJoCo
    from sim_bridge.world.camera import Camera
    from sim_bridge.world.grid import remade
    from sim_bridge.world.things import Things

    scene = OfflineScene.load(room_folder(options.scenes, kind, seed))
    set_up = scene.camera or MAST
    world, grid = remade(scene)
    model, pinhole = ErrorModel.load(options.errors), Pinhole.of(set_up)
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed, BOXES_VERSION])
    far = _rangings(world, seed, rng)[way_of(kind, seed, options)]
    degree = pinhole.fx * np.radians(1)
    rows = []
    with Camera(world, set_up) as camera:
        things = Things(camera)
        for state in range(scene.num_states):
            pose = grid.pose(state)
            there = things.seen(pose, camera.owners(pose))
            said = model.says(there, scene.objects, set_up.size, degree, rng)
            ranging = far(pose)
            seen = [(sighted(found, pinhole, pose.tilt), thing) for found, thing in said]
            rows.append(
                table((replace(s, distance=ranging(s, of)) for s, of in seen), scene.objects)
            )
    replace(
        scene, detections=np.stack(rows), fields=SIGHTINGS,
        perception=f"{options.kind} on {scene.perception}",
    ).save(room_folder(options.out, kind, seed))  # fmt: skip


Far = Callable[[Sighting, Thing | None], float]
"""How far away a sighting is taken to be, by what the thing is that it is of; metres, 0 unknown."""


def _rangings(world: World, seed: int, rng: np.random.Generator) -> dict[By, Callable[[Pose], Far]]:
    """For each way to know distances, how they are known at a pose."""
    from sim_bridge.world.world import LIDAR_X

    noise, sizes = Noise(NoiseLevels(), seed), by_size(known_sizes())

    def around(pose: Pose) -> Ranging:
        ranges = noise.scan(world.scan(BEAMS, pose))
        returned = np.isfinite(ranges)
        far, bearing = ranges[returned], BEAMS[returned]
        x, y = LIDAR_X + far * np.cos(bearing), far * np.sin(bearing)
        return by_ranges(np.arctan2(y, x), np.hypot(x, y))

    def lidar(pose: Pose) -> Far:
        ranging = around(pose)
        return lambda sighting, _: ranging(sighting)

    def depth(pose: Pose) -> Far:
        behind = around(pose)  # a camera measures something also where nothing is that was said

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
    """Whether a room's was made of the scene that there is now."""
    try:
        made = OfflineScene.load(room_folder(options.out, kind, seed))
        scene = OfflineScene.load(room_folder(options.scenes, kind, seed))
    except SceneError:
        return False
    expected = f"{options.kind} on {scene.perception}", scene.source, scene.camera
    return (made.perception, made.source, made.camera) == expected


def run(options: BoxOptions) -> None:
    """Make every room's that is not there yet.

    Raises:
        ValueError: bad rooms or errors, or scenes that are not there or made by another version.
        OSError: a file cannot be written.
    """
    need("mujoco")
    from sim_bridge.world import gl  # noqa: F401  (fails here, once, when nothing can draw)

    ErrorModel.load(options.errors)
    rooms = parse_rooms(options.rooms or ["data2:train"])
    todo = [room for room in rooms if not _there(*room, options)]
    with ProcessPoolExecutor(options.processes, get_context("spawn")) as pool:
        jobs = [pool.submit(box_scene, *room, options) for room in todo]
        try:
            for job in tqdm(as_completed(jobs), total=len(jobs), unit="room"):
                job.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    print(f"{len(rooms)} rooms in {options.out} ({len(rooms) - len(todo)} were there already)")
