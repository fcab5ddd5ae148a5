"""MoveAheads that are really driven in the simulator, each with the scan taken before it.

No ROS: ``sim_bridge``'s simulator with its noise of LiDAR, wheels and odometry, and ``cfnav_ros``'s
executor. The robot turns first, as it mostly does in an episode, so that its heading is off by what
the executor leaves over.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from cfnav_ros.drive.motion import Motion, Odometry, Status
from cfnav_ros.lidar.estimate import SweptDisc
from cfnav_ros.lidar.returns import Scan, distinct_returns, measured
from cfnav_ros.lidar.sweep import free_way
from sim_bridge.robot import rplidar
from sim_bridge.robot.lidar_turn import standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.simulator import Simulator
from sim_bridge.room.room import generate_room
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import World

from cfnav_core.task.actions import TURN_RAD, Action

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
class Move:
    """One MoveAhead: the scan before it and what came of it.

    Attributes:
        ranges: float32 [N], metres, as the driver publishes them.
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
    """The scan with these ranges, float32 [N], metres, in the fields of the A1's driver."""
    increment = (rplidar.ANGLE_MAX - rplidar.ANGLE_MIN) / (len(ranges) - 1)
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


def moves(
    room_type: str,
    seed: int,
    count: int,
    rest: float,
    noise: float = 1.0,
    mode: rplidar.ScanMode = rplidar.SENSITIVITY,
) -> Iterator[Move]:
    """Drive MoveAheads from random free poses of a room.

    Args:
        room_type: as in ``sim_bridge.room.room``.
        seed: of the room; poses and noise follow from it too.
        count: how many to drive.
        rest: share that is kept of the poses that are not near (``NEAR_M``).
        noise: scale of the simulator's noise.
        mode: of the LiDAR.
    """
    world = World(generate_room(room_type, seed))
    robot = SimulatedRobot(world, Noise(NoiseLevels().scaled(noise), seed))
    exact = Noise(NoiseLevels().scaled(0.0), 0)
    disc, rng = SweptDisc(), np.random.default_rng([seed, count])
    positions = state_grid(world).positions.astype(float)
    made = 0
    while made < count:
        x, y = positions[rng.integers(len(positions))] + rng.uniform(-JITTER_M, JITTER_M, 2)
        yaw, left = rng.uniform(-math.pi, math.pi), rng.random() < 0.5
        if not world.free(x, y):
            continue
        robot.simulator.place(x, y, yaw)
        clean = scan_of(standing_turn(world, exact))
        ways = (plane_way(clean, disc), plane_way(clean, disc, NEAR_MARGIN_M))
        near = any(NEAR_M[0] <= way <= NEAR_M[1] for way in ways)
        if not near and rng.random() >= rest:
            continue
        # Each pose is another robot: scale errors are drawn once for each.
        robot.noise.reseed(int(rng.integers(1 << 31)))
        turn = Action.RotateLeft if left else Action.RotateRight
        robot.simulator.place(x, y, yaw - TURN_RAD * (1 if left else -1))
        origin = robot.odometry().yaw
        robot.perform(turn, origin)
        if robot.simulator.collisions.count:
            continue
        ranges = standing_turn(world, robot.noise, mode)
        start = world.pose
        robot.perform(Action.MoveAhead, origin)
        end, c, s = world.pose, math.cos(start.yaw), math.sin(start.yaw)
        travelled = (end.x - start.x) * c + (end.y - start.y) * s
        collided = robot.simulator.collisions.count > 0
        made += 1
        yield Move(ranges, collided, travelled, 1.0 if near else 1.0 / rest, world.room.name)


class SimulatedRobot:
    """The simulator's robot under the executor."""

    def __init__(self, world: World, noise: Noise) -> None:
        self.noise = noise
        self.simulator = Simulator(world, noise)
        late = round(noise.levels.odometry_latency / world.timestep)
        self._readings: deque[Odometry] = deque(maxlen=late + 1)

    def odometry(self) -> Odometry:
        """What has arrived of the base's own account."""
        return self._readings[0] if self._readings else self._read()

    def perform(self, action: Action, origin: float) -> None:
        """One motion to its end, or to its first contact, and rest.

        Args:
            action: MoveAhead or a turn.
            origin: a heading of the odometry's 45-degree set, radians.
        """
        simulator = self.simulator
        self._readings.clear()
        self._readings.append(self._read())
        motion = Motion(action, simulator.time, self.odometry(), origin)
        status = Status.DRIVING
        while status is Status.DRIVING and not simulator.collisions.count:
            command, status = motion.update(simulator.time, self.odometry())
            self._advance(command.v, command.w, PERIOD_STEPS)
        self._advance(0.0, 0.0, REST_STEPS)

    def _advance(self, v: float, w: float, steps: int) -> None:
        self.simulator.command(v, w)
        for _ in range(steps):
            self.simulator.step()
            self._readings.append(self._read())

    def _read(self) -> Odometry:
        counted = self.simulator.odometry
        v, w = self.noise.twist(*self.simulator.world.velocity)
        return Odometry(self.simulator.time, counted.x, counted.y, counted.yaw, v, w)
