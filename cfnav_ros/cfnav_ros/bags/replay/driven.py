"""Which discrete actions somebody drove, from odometry, bumper and camera tilt. Pure.

For bags without decisions: teleoperated, or of another stack. The rule:

- Two counts follow the odometry: how far the robot went ahead along its heading (backwards counts
  against it) and by how much it turned. 0.25 m ahead is a MoveAhead, 45 degrees are a turn; what
  is left over counts on, so that an arc becomes turns and MoveAheads in the right proportion.
- Each action makes a keyframe, at which the next one begins. As long as the robot has not left a
  keyframe, the beginning moves along: what was decided there was decided at the latest when it
  left. A motion counts as complete, and a keyframe as not left, within tolerances; at the robot's
  first rest on a keyframe what is left over is forgotten, as each motion ends a little short.
- A touch (a bumper zone becomes pressed, or the base stalls) ends a MoveAhead under way, as it
  does live: a robot that drives against something never completes it.
- Backing up is no action of the set. What was backed up by is forgotten when the robot rests
  afterwards, or after 0.25 m, and a keyframe begins.
- The tilt's change from one of the camera's horizons to another is LookUp or LookDown.
- Odometry that jumps, or that moves during a gap, begins a keyframe without an action.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cfnav_core.task.actions import STEP_M, TURN_RAD, Action
from cfnav_core.task.camera import MAST
from cfnav_ros.bags.files.events import Bumps, Event, Joint, Pose
from cfnav_ros.drive.motion import wrap
from cfnav_ros.drive.track import JUMP_M, JUMP_M_PER_S, JUMP_RAD, JUMP_RAD_PER_S

SHORT_M, SHORT_RAD = 0.02, math.radians(4.0)
"""A motion may end so much short of its length: our own ends within 0.005 m and 0.5 degrees."""

NEAR_M, NEAR_RAD = 0.04, math.radians(8.0)
"""Nearer to it than this, twice the above, a keyframe is not left."""

BEGUN_M = 0.01
"""A robot that came less far is not under way ahead: what touches it then came by itself."""

REST_S, REST_M, REST_RAD = 0.3, 0.005, math.radians(0.5)
"""A pose that has changed less for this long is a rest; noise of wheel odometry is smaller."""

GAP_S = 0.5
"""Between samples further apart nobody knows what was driven."""

FASTEST_M_PER_S, FASTEST_RAD_PER_S = 10.0, 10.0
"""No robot with this camera is faster, whatever its odometry says of itself."""

LEVEL_RAD, TILTS_RAD = math.radians(5.0), math.radians(2.0)
"""A tilt this near to a horizon has reached it; one further from its horizon is on its way."""


@dataclass
class _Rest:
    """Where and since when (seconds) the robot has not moved."""

    since: float
    pose: Pose


class DrivenActions:
    """Follows one drive.

    Args:
        horizons: tilts that the camera looks from, rad.

    Attributes:
        left_out: keyframes without an action, after jumps and gaps of the odometry.
        backed: keyframes without an action, after backing up.
    """

    def __init__(self, horizons: tuple[float, ...] = MAST.horizons) -> None:
        self._horizons = horizons
        self.left_out = self.backed = 0
        self._pressed = False
        self._level: int | None = None
        self._tilts = False
        self.restart()

    def restart(self) -> None:
        """A drive begins: where the robot is next is its first keyframe."""
        self._last: Pose | None = None
        self._key: Pose | None = None
        self._rest: _Rest | None = None
        self._ahead = self._turned = 0.0
        self._settled = False

    @property
    def at_keyframe(self) -> bool:
        """Whether the robot has not left its keyframe, so that the next action begins now."""
        if self._last is None or self._key is None or self._tilts:
            return False
        return not _moved(self._key, self._last, NEAR_M, NEAR_RAD)

    def see(self, event: Event) -> list[Action]:
        """The actions that an event completes, mostly none."""
        if isinstance(event, Pose):
            return self._follow(event)
        if isinstance(event, Bumps):
            before, self._pressed = self._pressed, bool(event.zones)
            return self.touch() if self._pressed and not before else []
        return self._tilt(event) if isinstance(event, Joint) else []

    def touch(self) -> list[Action]:
        """The robot touches something: the MoveAhead under way, if any, ends here."""
        if self._last is None or self._ahead < BEGUN_M:
            return []
        self._mark(self._last, forget=True)
        return [Action.MoveAhead]

    def stalled(self) -> list[Action]:
        """The base is told to go and does not: a touch, unless the bumper tells of it already."""
        return [] if self._pressed else self.touch()

    def _follow(self, pose: Pose) -> list[Action]:
        before = self._last
        if before is not None and pose.t_ns == before.t_ns:
            return []
        self._last = pose
        if before is None or self._key is None or _broken(before, pose):
            self.left_out += self._key is not None
            self._mark(pose, forget=True)
            return []
        turn = wrap(pose.yaw - before.yaw)
        middle = before.yaw + turn / 2
        dx, dy = pose.x - before.x, pose.y - before.y
        self._ahead += dx * math.cos(middle) + dy * math.sin(middle)
        self._turned += turn
        found = self._completed(pose)
        self._look_for_rest(pose)
        return found

    def _completed(self, pose: Pose) -> list[Action]:
        found = []
        while self._ahead >= STEP_M - SHORT_M:
            found.append(Action.MoveAhead)
            self._ahead -= STEP_M
        while abs(self._turned) >= TURN_RAD - SHORT_RAD:
            left = self._turned > 0
            found.append(Action.RotateLeft if left else Action.RotateRight)
            self._turned -= math.copysign(TURN_RAD, self._turned)
        if found:
            self._mark(pose)
        elif self._ahead <= -STEP_M:
            self._back(pose)
        return found

    def _look_for_rest(self, pose: Pose) -> None:
        t, rest = pose.t_ns * 1e-9, self._rest
        if rest is None or _moved(rest.pose, pose, REST_M, REST_RAD):
            self._rest = _Rest(t, pose)
            return
        if t - rest.since < REST_S:
            return
        if self._ahead <= -NEAR_M:
            self._back(pose)
        elif self.at_keyframe and not self._settled:
            # once a keyframe, or a robot that creeps would never get ahead
            self._settled = True
            self._ahead = self._turned = 0.0

    def _back(self, pose: Pose) -> None:
        self.backed += 1
        self._ahead = 0.0
        self._mark(pose)

    def _mark(self, pose: Pose, forget: bool = False) -> None:
        """A keyframe is here; ``forget``: what is left over does not count on."""
        self._key, self._settled = pose, False
        if forget:
            self._ahead = self._turned = 0.0
            self._rest = None

    def _tilt(self, event: Joint) -> list[Action]:
        near = [k for k, at in enumerate(self._horizons) if abs(event.angle - at) <= LEVEL_RAD]
        before = self._level
        if near:
            self._level = near[0]
        if self._level is not None:
            self._tilts = abs(event.angle - self._horizons[self._level]) > TILTS_RAD
        if before is None or before == self._level or self._last is None:
            return []
        return [Action.LookUp if near[0] < before else Action.LookDown]


def _moved(a: Pose, b: Pose, metres: float, radians: float) -> bool:
    return math.hypot(a.x - b.x, a.y - b.y) > metres or abs(wrap(a.yaw - b.yaw)) > radians


def _broken(before: Pose, pose: Pose) -> bool:
    """Whether what lies between two samples is not known: a jump, or motion during a gap."""
    dt = (pose.t_ns - before.t_ns) * 1e-9
    if dt < 0:
        return True
    if dt > GAP_S:
        return _moved(before, pose, REST_M, REST_RAD)
    # a base faster than ours says so itself
    v = max(JUMP_M_PER_S, min(1.5 * max(abs(before.v), abs(pose.v)), FASTEST_M_PER_S))
    w = max(JUMP_RAD_PER_S, min(1.5 * max(abs(before.w), abs(pose.w)), FASTEST_RAD_PER_S))
    return _moved(before, pose, JUMP_M + v * dt, JUMP_RAD + w * dt)
