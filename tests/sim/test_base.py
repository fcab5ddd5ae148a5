"""The Create 3's limits and odometry against numbers worked out by hand."""

import math

import pytest
from sim_bridge.robot.base import Base, SimulatedOdometry

DT = 0.01


def run(base, v, w, seconds, *, renew=True, t=0.0):
    """Velocities at the end of each step; the command is sent once, or renewed every step."""
    base.command(t, v, w)
    velocities = []
    for step in range(round(seconds / DT)):
        if renew:
            base.command(t + step * DT, v, w)
        velocities.append(base.update(t + step * DT, DT))
    return velocities


def test_speed_grows_by_0_009_per_step_up_to_the_limit():
    forward = [v for v, _ in run(Base(), 0.2, 0.0, 0.5)]
    assert forward[0] == pytest.approx(0.009)
    assert forward[21] == pytest.approx(22 * 0.009)  # 0.198: one step short of the command
    assert forward[22:] == pytest.approx([0.2] * 28)


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ((0.5, 0.0), (0.306, 0.0)),
        ((-0.5, 0.0), (-0.306, 0.0)),
        ((0.0, 3.0), (0.0, 1.9)),
        # Wheels 0.25 +- 0.1165 m/s: the outer one asks for 0.3665, all shrinks by 0.306 / 0.3665.
        ((0.25, 1.0), (0.25 * 0.306 / 0.3665, 0.306 / 0.3665)),
        # Wheels 0.05 +- 0.233 m/s are allowed, 2.0 rad/s is not: all shrinks by 1.9 / 2.
        ((0.05, 2.0), (0.0475, 1.9)),
    ],
)
def test_limits_keep_the_curvature(command, expected):
    assert run(Base(), *command, 1.0)[-1] == pytest.approx(expected)


def test_yaw_in_place_accelerates_with_both_wheels():
    yaw_rates = [w for _, w in run(Base(), 0.0, 1.9, 0.5)]
    assert yaw_rates[0] == pytest.approx(0.9 / (0.233 / 2) * DT)  # 7.725 rad/s^2
    assert yaw_rates[23] == pytest.approx(24 * 0.0772532, rel=1e-5)
    assert yaw_rates[24] == pytest.approx(1.9)


def test_curvature_holds_while_speeding_up():
    velocities = run(Base(), 0.2, 0.5, 0.4)
    assert [w / v for v, w in velocities] == pytest.approx([2.5] * 40)


def test_command_expires_half_a_second_after_it_was_received():
    forward = [v for v, _ in run(Base(), 0.2, 0.0, 1.0, renew=False)]
    assert forward[49] == pytest.approx(0.2)
    assert forward[50] == pytest.approx(0.191)
    assert forward[72] == 0.0


def test_base_without_a_command_stands_still():
    assert Base().update(0.0, DT) == (0.0, 0.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_command_that_is_not_finite_stops(bad):
    base = Base()
    run(base, 0.2, 0.0, 0.5)
    base.command(0.5, bad, 0.0)
    for step in range(23):
        v, _ = base.update(0.5 + step * DT, DT)
    assert v == 0.0


def test_stop_forgets_speed_and_command():
    base = Base()
    run(base, 0.2, 0.0, 0.5)
    base.stop()
    assert base.update(0.5, DT) == (0.0, 0.0)


def test_odometry_follows_a_square():
    odometry = SimulatedOdometry()
    for _ in range(3):
        odometry.move(1.0, 0.0, math.pi / 2)
    assert (odometry.x, odometry.y) == pytest.approx((0.0, 1.0))
    assert odometry.yaw == pytest.approx(-math.pi / 2)
    odometry.move(0.5, 0.25, 0.0)
    assert (odometry.x, odometry.y) == pytest.approx((0.25, 0.5))
