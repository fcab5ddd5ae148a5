"""Means and intervals over seeds and rooms."""

from __future__ import annotations

import numpy as np
import pytest

from studies.engine.statistics import (
    interval,
    interval_of_seeds,
    interval_of_trials,
    over_seeds,
)


def test_mean_and_spread_are_of_the_seeds() -> None:
    values = np.array([[1.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0]])
    mean, spread = over_seeds(values)
    assert mean == 0.625
    assert spread == pytest.approx(np.std([0.5, 0.75], ddof=1))
    assert over_seeds(values[:1])[1] is None


def test_no_difference_has_an_interval_of_nothing() -> None:
    assert interval(np.zeros((3, 20)), np.arange(20) // 4) == (0.0, 0.0)


def test_rooms_that_differ_widen_the_interval_more_than_episodes_do() -> None:
    rooms = np.repeat(np.arange(10), 50)
    by_room = np.repeat(np.tile([0.0, 1.0], 5), 50)[None].repeat(5, 0)
    by_episode = np.tile([0.0, 1.0], 250)[None].repeat(5, 0)
    low, high = interval(by_room, rooms)
    assert high - low > 0.4
    low, high = interval(by_episode, rooms)
    assert high - low < 0.01


def test_seeds_that_differ_widen_the_interval() -> None:
    rooms = np.repeat(np.arange(10), 50)
    alike, apart = np.full((5, 500), 0.5), np.repeat([[0.0], [0.25], [0.5], [0.75], [1.0]], 500, 1)
    assert interval(alike, rooms) == (0.5, 0.5)
    low, high = interval(apart, rooms)
    assert low < 0.25
    assert high > 0.75


def test_the_interval_covers_the_truth_as_often_as_it_says() -> None:
    """Seeds and rooms drawn with known spreads, 200 times: about 95 % hold the true mean 0."""
    rng = np.random.default_rng(0)
    rooms = np.repeat(np.arange(20), 10)
    held = 0
    for n in range(200):
        seeds = rng.normal(0, 0.1, (8, 1))
        of_rooms = rng.normal(0, 0.2, 20)[rooms][None]
        low, high = interval(seeds + of_rooms + rng.normal(0, 0.5, (8, 200)), rooms, seed=n)
        held += low <= 0 <= high
    assert 170 <= held <= 200


def test_the_interval_of_few_seeds_covers_the_truth() -> None:
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(1000):
        low, high = interval_of_seeds(rng.normal(0.1, 0.05, 4))
        held += low <= 0.1 <= high
    assert 930 <= held <= 970


def test_the_interval_of_few_trials_in_fixed_rooms_is_no_point() -> None:
    """12 of 15, four in each room: the rooms are alike, the trials are not."""
    difference = np.tile([1.0, 1.0, 1.0, 1.0, 0.0], 3)[None]
    low, high = interval_of_trials(difference, np.repeat(["a", "b", "c"], 5))
    assert 0.5 < low < 0.7
    assert 0.9 < high <= 1.0


@pytest.mark.parametrize(("seeds", "apart"), [(1, 0.0), (5, 0.0), (8, 0.2)])
def test_the_interval_of_trials_covers_the_truth(seeds: int, apart: float) -> None:
    rng = np.random.default_rng(0)
    rooms, held = np.tile([0, 1, 2], 10), 0
    of_rooms = np.array([-0.3, 0.0, 0.3])[rooms]  # fixed: no part of the doubt
    for n in range(200):
        found = rng.normal(0, apart, (seeds, 1)) + of_rooms + rng.normal(0, 0.5, (seeds, 30))
        low, high = interval_of_trials(found, rooms, seed=n)
        held += low <= 0 <= high
    assert 170 <= held <= 200
