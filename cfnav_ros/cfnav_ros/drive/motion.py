"""One discrete motion, closed-loop on odometry: MoveAhead, RotateLeft, RotateRight.

Pure: time is an argument, and so is odometry that has not jumped (``track`` tells). The robot keeps
to the episode's eight headings: every motion steers for the grid heading, not for the heading it
happened to start with, so that what one turn leaves over is carried into the next.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from cfnav_core.robot.settings import setting
from cfnav_core.task.actions import STEP_M, TURN_RAD, Action


@dataclass(frozen=True)
class Odometry:
    """One odometry sample: seconds, metres and radians in the odom frame; v, w in base_link."""

    stamp: float
    x: float
    y: float
    yaw: float
    v: float = 0.0
    w: float = 0.0


@dataclass(frozen=True)
class Command:
    """Velocity of the base: v metres/s forward, w rad/s counter-clockwise. The default is zero."""

    v: float = 0.0
    w: float = 0.0


STOP = Command()


class Status(Enum):
    """Where a motion stands; all but DRIVING are final."""

    DRIVING = "driving"
    SUCCEEDED = "succeeded"
    BLOCKED = "blocked"
    BUMPED = "bumped"
    LATE = "late"
    STALLED = "stalled"
    PUSHED = "pushed"
    TIMEOUT = "timeout"


@dataclass(frozen=True)
class MotionLimits:
    """Speeds and tolerances of the executor.

    Sources:
        Ranges end at what the base can do: 0.306 m/s, 0.9 m/s^2, 1.9 rad/s (create3_docs
        ``safety.md``) and 7.7 rad/s^2 in place (create3_sim ``control.yaml``).
        Defaults of speeds and accelerations stay below that because a mast sways: at 0.20 m/s the
        robot stops within 0.08 m, reaction included.
        ``v_min``, ``w_min`` and the tolerances are those of the base's own drive actions
        (create3_sim ``drive_goal_behaviors.cpp``).
        Deadlines are three times the nominal durations, 1.65 s for 0.25 m and 1.3 s for 45 degrees.
        ``stall_time`` goes with ``STALL_M`` and ``STALL_RAD``: creeping at ``v_min`` makes more.
    """

    v_max: float = setting(0.20, "top speed, m/s", 0.01, 0.306, live=True)
    v_min: float = setting(0.05, "creep speed, m/s", 0.01, 0.306)
    a_lin: float = setting(0.5, "acceleration, m/s^2", 0.05, 0.9)
    w_max: float = setting(1.0, "top turn rate, rad/s", 0.05, 1.9, live=True)
    w_min: float = setting(0.1, "creep turn rate, rad/s", 0.05, 1.9)
    a_ang: float = setting(2.0, "turn acceleration, rad/s^2", 0.1, 7.7)
    tolerance_m: float = setting(0.005, "end of a MoveAhead, m", 0.001, 0.05)
    tolerance_deg: float = setting(0.5, "end of a turn, deg", 0.1, 5.0)
    move_deadline: float = setting(5.0, "s", 0.5, 60.0)
    turn_deadline: float = setting(4.0, "s", 0.5, 60.0)
    stall_time: float = setting(1.0, "no progress for this long, s", 0.2, 10.0)
    latency: float = setting(0.05, "until a command takes effect, s", 0.0, 1.0)
    heading_gain: float = setting(2.0, "rad/s per rad while driving", 0.0, 10.0)
    hold_rate: float = setting(0.5, "most of the heading hold, rad/s", 0.0, 1.9)

    def __post_init__(self) -> None:
        for low, high in (("v_min", "v_max"), ("w_min", "w_max")):
            if not 0 < getattr(self, low) <= getattr(self, high):
                raise ValueError(
                    f"{low} is {getattr(self, low)}, expected a number in (0, {high} = "
                    f"{getattr(self, high)}]."
                )
        for name in ("a_lin", "a_ang", "tolerance_m", "tolerance_deg", "stall_time"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected a positive number.")


MAX_GAP_S = 0.3
"""Updates further apart than this are a pause: the process stalled, and the base has stopped."""

STALL_M = 0.02
STALL_RAD = math.radians(2.0)
"""Progress expected within ``stall_time``."""

RETREAT = 1.5
"""Going back by this many stalls means that a reflex of the base has taken over."""

OFF_LINE_M, OFF_LINE_RAD = 0.06, math.radians(30.0)
"""Further from the line of a MoveAhead, or from the place of a turn, than the base can get by
itself: it drifts millimetres, and starts at most 10 degrees off its grid heading."""

ALIGN_RAD = math.radians(10.0)
"""A MoveAhead that starts further off its grid heading (after a push) is only a turn to it: nobody
has judged yet what lies ahead there."""


def wrap(angle: float) -> float:
    """The angle in [-pi, pi), radians."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def grid_heading(yaw: float, origin: float, turns: int = 0) -> float:
    """Heading of the episode's 45-degree set nearest to yaw, turned by some steps.

    Args:
        yaw: measured heading, radians.
        origin: any heading of the set, radians.
        turns: steps of 45 degrees, counter-clockwise positive.

    Returns:
        Radians in [-pi, pi).
    """
    return wrap(origin + (round(wrap(yaw - origin) / TURN_RAD) + turns) * TURN_RAD)


def trapezoid(
    remaining: float, previous: float, dt: float, top: float, floor: float, accel: float, lag: float
) -> float:
    """Speed of a ramp up, a cruise and a ramp that ends at the target.

    Args:
        remaining: way to go, metres or radians.
        previous: speed commanded last, per second.
        dt: seconds since then.
        top: highest speed.
        floor: lowest speed, so that friction cannot stop the robot short.
        accel: of both ramps.
        lag: seconds by which ``remaining`` is old.
    """
    braking = math.sqrt(2 * accel * max(remaining - previous * lag, 0.0))
    return max(min(top, braking, previous + accel * dt), floor)


class Motion:
    """The execution of one MoveAhead or turn; ``update`` at the velocity rate until final."""

    def __init__(
        self,
        action: Action,
        t: float,
        odometry: Odometry,
        origin: float,
        limits: MotionLimits = MotionLimits(),
        step: float = STEP_M,
    ) -> None:
        """Start a motion.

        Args:
            action: MoveAhead, RotateLeft or RotateRight.
            t: node time, seconds.
            odometry: where the robot stands now.
            origin: a heading of the episode's 45-degree set, odom frame, radians.
            limits: speeds and tolerances; may be replaced under way.
            step: length of MoveAhead, metres.

        Raises:
            ValueError: another action.
        """
        if action not in (Action.MoveAhead, Action.RotateLeft, Action.RotateRight):
            raise ValueError(f"{action.name} is no motion of the base.")
        self.action = action
        self.reason, self.backed_off = "", False
        self._side = {Action.RotateLeft: 1, Action.RotateRight: -1}.get(action, 0)
        self._heading = grid_heading(odometry.yaw, origin, self._side)
        error = wrap(self._heading - odometry.yaw)
        if not self._side and abs(error) > ALIGN_RAD:
            self._side = 1 if error > 0 else -1
        self._start = odometry
        self.limits, self._step = limits, step
        self._t, self._speed = t, 0.0
        self._deadline = t + (limits.turn_deadline if self._side else limits.move_deadline)
        self._mark = (t, self.remaining(odometry))
        self._status = Status.DRIVING
        self._trace = [(odometry.stamp, self.remaining(odometry))]

    @property
    def advances(self) -> bool:
        """Whether the base is to move on, not only to turn in place."""
        return not self._side

    def remaining(self, odometry: Odometry) -> float:
        """Way to go: metres along the grid heading, or radians in the sense of the turn."""
        if self._side:
            return self._side * wrap(self._heading - odometry.yaw)
        dx, dy = odometry.x - self._start.x, odometry.y - self._start.y
        return self._step - (dx * math.cos(self._heading) + dy * math.sin(self._heading))

    def remaining_at(self, stamp: float, odometry: Odometry) -> float:
        """Way that was left at a time (seconds) between the start and the newest odometry."""
        trace = [*self._trace, (odometry.stamp, self.remaining(odometry))]
        stamps, ways = zip(*trace, strict=True)
        return float(np.interp(stamp, stamps, ways))

    def update(self, t: float, odometry: Odometry) -> tuple[Command, Status]:
        """Advance to time t (seconds) with the newest odometry; zero velocity once final."""
        if self._status is not Status.DRIVING:
            return STOP, self._status
        dt, self._t = t - self._t, t
        remaining = self._follow(odometry)
        if dt > MAX_GAP_S:
            self._rest(dt, remaining)
            dt = 0.0
        self._status = self._judge(t, odometry, remaining)
        if self._status is not Status.DRIVING:
            return STOP, self._status
        return self._drive(remaining, odometry, dt, self._lag(t, odometry)), self._status

    def pause(self, t: float, odometry: Odometry) -> None:
        """The base is told to stand at time t (seconds): it starts anew, nothing counts against it.

        Going back meanwhile does: a base that was told to stand was pushed.
        """
        dt, self._t = t - self._t, t
        self._rest(dt, self._follow(odometry))

    def _follow(self, odometry: Odometry) -> float:
        remaining = self.remaining(odometry)
        if odometry.stamp > self._trace[-1][0]:
            self._trace.append((odometry.stamp, remaining))
        return remaining

    def _rest(self, dt: float, remaining: float) -> None:
        """Time that the base did not drive."""
        self._deadline += dt
        self._mark = (self._t, min(remaining, self._mark[1]))
        self._speed = 0.0

    def bump(self) -> None:
        """The bumper was hit: a MoveAhead ends, a turn goes on (it may be the way out)."""
        if not self._side:
            self.block("The bumper was hit.", Status.BUMPED)

    def block(self, reason: str, status: Status = Status.BLOCKED) -> None:
        """End the motion: something outside of it says so."""
        if self._status is Status.DRIVING:
            self._status, self.reason = status, reason

    def _judge(self, t: float, odometry: Odometry, remaining: float) -> Status:
        limits = self.limits
        tolerance = math.radians(limits.tolerance_deg) if self._side else limits.tolerance_m
        stall = STALL_RAD if self._side else STALL_M
        marked_t, marked = self._mark
        # By the time a zero takes effect the robot has gone on.
        if remaining <= tolerance + self._speed * self._lag(t, odometry):
            return Status.SUCCEEDED
        if remaining > marked + RETREAT * stall:
            self.backed_off = True
            self.reason = f"The base backed off during {self.action.name}."
            return Status.PUSHED
        if self._off_line(odometry):
            self.reason = f"The base left its line during {self.action.name}."
            return Status.PUSHED
        if marked - remaining >= stall:
            self._mark = (t, remaining)
        elif t - marked_t > limits.stall_time:
            self.reason = f"{self.action.name} made no progress for {limits.stall_time:g} s."
            return Status.STALLED
        if t > self._deadline:
            self.reason = f"{self.action.name} did not finish in time."
            return Status.TIMEOUT
        return Status.DRIVING

    def _off_line(self, odometry: Odometry) -> bool:
        """Whether the base is where its own drive cannot have brought it."""
        dx, dy = odometry.x - self._start.x, odometry.y - self._start.y
        if self._side:
            return math.hypot(dx, dy) > OFF_LINE_M
        aside = dy * math.cos(self._heading) - dx * math.sin(self._heading)
        turned = abs(wrap(self._heading - odometry.yaw))
        return abs(aside) > OFF_LINE_M or turned > OFF_LINE_RAD

    def _lag(self, t: float, odometry: Odometry) -> float:
        """Seconds from the sample until a command sent now takes effect."""
        return self.limits.latency + min(max(t - odometry.stamp, 0.0), MAX_GAP_S)

    def _drive(self, remaining: float, odometry: Odometry, dt: float, lag: float) -> Command:
        limits = self.limits
        if self._side:
            self._speed = trapezoid(
                remaining, self._speed, dt, limits.w_max, limits.w_min, limits.a_ang, lag
            )
            return Command(w=self._side * self._speed)
        error = wrap(self._heading - odometry.yaw)
        hold = max(-limits.hold_rate, min(limits.hold_rate, limits.heading_gain * error))
        self._speed = trapezoid(
            remaining, self._speed, dt, limits.v_max, limits.v_min, limits.a_lin, lag
        )
        return Command(self._speed, hold)
