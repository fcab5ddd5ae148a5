"""What depth adds to the LiDAR's veto: ``python -m studies.deploy.depth_guard --camera mast``.

A robot wanders through rooms that nothing was settled on. Where it rests, a scan and two depth
pictures are taken as the mock publishes them, both judged by the node's own code, and the
simulator says whether a MoveAhead of 0.25 m would touch something. Depth is looked at only at rest;
on the way the node would see more. What the simulator shows and lets pass (skirting boards, rugs)
is taken out of the rooms.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.lidar.depth_memory import DepthParameters, body
from cfnav_ros.lidar.depth_watch import DepthWatch
from cfnav_ros.lidar.estimate import SweptDisc, estimate_collision
from cfnav_ros.lidar.frames import FrameTree
from cfnav_ros.lidar.sweep import NOMINAL
from sim_bridge.data.overhangs import crosses_plane
from sim_bridge.robot import stereo
from sim_bridge.robot.lidar_turn import standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.room.room import Room, generate_room
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import Pose, World

from cfnav_core.command import run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.task.actions import STEP_M, Action
from cfnav_core.task.camera import CAMERAS, CameraSetUp
from cfnav_core.task.intervals import interval_of_share
from cfnav_core.task.pinhole import Pinhole
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.deploy.driven_moves import SimulatedRobot, scan_of

BASE, MOUNT, OPTICAL = "base_link", "oakd_link", "optical"
PERIOD_S = 0.1
"""Between two depth pictures."""

LOOKS = 2
"""Depth pictures at each rest."""

TURNS, TILTS = 0.3, 0.2
"""Chances that a robot which may drive turns, and that one which can tilt does, before it decides.
"""

WALK = 30
"""Decisions until the robot is put down elsewhere."""

HEIGHTS_M = (0.1, 0.3, 0.45, 0.75, 0.9, 1.2)
"""At which it is told from where on the middle of the way is seen."""


@dataclass(frozen=True)
class GuardConfig:
    """Compare the veto by LiDAR alone with that by LiDAR and depth."""

    out: Path = Path("out/bench")
    """Folder of depth_guard.json."""
    camera: str = "mast"
    """Of ``cfnav_core.task.camera.CAMERAS``."""
    pitch: float = math.nan
    """Degrees, up positive, of a depth camera that does not tilt with the other; nan: it does."""
    n: int = 8_000
    """Decisions."""
    seeds: tuple[int, int] = (20, 21)
    """First and last seed of the rooms, of every type."""
    plain: float = field(default_factory=lambda: NoiseLevels().plain)
    """Grey levels under which a surface returns no depth; 0: a camera with a dot projector."""
    processes: int = 2


@dataclass(frozen=True)
class Decision:
    """What was said of one MoveAhead, and what is true.

    Attributes:
        walk: in which room, and which walk through it: what is met there is met again and again.
        lidar: probability by the LiDAR alone.
        both: with depth.
        blocked: whether it would touch something.
        in_plane: whether it would among what the LiDAR's plane shows.
    """

    walk: str
    lidar: float
    both: float
    blocked: bool
    in_plane: bool


class Eyes:
    """Scan and depth of a simulated robot, judged as the node judges them."""

    def __init__(self, robot: SimulatedRobot, set_up: CameraSetUp) -> None:
        self._robot, self._set_up = robot, set_up
        stereo_set_up = stereo.set_up_of(set_up)
        self.camera = Camera(robot.simulator.world, stereo_set_up)
        (wide, high), (fx, fy) = stereo_set_up.size, stereo_set_up.focal_share
        self._calibration = Pinhole(
            fx * wide, fy * high, (wide - 1) / 2, (high - 1) / 2, wide, high, OPTICAL
        )
        self._parameters = replace(
            DepthParameters(), mast_height=set_up.z if set_up.on_mast else 0.0
        )
        self.now, self.tilt = 0.0, set_up.horizons[0]
        self.begin()

    def begin(self) -> None:
        """Know of nothing yet."""
        self._tree = FrameTree()
        optical = (-0.5, 0.5, -0.5, 0.5)
        self._tree.add(MOUNT, OPTICAL, (0.0, 0.0, 0.0), optical)
        self._watch = DepthWatch(self._parameters, 0.0, SweptDisc(), NOMINAL, self._tree, BASE)
        self._watch.calibration(self._calibration)
        self._look_along(self.tilt)

    def _look_along(self, tilt: float) -> None:
        self.tilt = tilt
        pitch = (0.0, math.sin(-tilt / 2), 0.0, math.cos(tilt / 2))
        self._tree.add(BASE, MOUNT, (self._set_up.x, 0.0, self._set_up.z), pitch)

    def look(self, tilt: float) -> tuple[float, float]:
        """Probability by the LiDAR alone, and with depth, of a robot at rest."""
        simulator, noise = self._robot.simulator, self._robot.noise
        estimate = estimate_collision(scan_of(standing_turn(simulator.world, noise)))
        self._look_along(tilt)
        at, joined = simulator.world.pose, estimate
        for _ in range(LOOKS):
            self.now += PERIOD_S
            rgb, depth = self.camera.depth(Pose(at.x, at.y, at.yaw, tilt))
            self._watch.picture(self.now, _message(noise.depth(depth, rgb)))
            counted = simulator.odometry
            self._watch.odometry(self.now, counted.x, counted.y, counted.yaw)
            joined = self._watch.joined(self.now, self.now, estimate)
        return estimate.probability, joined.probability


def _message(millimetres: np.ndarray) -> Any:
    height, width = millimetres.shape
    return SimpleNamespace(
        height=height, width=width, step=2 * width, encoding="16UC1", is_bigendian=0,
        data=millimetres.astype("<u2").view(np.uint8).ravel(),
        header=SimpleNamespace(frame_id=OPTICAL),
    )  # fmt: skip


def mounted(config: GuardConfig) -> CameraSetUp:
    """Where the depth camera sits and how it looks."""
    set_up = CAMERAS[config.camera]
    if math.isnan(config.pitch):
        return set_up
    return replace(set_up, horizons=(math.radians(config.pitch),))


def furnished(kind: str, seed: int) -> Room:
    """A room without what the robot drives over or through: skirting boards, rugs, curtains."""
    room = generate_room(kind, seed)
    drawn = {index for index, one in enumerate(room.objects) if one.name in ("Floor", "Ceiling")}
    kept = tuple(part for part in room.parts if part.solid or part.owner in drawn)
    return replace(room, parts=kept)


def decisions(
    kind: str, seed: int, count: int, set_up: CameraSetUp, plain: float
) -> Iterator[Decision]:
    """Let a robot wander through a room and judge every MoveAhead that it might make.

    Args:
        kind, seed: of the room.
        count: decisions.
        set_up: of the camera that depth is taken beside.
        plain: see ``GuardConfig``.
    """
    room = furnished(kind, seed)
    world = World(room, set_up.on_mast)
    plane = World(replace(room, parts=tuple(filter(crosses_plane, room.parts))), set_up.on_mast)
    robot = SimulatedRobot(world, Noise(replace(NoiseLevels(), plain=plain), seed))
    rng, positions = np.random.default_rng([seed, count]), state_grid(world).positions.astype(float)
    eyes, veto = Eyes(robot, set_up), EpisodeLimits().veto_probability
    with eyes.camera:
        for k in range(count):
            if k % WALK == 0:
                x, y = positions[rng.integers(len(positions))]
                robot.simulator.place(x, y, float(rng.uniform(-math.pi, math.pi)))
                robot.noise.reseed(int(rng.integers(1 << 31)))
                eyes.begin()
            tilts = rng.random() < TILTS
            tilt = float(rng.choice(set_up.horizons)) if tilts else eyes.tilt
            lidar, both = eyes.look(tilt)
            simulator, here = robot.simulator, world.pose
            end = here.x + STEP_M * math.cos(here.yaw), here.y + STEP_M * math.sin(here.yaw)
            blocked = not simulator.ahead_free()
            in_plane = blocked and not plane.sweep_free((here.x, here.y), end)
            yield Decision(f"{room.name}, {k // WALK}", lidar, both, blocked, in_plane)
            turns = blocked or both >= veto or rng.random() < TURNS
            side = Action.RotateLeft if rng.random() < 0.5 else Action.RotateRight
            before = simulator.time
            robot.perform(side if turns else Action.MoveAhead, robot.odometry().yaw)
            eyes.now += simulator.time - before


def figures(found: list[Decision]) -> dict[str, list[float]]:
    """Shares with their 95 % intervals over walks, and the number that each is a share of."""
    lidar, both = (np.array([getattr(d, of) for d in found]) for of in ("lidar", "both"))
    blocked, in_plane = (
        np.array([getattr(d, of) for d in found]) for of in ("blocked", "in_plane")
    )
    veto, walks = EpisodeLimits().veto_probability, np.array([d.walk for d in found])
    rows = {}
    for name, p in (("lidar", lidar), ("both", both)):
        forbids = p >= veto
        for what, among, share in (
            ("missed", blocked, ~forbids),
            ("missed_over_the_plane", blocked & ~in_plane, ~forbids),
            ("free_but_forbidden", ~blocked, forbids),
        ):
            count = int(among.sum())
            value, ends = math.nan, (math.nan, math.nan)
            if count:
                value = float(share[among].mean())
                ends = interval_of_share(share[among], walks[among])
            rows[f"{name}_{what}"] = [value, *ends, count]
    return rows


def seen_strip(set_up: CameraSetUp, tilt: float) -> dict[str, float]:
    """How much of what the body sweeps in a MoveAhead is in one picture, and from where on.

    Args:
        set_up: of the camera that the stereo camera sits at.
        tilt: rad, up positive.

    Returns:
        Shares of the volumes swept by hull and mast; for each height of ``HEIGHTS_M`` the nearest
        place ahead of base_link, metres, at which it is seen.
    """
    parameters = replace(DepthParameters(), mast_height=set_up.z if set_up.on_mast else 0.0)
    rng, found = np.random.default_rng(0), {}
    for name, part in zip(("hull", "mast"), body(parameters, SweptDisc().radius), strict=False):
        box = rng.uniform((0.0, -1.0, part.bottom), (1.0, 1.0, part.top), (200_000, 3))
        box[:, 1] *= part.radius
        box[:, 0] *= STEP_M + part.radius
        ahead = np.hypot(np.maximum(box[:, 0] - STEP_M, 0.0), box[:, 1]) <= part.radius
        ahead &= np.hypot(box[:, 0], box[:, 1]) > part.radius
        found[name] = float(_in_view(box[ahead], set_up, tilt).mean())
    x = np.linspace(0.0, 4.0, 4001)
    for height in HEIGHTS_M:
        way = np.stack([x, np.zeros_like(x), np.full_like(x, height)], axis=1)
        seen = x[_in_view(way, set_up, tilt)]
        found[f"from_{height:g}_m"] = float(seen.min(initial=math.inf))
    return found


def _in_view(points: np.ndarray, set_up: CameraSetUp, tilt: float) -> np.ndarray:
    """Which points of base_link the stereo camera measures where nothing hides them: bool [N]."""
    ahead, up = points[:, 0] - set_up.x, points[:, 2] - set_up.z
    c, s = math.cos(tilt), math.sin(tilt)
    depth, above = c * ahead + s * up, c * up - s * ahead
    nearest = stereo.FOCAL_PX * stereo.BASELINE_M / stereo.MOST_DISPARITY
    wide, high = (math.tan(math.radians(fov) / 2) for fov in stereo.FOV_DEG)
    inside = (np.abs(points[:, 1]) <= wide * depth) & (np.abs(above) <= high * depth)
    return inside & (depth >= nearest)


def measure(config: GuardConfig) -> dict[str, Any]:
    """Measure, write the figures into a folder and return them."""
    first, last = config.seeds
    rooms = [(kind, seed) for seed in range(first, last + 1) for kind in ROOM_TYPES]
    each = -(-config.n // len(rooms))
    set_up = mounted(config)
    tasks = [(kind, seed, each, set_up, config.plain) for kind, seed in rooms]
    with get_context("spawn").Pool(config.processes) as pool:
        found = [row for part in pool.imap(_room, tasks) for row in part]
    result: dict[str, Any] = {
        "decisions": len(found),
        **figures(found),
        "view": {f"{math.degrees(tilt):.0f}": seen_strip(set_up, tilt) for tilt in set_up.horizons},
    }
    write_json(config.out / "depth_guard.json", result)
    return result


def _room(task: tuple[str, int, int, CameraSetUp, float]) -> list[Decision]:
    return list(decisions(*task))


def main(config: GuardConfig) -> None:
    """Measure and print."""
    for name, value in measure(config).items():
        print(f"{name}: {value}")


if __name__ == "__main__":
    sys.exit(run_options("depth_guard", GuardConfig, main))
