"""The robot in its world, one physics step at a time, and the account of what happened to it.

``Simulator`` owns no clock: its time is the number of steps made. Knows no ROS and draws nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cfnav_core.task.actions import STEP_M
from sim_bridge.robot.base import Base, BaseLimits, SimulatedOdometry, TrueMotion
from sim_bridge.robot.collisions import Collisions
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.own_motions import (
    DOCK_VISIBLE_M,
    BackOff,
    BackupBuffer,
    Dock,
    Undock,
    imposed,
)

if TYPE_CHECKING:
    from sim_bridge.world.grid import StartPose
    from sim_bridge.world.world import Pose, World

SIMULATOR_VERSION = 2
"""Rises when the robot moves, touches or measures otherwise; a test holds it."""

TILT_LIMIT_RAD = math.radians(30.0)
"""The camera's tilt mechanism turns this far up and down, rad; one that is made for more, more."""


STILL_SPEED, STILL_RATE = 0.005, 0.01
"""m/s and rad/s; a robot below both stands still."""

PUSH = (-0.15 / math.sqrt(2) / 0.5, 0.15 / math.sqrt(2) / 0.5)
"""m/s forward and to the left of ``base_pushed``, which lasts 0.5 s: 0.15 m back and sideways."""

SLOWED = BaseLimits(speed=0.1)
"""What PROXIMITY_SLOWDOWN, on by default, leaves of the base's speed near an obstacle. How much is
assumed. Source: create3_docs ``reflexes.md``."""

BUSY = frozenset({"base_busy", "base_action", "base_frees_itself"})
"""Faults during which the base hears no command."""

JUMP_M, JUMP_RAD = 0.5, math.pi / 2
"""How far ``odom_jump`` and ``odom_turned`` put the odometry off."""


@dataclass(frozen=True)
class EpisodeAccount:
    """What an episode came to, by the simulator's own account.

    Attributes:
        goal: category, empty when no episode runs.
        shortest_path: m, from the start to the nearest state that sees the goal.
        path_length: m truly driven.
        collisions: separate collisions of hull or mast.
    """

    goal: str
    shortest_path: float
    path_length: float
    collisions: int


class Simulator:
    """A base, its odometry and its camera's tilt in a world.

    Args:
        world: where the robot is; ``enter`` moves it to another.
        noise: of wheels and odometry; none when None.
        reflexes: whether the base backs off by itself when its bumper is pressed.
        tilts: those that its camera is made for, rad, up positive, the first before it is told
            another.
    """

    def __init__(
        self, world: World, noise: Noise | None = None, reflexes: bool = False,
        tilts: Sequence[float] = (0.0,),
    ) -> None:  # fmt: skip
        self._first_tilt = tilts[0]
        self._tilt_limit = max(TILT_LIMIT_RAD, *map(abs, tilts))
        self.noise = noise or Noise(NoiseLevels().scaled(0.0), 0)
        self._reflexes = reflexes
        self._own: BackOff | Undock | Dock | None = None
        self._dock_pose: Pose | None = None
        self.base = Base()
        self.odometry = SimulatedOdometry()
        self.steps = 0
        self.e_stop = False
        """Whether somebody has cut the drive power."""
        self.faults: frozenset[str] = frozenset()
        """Names in ``faults.FAULTS`` of what holds now; see ``take_faults``."""
        self.enter(world)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.steps * self.world.timestep

    @property
    def wheels_enabled(self) -> bool:
        """Whether the wheels have power."""
        return not (self.e_stop or "e_stop" in self.faults)

    @property
    def docked(self) -> bool:
        """Whether the robot sits on its dock."""
        return self._on_dock or "docked" in self.faults

    @property
    def backup_low(self) -> bool:
        """Whether little or nothing is left of the way that commands may drive backward."""
        return self._backup.low

    @property
    def own(self) -> BackOff | Undock | Dock | None:
        """What the base does by itself."""
        return self._own

    @property
    def busy(self) -> bool:
        """Whether the base does something by itself and hears no command."""
        return self._own is not None or bool(BUSY & self.faults)

    def dock(self) -> None:
        """Let the robot sit on a dock where it is."""
        self._on_dock, self._dock_pose = True, self.world.pose

    def undock(self) -> Undock:
        """Begin to leave the dock; it is over when ``own`` is another."""
        self._own = undock = Undock()
        return undock

    @property
    def dock_visible(self) -> bool:
        """Whether the base sees a dock, be it under itself."""
        return self.docked or self._way_to_dock()[1] <= DOCK_VISIBLE_M

    def go_to_dock(self) -> Dock:
        """Begin to go back to a dock that is visible; it is over when ``own`` is another."""
        self._own = dock = Dock(*self._way_to_dock())
        return dock

    def stop_own(self) -> None:
        """Give up what the base does by itself."""
        self._end_own()

    def _way_to_dock(self) -> tuple[float, float, float]:
        """Bearing, rad, distance, m, and heading of the dock, rad, from the robot; far without."""
        pose, dock = self.world.pose, self._dock_pose
        if dock is None:
            return 0.0, math.inf, 0.0
        dx, dy = dock.x - pose.x, dock.y - pose.y
        bearing = math.remainder(math.atan2(dy, dx) - pose.yaw, math.tau)
        return bearing, math.hypot(dx, dy), math.remainder(dock.yaw - pose.yaw, math.tau)

    @property
    def motion(self) -> TrueMotion:
        """How the robot truly moves."""
        return TrueMotion(*self.world.velocity, self._still_since)

    @property
    def twist(self) -> tuple[float, float]:
        """The velocity that the base reports: m/s forward, rad/s."""
        slips = "base_slip" in self.faults
        return self.noise.twist(*(self._wheels if slips else self.world.velocity))

    def pressed(self) -> list[float]:
        """Bearings of what presses the bumper, rad counter-clockwise from the front.

        The mast and the rear half have no bumper.
        """
        bearings = [c.bearing for c in self.collisions.contacts if c.part == "hull"]
        stuck = [0.0] if self.faults & {"bumper_stuck", "hazards_lost_once"} else []
        return stuck + [b for b in bearings if abs(b) <= math.pi / 2]

    def _rest(self) -> None:
        self.base.stop()
        self._own = None
        self._was_pressed = False
        self._on_dock = False
        self._dock_pose = None
        self._backup = BackupBuffer()
        self._moved = (0.0, 0.0)
        self._wheels = (0.0, 0.0)
        self._speed = 0.0
        self._still_since: float | None = self.time
        self.tilt_target = self._first_tilt
        self.tilt_rate = 0.0
        """rad/s of the camera, up positive."""
        self.collisions = Collisions()
        self.path_length = 0.0
        self.goal = ""
        self.shortest_path = 0.0

    def enter(self, world: World) -> None:
        """Go on in another world; time and odometry continue, an episode that ran is dropped."""
        self.world = world
        self._rest()

    def place(self, x: float, y: float, yaw: float) -> None:
        """Put the robot down somewhere, at rest, the camera as at first, with a clean account.

        Args:
            x: m in the room.
            y: m in the room.
            yaw: rad.
        """
        self.world.reset(x, y, yaw, self._first_tilt)
        self._rest()

    def start_episode(self, goal: str, start: StartPose) -> None:
        """Put the robot at a start pose and open the account of an episode.

        Args:
            goal: category to be found.
            start: from ``sim_bridge.world.grid.start_episode``.
        """
        self.place(start.x, start.y, start.yaw)
        self.goal = goal
        self.shortest_path = start.shortest_path

    def end_episode(self) -> EpisodeAccount:
        """Close the account of the episode; the robot stays where it is.

        Raises:
            RuntimeError: when no episode runs.
        """
        if not self.goal:
            raise RuntimeError("No episode runs: start one before ending it.")
        account = EpisodeAccount(
            self.goal, self.shortest_path, self.path_length, self.collisions.count
        )
        self.goal = ""
        self.shortest_path = 0.0
        return account

    def goal_distance(self) -> float:
        """Horizontal distance to the nearest object of the episode's goal, m; inf without one."""
        pose = self.world.pose
        distances = [math.inf]
        for thing in self.world.room.objects:
            if thing.name == self.goal:
                x0, y0, x1, y1 = thing.footprint
                dx = max(x0 - pose.x, pose.x - x1, 0.0)
                dy = max(y0 - pose.y, pose.y - y1, 0.0)
                distances.append(math.hypot(dx, dy))
        return min(distances)

    def ahead_free(self) -> bool:
        """Whether a MoveAhead of 0.25 m would touch nothing from here.

        Data sets hold the opposite for the states of their grid, whose diagonal steps are longer.
        """
        pose = self.world.pose
        end = pose.x + STEP_M * math.cos(pose.yaw), pose.y + STEP_M * math.sin(pose.yaw)
        return self.world.sweep_free((pose.x, pose.y), end)

    def command(self, v: float, w: float) -> None:
        """Receive a velocity command now: m/s forward, rad/s counter-clockwise.

        A base that is busy or on its dock ignores it.
        """
        if not (self.busy or self.docked):
            self.base.command(self.time, *self._backup.limit(v, w))

    def take_faults(self, faults: frozenset[str]) -> None:
        """Take the faults that hold from now on; those of other parts do nothing.

        Args:
            faults: names in ``faults.FAULTS``.
        """
        begun = faults - self.faults
        self.faults = faults
        if "odom_jump" in begun:
            self.odometry.move(JUMP_M, 0.0, 0.0)
        if "odom_turned" in begun:
            self.odometry.move(0.0, 0.0, JUMP_RAD)
        self.base.limits = SLOWED if "base_slowed" in faults else BaseLimits()
        if begun & (BUSY | {"docked"}):
            self.base.forget()

    def tilt_to(self, tilt: float) -> None:
        """Turn the camera, rad up positive; beyond the mechanism's range it goes to its end.

        A tilt that is not finite changes nothing.
        """
        if math.isfinite(tilt):
            self.tilt_target = max(-self._tilt_limit, min(self._tilt_limit, tilt))

    def step(self) -> bool:
        """Advance everything by one physics step.

        Returns:
            Whether a new collision began.
        """
        before = self.world.pose
        self._wheels = self.base.update(self.time, self.world.timestep, self._act())
        self._drive(*self.noise.slip(*self._wheels))
        self.steps += 1
        forward, left, turn = _motion(before, self.world.pose)
        self.odometry.move(*self.noise.count(forward, left, turn, self.world.timestep))
        self.tilt_rate = (self.world.pose.tilt - before.tilt) / self.world.timestep
        self._moved = forward, turn
        self._backup.move(forward)
        if self._backup.left <= 0 and self._own is None:
            self.base.stop_backing()
        distance = math.hypot(forward, left)
        self.path_length += distance
        began = self.collisions.update(self.time, self.world.contacts(), self._speed)
        self._speed = distance / self.world.timestep
        self._watch_standstill()
        return began

    def _act(self) -> tuple[float, float] | None:
        """What the base does by itself now: m/s, rad/s; None when it obeys commands."""
        pressed = bool(self.pressed())
        began, self._was_pressed = pressed and not self._was_pressed, pressed
        if not self.wheels_enabled:
            self.base.forget()
            self._end_own()  # nor does the base take it up when the power is back
            return None
        if began and self._reflexes and self._own is None:
            self._own = BackOff()
        if self._own is None:
            return imposed(self.faults, self.time)
        self.base.forget()
        wanted = self._own.update(self.world.timestep, *self._moved, pressed)
        if wanted is None:
            self._end_own()
        return wanted

    def _end_own(self) -> None:
        if isinstance(self._own, Undock):
            self._on_dock = not self._own.left
        elif isinstance(self._own, Dock):
            self._on_dock = self._own.done
        self._own = None

    def _drive(self, v: float, w: float) -> None:
        """Let the floor have what the wheels do, m/s and rad/s, or what is done to the robot."""
        sideways = 0.0
        tilt = self.tilt_target
        if self.faults & {"base_stuck", "base_slip"}:
            v = w = 0.0
        if "base_stuck" in self.faults:
            self.base.block()
        if "base_pushed" in self.faults:
            v, sideways = v + PUSH[0], PUSH[1]
        if "tilt_stuck" in self.faults:
            tilt = self.world.pose.tilt
        self.world.drive(v, w, tilt, sideways)

    def _watch_standstill(self) -> None:
        moves = self.world.speed >= STILL_SPEED or abs(self.world.velocity[1]) >= STILL_RATE
        if moves:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = self.time


def _motion(before: Pose, after: Pose) -> tuple[float, float, float]:
    """The motion between two poses in the frame of the first: m forward, m left, rad."""
    dx, dy = after.x - before.x, after.y - before.y
    c, s = math.cos(before.yaw), math.sin(before.yaw)
    turn = math.remainder(after.yaw - before.yaw, math.tau)
    return c * dx + s * dy, c * dy - s * dx, turn
