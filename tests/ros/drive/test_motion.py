"""Discrete motions on a small base model: accelerations, late odometry, faults."""

import math
from itertools import pairwise

import pytest
from cfnav_ros.drive.motion import (
    STOP,
    Command,
    Motion,
    MotionLimits,
    Odometry,
    Status,
    grid_heading,
    trapezoid,
    wrap,
)

from cfnav_core.task.actions import Action

DT = 0.05


class Base:
    """A differential base with bounded acceleration; its odometry is one period old."""

    def __init__(self, yaw=0.0, drift=0.0, moves=True, gain=1.0):
        self.x = self.y = 0.0
        self.yaw, self.v, self.w, self.t = yaw, 0.0, 0.0, 0.0
        self.drift, self.moves, self.gain = drift, moves, gain
        self.reported = self._sample()

    def _sample(self):
        return Odometry(self.t, self.x, self.y, wrap(self.yaw), self.v, self.w)

    def drive(self, command, dt=DT):
        self.reported = self._sample()
        steps = 10
        for _ in range(steps):
            self.v += (
                max(-0.9, min(0.9, (command.v * self.gain - self.v) / (dt / steps))) * dt / steps
            )
            self.w += max(-7.0, min(7.0, (command.w - self.w) / (dt / steps))) * dt / steps
            if self.moves:
                self.x += self.v * math.cos(self.yaw) * dt / steps
                self.y += self.v * math.sin(self.yaw) * dt / steps
                self.yaw += (self.w + self.drift * self.v) * dt / steps
        self.t += dt


def run(base, action, origin=0.0, limits=MotionLimits(), change=None):  # noqa: B008
    """Drive one motion to its end and to rest; returns (status, motion, commands)."""
    motion = Motion(action, base.t, base.reported, origin, limits)
    commands, status = [], Status.DRIVING
    while status is Status.DRIVING:
        odometry = change(base) if change else base.reported
        command, status = motion.update(base.t, odometry)
        commands.append(command)
        base.drive(command)
        assert base.t < 60, "the motion never ended"
    for _ in range(10):
        base.drive(STOP)
    return status, motion, commands


def test_move_ahead_ends_a_quarter_metre_further():
    base = Base()
    status, _, commands = run(base, Action.MoveAhead)
    assert status is Status.SUCCEEDED
    assert base.x == pytest.approx(0.25, abs=0.01)
    assert abs(base.y) < 1e-6
    assert len(commands) * DT < 2.6
    assert commands[-1] == STOP
    assert max(c.v for c in commands) == pytest.approx(0.2)


@pytest.mark.parametrize("action", [Action.RotateLeft, Action.RotateRight])
def test_a_turn_is_45_degrees(action):
    base = Base()
    status, _, commands = run(base, action)
    sign = 1 if action is Action.RotateLeft else -1
    assert status is Status.SUCCEEDED
    assert math.degrees(base.yaw) == pytest.approx(45 * sign, abs=1.0)
    assert all(c.v == 0 for c in commands)
    assert max(abs(c.w) for c in commands) <= 1.0


@pytest.mark.parametrize("periods", [2, 4])
def test_late_odometry_costs_centimetres_not_decimetres(periods):
    """Without looking at its stamp the robot would drive 0.2 m/s times the delay too far."""
    base, history = Base(), []

    def late(base):
        history.append(base.reported)
        return history[max(len(history) - 1 - periods, 0)]

    status, _, _ = run(base, Action.MoveAhead, change=late)
    assert status is Status.SUCCEEDED
    assert base.x == pytest.approx(0.25, abs=0.012)
    base = Base()
    history.clear()
    status, _, _ = run(base, Action.RotateLeft, change=late)
    assert status is Status.SUCCEEDED
    assert math.degrees(base.yaw) == pytest.approx(45.0, abs=2.0)


def test_turns_do_not_add_up_their_errors():
    """Every turn may end a little off, none is further off than one: also past +-180 degrees."""
    base = Base(yaw=0.3)
    for k in range(1, 25):
        run(base, Action.RotateLeft, origin=0.3)
        assert abs(math.degrees(wrap(base.yaw - 0.3 - k * math.pi / 4))) < 1.0


def test_what_a_turn_left_over_goes_into_the_next():
    base = Base(yaw=math.radians(8))
    run(base, Action.RotateRight, origin=0.0)
    assert math.degrees(base.yaw) == pytest.approx(-45, abs=1.0)


def test_move_ahead_holds_the_grid_heading_against_a_drifting_base():
    crooked, straight = Base(drift=0.4), Base(drift=0.4)
    run(crooked, Action.MoveAhead, limits=MotionLimits(heading_gain=0.0))
    run(straight, Action.MoveAhead)
    assert abs(straight.yaw) < abs(crooked.yaw) / 1.3
    off = Base(yaw=math.radians(6))
    run(off, Action.MoveAhead, origin=0.0)
    assert abs(math.degrees(off.yaw)) < 1.5


def test_a_base_that_does_not_move_is_blocked_after_the_stall_time():
    base = Base(moves=False)
    status, motion, commands = run(base, Action.MoveAhead)
    assert status is Status.STALLED
    assert "no progress" in motion.reason
    assert 1.0 < len(commands) * DT < 1.3
    status, _, _ = run(Base(moves=False), Action.RotateLeft)
    assert status is Status.STALLED


@pytest.mark.parametrize("action", [Action.MoveAhead, Action.RotateLeft])
def test_sliding_sideways_is_a_push(action):
    def sideways(base):
        return Odometry(base.t, base.x, base.y + 0.3 * base.t, wrap(base.yaw), 0.2, base.w)

    status, motion, commands = run(Base(), action, change=sideways)
    assert status is Status.PUSHED
    assert "left its line" in motion.reason
    assert len(commands) * DT < 0.4


def test_sideways_within_the_line_is_no_progress():
    def sideways(base):
        return Odometry(base.t, 0.0, min(0.05, 0.2 * base.t), 0.0, 0.2, 0.0)

    status, _, _ = run(Base(), Action.MoveAhead, change=sideways)
    assert status is Status.STALLED


def test_being_turned_off_its_line_is_a_push():
    base = Base()
    motion = Motion(Action.MoveAhead, 0.0, base.reported, 0.0)
    turned = Odometry(0.05, 0.0, 0.0, math.radians(31), 0.1, 0.0)
    assert motion.update(0.05, turned) == (STOP, Status.PUSHED)


@pytest.mark.parametrize("degrees", [-22, -11, 11, 22])
def test_a_move_that_starts_off_its_heading_only_turns_to_it(degrees):
    """As after a push, up to half of 45 degrees: ahead there nobody has looked yet."""
    base = Base(yaw=math.radians(degrees))
    status, motion, commands = run(base, Action.MoveAhead, origin=0.0)
    assert (status, motion.advances) == (Status.SUCCEEDED, False)
    assert all(c.v == 0 for c in commands)
    assert abs(math.degrees(base.yaw)) < 1.0
    status, motion, _ = run(base, Action.MoveAhead, origin=0.0)
    assert (status, motion.advances) == (Status.SUCCEEDED, True)
    assert (base.x, base.y) == pytest.approx((0.25, 0.0), abs=0.02)


def test_a_base_that_cannot_align_stalls():
    status, _, commands = run(Base(yaw=0.3, moves=False), Action.MoveAhead, origin=0.0)
    assert status is Status.STALLED
    assert all(c.v == 0 for c in commands)


def test_a_reflex_that_backs_off_is_blocked_at_once():
    def backing(base):
        return Odometry(base.t, -0.15 * base.t, 0.0, 0.0, -0.15, 0.0)

    status, motion, commands = run(Base(), Action.MoveAhead, change=backing)
    assert status is Status.PUSHED
    assert "backed off" in motion.reason
    assert len(commands) * DT < 0.5


def test_a_base_that_creeps_times_out():
    def creeping(base):
        return Odometry(base.t, 0.03 * base.t, 0.0, 0.0, 0.03, 0.0)

    status, motion, commands = run(Base(), Action.MoveAhead, change=creeping)
    assert status is Status.TIMEOUT
    assert "in time" in motion.reason
    assert 5.0 < len(commands) * DT < 5.3


def test_a_gap_in_the_updates_counts_neither_as_stall_nor_as_delay():
    base = Base()
    motion = Motion(Action.MoveAhead, 0.0, base.reported, 0.0)
    for _ in range(5):
        base.drive(motion.update(base.t, base.reported)[0])
    for _ in range(200):
        base.drive(STOP)
    command, status = motion.update(base.t, base.reported)
    assert status is Status.DRIVING
    assert command.v == pytest.approx(0.05)  # it starts again from rest
    while status is Status.DRIVING:
        command, status = motion.update(base.t, base.reported)
        base.drive(command)
    assert status is Status.SUCCEEDED


@pytest.mark.parametrize("ticks", [1, 3, 5, 200])
def test_a_pause_starts_anew_from_rest_and_counts_against_nothing(ticks):
    base, limits = Base(), MotionLimits()
    motion = Motion(Action.MoveAhead, 0.0, base.reported, 0.0)
    for _ in range(12):
        command, status = motion.update(base.t, base.reported)
        base.drive(command)
    assert command.v == pytest.approx(0.2)
    for _ in range(ticks):
        motion.pause(base.t, base.reported)
        base.drive(STOP)
    speeds = [0.0]
    while status is Status.DRIVING:
        command, status = motion.update(base.t, base.reported)
        speeds.append(command.v)
        base.drive(command)
    assert status is Status.SUCCEEDED
    rises = [after - before for before, after in pairwise(speeds)]
    assert max(rises) <= max(limits.v_min, limits.a_lin * DT) + 1e-9


def test_a_slow_push_back_during_a_pause_is_a_push():
    base = Base()
    motion = Motion(Action.MoveAhead, 0.0, base.reported, 0.0)
    for k in range(1, 41):
        pushed = Odometry(k * DT, -0.004 * k, 0.0, 0.0)
        motion.pause(k * DT, pushed)
    assert motion.update(41 * DT, pushed) == (STOP, Status.PUSHED)


def test_block_and_bump_end_a_move_but_not_a_turn():
    base = Base()
    move = Motion(Action.MoveAhead, 0.0, base.reported, 0.0)
    move.bump()
    assert move.update(0.05, base.reported) == (STOP, Status.BUMPED)
    turn = Motion(Action.RotateLeft, 0.0, base.reported, 0.0)
    turn.bump()
    assert turn.update(0.05, base.reported)[1] is Status.DRIVING


def test_trapezoid_against_numbers_worked_by_hand():
    # Ramp up: 0.10 + 0.5 * 0.05. Brake: sqrt(2 * 0.5 * (0.02 - 0.2 * 0.05)) = 0.1. Floor.
    assert trapezoid(0.25, 0.10, 0.05, 0.2, 0.05, 0.5, 0.05) == pytest.approx(0.125)
    assert trapezoid(0.02, 0.20, 0.05, 0.2, 0.05, 0.5, 0.05) == pytest.approx(0.1)
    assert trapezoid(0.001, 0.05, 0.05, 0.2, 0.05, 0.5, 0.05) == 0.05


def test_grid_heading_is_the_nearest_of_eight():
    assert grid_heading(0.1, 0.0) == pytest.approx(0.0)
    assert grid_heading(-3.1, 0.0, turns=-1) == pytest.approx(math.radians(135))
    assert grid_heading(0.45, 0.1, turns=1) == pytest.approx(0.1 + math.radians(45))


def test_other_actions_and_bad_limits_are_refused():
    with pytest.raises(ValueError, match="LookUp is no motion"):
        Motion(Action.LookUp, 0.0, Odometry(0, 0, 0, 0), 0.0)
    with pytest.raises(ValueError, match=r"v_min is 0\.3"):
        MotionLimits(v_min=0.3)
    assert Command() == STOP
