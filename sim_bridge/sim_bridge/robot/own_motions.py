"""What the base does by itself, ignoring commands: reflexes, actions, undocking and docking.

Pure: the motion made so far is told step by step.
"""

from __future__ import annotations

import math
from collections.abc import Collection

BACK_OFF_SPEED = -0.14
BACK_OFF_M = (0.05, 0.15)
"""m/s, and m that the reflex backs off at least and at most.

Source: create3_sim ``reflex_behavior.hpp``.
"""

BACK_OFF_S = 2.0
"""s after which a reflex that cannot move gives up. Assumed."""

UNDOCK_M, UNDOCK_SPEED = 0.3, -0.15
UNDOCK_TURN, UNDOCK_RATE = math.pi, 1.0
"""m, m/s, rad and rad/s of leaving the dock: backward, then around (create3_docs). The numbers are
assumed."""

UNDOCK_S = 15.0
"""s after which a base that has not left its dock and turned gives up; unhindered it takes half of
it. Assumed."""

ACTION = (0.1, 0.5)
"""m/s and rad/s of an action that a button has begun, such as wall_follow: a circle of 0.2 m.
Assumed."""

FREEING_SPEED, FREEING_RATE, FREEING_TURN_S = -0.05, 1.5, 0.5
"""m/s, rad/s to either side in turn, and s of each turn with which a base that is stuck tries to
get free. create3_docs ``reflexes.md`` calls what STUCK and PANIC do aggressive; the numbers are
assumed."""

DOCK_VISIBLE_M = 1.0
DOCK_SPEED = 0.15
DOCK_S = 30.0
"""m from which the dock is seen, m/s toward it, and s after which the base gives up. Source of the
last two: create3_sim ``docking_behavior.cpp``; the first is assumed."""

ARRIVED = 0.01
"""m and rad within which the base is where its own motion leads."""

BACKUP_M = 0.15
BACKUP_LOW_M = 0.05
"""m that commands may drive backward after driving forward as much, and what is left of it when
the base begins to warn. Source: create3_sim ``motion_control_node.cpp``."""


def imposed(faults: Collection[str], t: float) -> tuple[float, float] | None:
    """What a fault makes the base do at time t, s: m/s and rad/s, None when none does."""
    if "base_action" in faults:
        return ACTION
    if "base_frees_itself" in faults:
        side = 1 if int(t / FREEING_TURN_S) % 2 else -1
        return FREEING_SPEED, side * FREEING_RATE
    return None


class BackupBuffer:
    """How far commands may still drive backward: the base sees nothing behind it."""

    def __init__(self) -> None:
        self.left = 0.0
        """m."""

    @property
    def low(self) -> bool:
        """Whether the base reports BACKUP_LIMIT."""
        return self.left <= BACKUP_LOW_M

    def move(self, forward: float) -> None:
        """Count a motion, m forward."""
        self.left = min(BACKUP_M, max(0.0, self.left + forward))

    def limit(self, v: float, w: float) -> tuple[float, float]:
        """The command that is left of one: m/s, rad/s."""
        return (0.0, 0.0) if v < 0 and self.left <= 0 else (v, w)


class BackOff:
    """The bump reflex: back until the bumper is free, within ``BACK_OFF_M``."""

    def __init__(self) -> None:
        self._driven = self._spent = 0.0

    def update(
        self, dt: float, forward: float, turn: float, pressed: bool
    ) -> tuple[float, float] | None:
        """Go on.

        Args:
            dt: s since the last call.
            forward: m driven in it.
            turn: rad turned in it.
            pressed: whether the bumper is.

        Returns:
            m/s and rad/s to drive with, None when it is over.
        """
        self._driven -= forward
        self._spent += dt
        least, most = BACK_OFF_M
        free = self._driven >= least and not pressed
        if free or self._driven >= most or self._spent > BACK_OFF_S:
            return None
        return BACK_OFF_SPEED, 0.0


class Undock:
    """Back off the dock, then turn around."""

    def __init__(self) -> None:
        self._driven = self._turned = self._spent = 0.0
        self.done = False
        """Whether it was carried out to its end."""

    @property
    def left(self) -> bool:
        """Whether the robot has left the dock."""
        return self._driven >= UNDOCK_M

    def update(
        self, dt: float, forward: float, turn: float, pressed: bool
    ) -> tuple[float, float] | None:
        """Go on; arguments and result as in ``BackOff.update``."""
        self._spent += dt
        if self._spent > UNDOCK_S:
            return None
        if not self.left:
            self._driven -= forward
            return UNDOCK_SPEED, 0.0
        self._turned += turn
        to_go = UNDOCK_TURN - self._turned
        self.done = to_go < ARRIVED
        return None if self.done else (0.0, _slower(to_go, UNDOCK_RATE))


class Dock:
    """Turn to the dock, drive onto it, and turn as it lies.

    A base with sight follows the beams of its dock; this one counts its way.

    Args:
        bearing: of the dock from the robot's front, rad.
        distance: to it, m.
        heading: in which the robot sits on it, from its front, rad.
    """

    def __init__(self, bearing: float, distance: float, heading: float) -> None:
        self._bearing, self._to_go, self._heading = bearing, distance, heading
        self._spent = 0.0
        self._drives = False
        self.done = False
        """Whether it was carried out to its end."""

    def update(
        self, dt: float, forward: float, turn: float, pressed: bool
    ) -> tuple[float, float] | None:
        """Go on; arguments and result as in ``BackOff.update``."""
        self._spent += dt
        self._bearing -= turn
        self._heading -= turn
        self._to_go -= forward
        if self._spent > DOCK_S:
            return None
        if self._to_go > ARRIVED:
            if abs(self._bearing) > ARRIVED and not self._drives:
                return 0.0, _slower(self._bearing, UNDOCK_RATE)
            self._drives = True
            return min(DOCK_SPEED, max(0.02, 2.0 * self._to_go)), 0.0
        self.done = abs(self._heading) < ARRIVED
        return None if self.done else (0.0, _slower(self._heading, UNDOCK_RATE))


def _slower(to_go: float, rate: float) -> float:
    """rad/s in proportion to what is left, so that it arrives and does not shoot past."""
    return math.copysign(min(rate, max(0.1, 2.0 * abs(to_go))), to_go)
