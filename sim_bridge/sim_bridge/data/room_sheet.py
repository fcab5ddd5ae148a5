"""Pages of pictures of rooms: ``cfnav rooms show --rooms sweet_home.kitchen:100 --out DIR``.

Each room has a row: the room from above without its ceiling, then what the robot's camera sees from
places that show much. Files are named ``page_001.png`` and so on.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from cfnav_core.task.actions import STEP_M
from cfnav_core.task.camera import CameraSetUp
from sim_bridge.data.asked import Furniture, Rooms, asked_for
from sim_bridge.data.pages import labelled, on_pages, write_pages
from sim_bridge.room.room import Room, generate_room
from sim_bridge.room.shell import WALL_HEIGHT
from sim_bridge.world.camera import Camera
from sim_bridge.world.world import Pose, World

import mujoco as mj  # isort: skip

TRIED = 48
"""Poses of which the best are shown."""
LEAST_SHARE = 0.002
"""Of the picture that an object needs to count as shown."""


@dataclass(frozen=True)
class ShowOptions:
    """Draw rooms on pages, to look at: from above, and as the robot sees them."""

    out: Path
    """Folder for the pages."""
    rooms: Rooms = field(default_factory=list)
    furniture: Furniture = "built_in"
    views: int = 4
    """Pictures of each room beside the one from above."""
    camera: str = "mast"
    """Whose view: mast, stock_wide, stock_preview, lite, or a JSON file like a scene's camera."""
    side: int = 320
    """Height of a picture on the page, pixels."""
    rows: int = 4
    """Rooms on a page."""

    def run_command(self) -> None:
        """Draw.

        Raises:
            ValueError: there are no such rooms, or a number makes no sense.
            OSError: a file cannot be written.
        """
        rooms = asked_for(self.rooms, self.furniture)
        for name, value, most in (
            ("views", self.views, TRIED), ("side", self.side, 1080), ("rows", self.rows, 100)
        ):  # fmt: skip
            if not 1 <= value <= most:
                raise ValueError(f"found --{name} {value}, expected 1 to {most}")
        camera = CameraSetUp.read(self.camera)
        tiles = (
            tile
            for kind, seed in tqdm(rooms, unit="room", mininterval=2.0)
            for tile in draw(generate_room(kind, seed), self.views, camera, self.side)
        )
        pages = write_pages(on_pages(tiles, self.views + 1, self.rows), self.out)
        print(f"{len(rooms)} rooms on {pages} pages in {self.out}")


def draw(room: Room, views: int, camera: CameraSetUp, side: int) -> Iterator[np.ndarray]:
    """Tiles of a room, uint8 [side, W, 3]: from above, then so many views."""
    width = round(side * camera.size[0] / camera.size[1])
    above = from_above(room, side)
    first = np.full((side, width, 3), 255, np.uint8)
    columns = min(side, width)
    first[:, :columns] = above[:, (side - columns) // 2 : (side - columns) // 2 + columns]
    goals = textwrap.wrap(", ".join(room.goals), width // 6)
    yield labelled(first, f"{room.name}  {room.width:.1f} x {room.depth:.1f} m", *goals)
    world = World(room, camera.on_mast)
    with Camera(world, camera) as look:
        for pose in good_poses(world, look, views):
            rgb = cv2.resize(look.rgb(pose), (width, side), interpolation=cv2.INTER_AREA)
            yield np.asarray(rgb)


def good_poses(world: World, camera: Camera, count: int) -> list[Pose]:
    """Free poses on the grid that together show much of a room."""
    rng = np.random.default_rng(world.room.seed)
    places = [
        (i * STEP_M, j * STEP_M)
        for i in range(1, math.ceil(world.room.width / STEP_M))
        for j in range(1, math.ceil(world.room.depth / STEP_M))
        if world.free(i * STEP_M, j * STEP_M)
    ]
    if not places:
        raise ValueError(f"found no place for the robot in room {world.room.name}")
    tilts = camera.set_up.horizons[:2]
    poses, shown = [], []
    for _ in range(TRIED):
        x, y = places[int(rng.integers(len(places)))]
        yaw, tilt = float(rng.integers(8)) * math.pi / 4, float(rng.choice(tilts))
        poses.append(Pose(x, y, yaw, tilt))
        pixels = camera.owner_pixels(poses[-1])
        shown.append(pixels > LEAST_SHARE * pixels.sum())
    found: list[Pose] = []
    times = np.zeros(len(shown[0]))
    for _ in range(min(count, len(poses))):
        k = int(np.argmax([(seen * 0.4**times).sum() for seen in shown]))
        found.append(poses.pop(k))
        times += shown.pop(k)
    return found


def from_above(room: Room, side: int) -> np.ndarray:
    """A room without its ceiling from above, x to the right: uint8 [side, side, 3]."""
    parts = tuple(part for part in room.parts if room.objects[part.owner].name != "Ceiling")
    model = World(replace(room, parts=parts)).model
    model.vis.global_.fovy = 40
    data = mj.MjData(model)
    mj.mj_forward(model, data)
    camera = mj.MjvCamera()
    camera.lookat[:] = (room.width / 2, room.depth / 2, 0)
    half = max(room.width, room.depth) / 2 + 0.1
    camera.distance = half / math.tan(math.radians(20)) + WALL_HEIGHT
    camera.azimuth, camera.elevation = 90, -89.9
    option = mj.MjvOption()
    option.geomgroup[:] = (1, 1, 1, 0, 0, 0)
    with mj.Renderer(model, side, side) as renderer:
        renderer.update_scene(data, camera, option)
        renderer.scene.flags[mj.mjtRndFlag.mjRND_SHADOW] = 0
        return np.asarray(renderer.render())
