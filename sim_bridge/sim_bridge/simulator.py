"""The robot in its world, one physics step at a time, and the account of what happened to it.

``Simulator`` owns no clock: its time is the number of steps made. Knows no ROS and draws nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sim_bridge.base import Base, Odometry

if TYPE_CHECKING:
    from sim_bridge.grid import Start
    from sim_bridge.world import Contact, Pose, World

COLLISION_GAP_S = 0.5
"""Contacts less than this apart are one collision, s."""

TILT_LIMIT_RAD = math.radians(30.0)
"""The camera's tilt mechanism turns this far up and down, rad."""


class Collisions:
    """Counts collisions in the contacts of successive steps."""

    def __init__(self) -> None:
        self.count = 0
        self.contacts: tuple[Contact, ...] = ()
        """What touches at present."""
        self.impact_speed = 0.0
        """m/s at the onset of the present collision; 0 when nothing touches."""
        self._last_touch = -math.inf

    def update(self, t: float, contacts: Sequence[Contact], speed: float) -> bool:
        """Take the contacts after one step.

        Args:
            t: time, s.
            contacts: whatever touches hull or mast.
            speed: m/s of the robot before the step; at its end the impact has slowed it.

        Returns:
            Whether a new collision began.
        """
        self.contacts = tuple(contacts)
        if not contacts:
            self.impact_speed = 0.0
            return False
        began = t - self._last_touch >= COLLISION_GAP_S - 1e-9
        self._last_touch = t
        if began:
            self.count += 1
            self.impact_speed = speed
        return began


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
    """

    def __init__(self, world: World) -> None:
        self.base = Base()
        self.odometry = Odometry()
        self.steps = 0
        self.enter(world)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.steps * self.world.timestep

    def _rest(self) -> None:
        self.base.stop()
        self._speed = 0.0
        self.tilt_target = 0.0
        self.collisions = Collisions()
        self.path_length = 0.0
        self.goal = ""
        self.shortest_path = 0.0

    def enter(self, world: World) -> None:
        """Go on in another world; time and odometry continue, an episode that ran is dropped."""
        self.world = world
        self._rest()

    def place(self, x: float, y: float, yaw: float) -> None:
        """Put the robot down somewhere, at rest, camera level, with a clean account.

        Args:
            x: m in the room.
            y: m in the room.
            yaw: rad.
        """
        self.world.reset(x, y, yaw)
        self._rest()

    def start_episode(self, goal: str, start: Start) -> None:
        """Put the robot at a start pose and open the account of an episode.

        Args:
            goal: category to be found.
            start: from ``sim_bridge.grid.start_episode``.
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

    def command(self, v: float, w: float) -> None:
        """Receive a velocity command now: m/s forward, rad/s counter-clockwise."""
        self.base.command(self.time, v, w)

    def tilt_to(self, tilt: float) -> None:
        """Turn the camera, rad up positive; beyond the mechanism's range it goes to its end.

        A tilt that is not finite changes nothing.
        """
        if math.isfinite(tilt):
            self.tilt_target = max(-TILT_LIMIT_RAD, min(TILT_LIMIT_RAD, tilt))

    def step(self) -> bool:
        """Advance everything by one physics step.

        Returns:
            Whether a new collision began.
        """
        before = self.world.pose
        v, w = self.base.update(self.time, self.world.timestep)
        self.world.drive(v, w, self.tilt_target)
        self.steps += 1
        forward, left, turn = _motion(before, self.world.pose)
        self.odometry.move(forward, left, turn)
        distance = math.hypot(forward, left)
        self.path_length += distance
        began = self.collisions.update(self.time, self.world.contacts(), self._speed)
        self._speed = distance / self.world.timestep
        return began


def _motion(before: Pose, after: Pose) -> tuple[float, float, float]:
    """The motion between two poses in the frame of the first: m forward, m left, rad."""
    dx, dy = after.x - before.x, after.y - before.y
    c, s = math.cos(before.yaw), math.sin(before.yaw)
    turn = math.remainder(after.yaw - before.yaw, math.tau)
    return c * dx + s * dy, c * dy - s * dx, turn
