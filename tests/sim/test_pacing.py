"""When messages are due, and how simulated time keeps to the wall clock."""

import itertools

import pytest
from sim_bridge.ros.pacing import Every, Pacer


@pytest.mark.parametrize(("rate", "seconds"), [(15.0, 20), (7.7, 20), (20.0, 20)])
def test_mean_rate_is_exact_on_the_grid_of_steps(rate, seconds):
    every = Every(1.0 / rate, lambda: None)
    times = [step * 0.01 for step in range(seconds * 100) if every.due(step * 0.01)]
    assert len(times) == pytest.approx(rate * seconds, abs=1)
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert max(abs(gap - 1.0 / rate) for gap in gaps) <= 0.01 + 1e-9


def test_pacer_waits_for_the_wall_clock_times_speed():
    pacer = Pacer(2.0)
    pacer.restart(5.0, 100.0)
    assert pacer.ahead(6.0, 100.1) == pytest.approx(0.4)
    assert pacer.ahead(6.0, 100.6) == pytest.approx(-0.1)
    assert pacer.ahead(7.0, 100.7) == pytest.approx(0.3)  # the lag was caught up


def test_pacer_forgives_a_long_lag():
    pacer = Pacer(1.0)
    pacer.restart(0.0, 0.0)
    assert pacer.ahead(1.0, 3.0) == pytest.approx(-2.0)
    assert pacer.ahead(1.1, 3.0) == pytest.approx(0.1)


def test_pacer_at_speed_zero_never_waits():
    assert Pacer(0.0).ahead(1000.0, 0.0) == 0.0
