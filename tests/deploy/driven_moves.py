"""MoveAheads that are really driven in the simulator, each with the scan taken before it.

Pure of ROS: ``sim_bridge``'s simulator, ``cfnav_ros``'s executor, and noise of scan and odometry.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from cfnav_ros.lidar import SweptDisc
from cfnav_ros.motion import Motion, Odometry, Status
from cfnav_ros.returns import Scan, distinct_returns, measured
from cfnav_ros.sweep import free_way
from sim_bridge.grid import state_grid
from sim_bridge.room import generate_room
from sim_bridge.simulator import Simulator
from sim_bridge.world import World

from cfnav_core.actions import STEP_M, Action
from sim_bridge import rplidar

PERIOD_STEPS = 5
"""Physics steps between two updates of the executor: 20 Hz."""

REST_STEPS = 30
"""Physics steps given to the base to come to rest."""

JITTER_M = 0.125
"""Poses stand this far around a grid position, and look anywhere."""

NEAR_M, NEAR_MARGIN_M = (0.20, 0.30), 0.02
"""A pose is near when the noiseless plane leaves a way of this length to the hull as it is or to
one wider by the margin: there lies nearly all that is uncertain."""


@dataclass(frozen=True)
class Noise:
    """One sigma of each error of this measurement.

    Sources: the A1M8's data sheet bounds the error of a range by 1 % of it, taken as two sigma,
    and its resolution by 0.5 mm; the executor's turns end within 0.5 to 1 degree of the heading;
    wheel odometry of the Create 3 is taken as right to 1 % of the way, its heading to 0.1 degrees
    over one motion.
    """

    range_share: float = 0.005
    resolution: float = 0.0005
    heading_deg: float = 0.5
    scale: float = 0.01
    drift_deg: float = 0.1


@dataclass(frozen=True)
class Move:
    """One MoveAhead: the scan before it and what came of it.

    Attributes:
        ranges: float32 [1080], metres, as the driver publishes them.
        collided: whether hull or mast touched something.
        travelled: metres truly driven along the heading before the motion.
        weight: how many poses of a plain draw this one stands for.
        room: of the simulator, e.g. "kitchen:21".
    """

    ranges: np.ndarray
    collided: bool
    travelled: float
    weight: float
    room: str


def scan_of(ranges: np.ndarray) -> Scan:
    """The scan with these ranges, float32 [1080], metres, in the fields of the A1's driver."""
    increment = (rplidar.ANGLE_MAX - rplidar.ANGLE_MIN) / (rplidar.BINS - 1)
    return Scan(
        ranges, rplidar.ANGLE_MIN, rplidar.ANGLE_MAX, increment, rplidar.RANGE_MIN,
        rplidar.RANGE_MAX, "rplidar_link",
    )  # fmt: skip


def plane_way(scan: Scan, disc: SweptDisc, margin: float = 0.0) -> float:
    """The plain geometric rule: how far a disc can go by the bare returns, metres; no smoothing."""
    first, last, value = distinct_returns(np.asarray(scan.ranges, np.float64))
    good = measured(value, scan)
    index, value = ((first + last) / 2)[good], value[good]
    angle = disc.mount.bearings(scan.angle_min + index * scan.angle_increment)
    points = [disc.mount_x + value * np.cos(angle), disc.mount_y + value * np.sin(angle)]
    way = free_way(np.stack(points, axis=1), disc.radius + margin).min(initial=scan.range_max)
    return max(float(way), 0.0)


def noisy_ranges(distances: np.ndarray, noise: Noise, rng: np.random.Generator) -> np.ndarray:
    """True distances (float32 [360], metres) as the driver publishes them, with errors."""
    measured_m = distances * (1 + noise.range_share * rng.standard_normal(len(distances)))
    measured_m = np.round(measured_m / noise.resolution) * noise.resolution
    return rplidar.driver_ranges(measured_m.astype(np.float32))


def moves(
    room_type: str, seed: int, count: int, rest: float, noise: Noise = Noise()
) -> Iterator[Move]:
    """Drive MoveAheads from random free poses of a room.

    Args:
        room_type: as in ``sim_bridge.room``.
        seed: of the room; the poses follow from it too.
        count: how many to drive.
        rest: share that is kept of the poses that are not near (``NEAR_M``).
        noise: of scan and odometry.
    """
    world = World(generate_room(room_type, seed))
    simulator, disc = Simulator(world), SweptDisc()
    rng = np.random.default_rng([seed, count])
    positions = state_grid(world).positions.astype(float)
    made = 0
    while made < count:
        x, y = positions[rng.integers(len(positions))] + rng.uniform(-JITTER_M, JITTER_M, 2)
        yaw = rng.uniform(-math.pi, math.pi)
        if not world.free(x, y):
            continue
        simulator.place(x, y, yaw)
        distances = world.scan()
        clean = scan_of(rplidar.driver_ranges(distances))
        ways = (plane_way(clean, disc), plane_way(clean, disc, NEAR_MARGIN_M))
        near = any(NEAR_M[0] <= way <= NEAR_M[1] for way in ways)
        if not near and rng.random() >= rest:
            continue
        ranges = noisy_ranges(distances, noise, rng)
        collided, travelled = drive(simulator, noise, rng)
        made += 1
        weight = 1.0 if near else 1.0 / rest
        yield Move(ranges, collided, travelled, weight, world.room.name)


def drive(simulator: Simulator, noise: Noise, rng: np.random.Generator) -> tuple[bool, float]:
    """One MoveAhead by the executor at 20 Hz from where the robot stands.

    Returns:
        Whether anything was touched, and metres driven along the heading before the motion.
    """
    start = simulator.world.pose
    scale = 1 + noise.scale * rng.standard_normal()
    drift = math.radians(noise.drift_deg) * rng.standard_normal() / STEP_M
    heading = start.yaw + math.radians(noise.heading_deg) * rng.standard_normal()
    begun = simulator.time

    def read() -> Odometry:
        pose = simulator.world.pose
        dx, dy = pose.x - start.x, pose.y - start.y
        v, w = simulator.world.velocity
        yaw = pose.yaw + drift * math.hypot(dx, dy)
        return Odometry(
            simulator.time, scale * dx, scale * dy, yaw, v, w
        )  # the step is short: the order of drift and way makes no difference

    motion = Motion(Action.MoveAhead, begun, read(), heading)
    status = Status.DRIVING
    while status is Status.DRIVING and not simulator.collisions.count:
        command, status = motion.update(simulator.time, read())
        simulator.command(command.v, command.w)
        for _ in range(PERIOD_STEPS):
            simulator.step()
    for _ in range(REST_STEPS):
        simulator.command(0.0, 0.0)
        simulator.step()
    end = simulator.world.pose
    c, s = math.cos(start.yaw), math.sin(start.yaw)
    travelled = (end.x - start.x) * c + (end.y - start.y) * s
    return simulator.collisions.count > 0, travelled
