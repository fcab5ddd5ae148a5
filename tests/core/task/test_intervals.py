"""Intervals over rooms and drives, many and few."""

import numpy as np
import pytest
from scipy.stats import binom

from cfnav_core.task.intervals import (
    FEW,
    bootstrap_interval,
    ends_text,
    interval_of_mean,
    interval_of_share,
    share_interval,
    why_none,
)


@pytest.mark.parametrize(
    ("hits", "trials", "low", "high"),
    [  # the first three: Newcombe, Two-Sided Confidence Intervals for the Single Proportion, 1998
        (81, 263, 0.2527, 0.3676), (15, 148, 0.0578, 0.1617), (0, 20, 0.0, 0.1684),
        (1, 29, 0.0009, 0.1776),
        (4, 4, 0.025 ** (1 / 4), 1.0), (0, 4, 0.0, 1 - 0.025 ** (1 / 4)), (1, 1, 0.025, 1.0),
    ],
)  # fmt: skip
def test_shares_have_the_interval_of_clopper_and_pearson(hits, trials, low, high):
    assert share_interval(hits / trials, trials) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize("trials", [1, 4, 10, 40])
@pytest.mark.parametrize("share", [0.02, 0.5, 0.85, 0.95, 0.98])
def test_it_holds_the_share_in_95_of_100_cases_however_few_the_drives(share, trials):
    """Every outcome with its probability, so nothing is drawn; a bootstrap fails most of these."""
    each = np.arange(trials)
    ends = [interval_of_share(each < hits, each) for hits in range(trials + 1)]
    held = [low <= share <= high for low, high in ends]
    assert binom.pmf(np.arange(trials + 1), trials, share)[held].sum() >= 0.95


def test_no_share_has_an_interval_of_no_width():
    for groups in (np.zeros(50), np.arange(50), np.arange(50) // 2, np.arange(50) // 10):
        for value in (True, False):
            low, high = interval_of_share(np.full(50, value), groups)
            assert high - low > 0.05
            assert low <= value <= high


def test_a_room_is_one_trial_however_many_its_episodes():
    one = np.arange(200) < 150
    assert interval_of_share(one, np.zeros(200)) == share_interval(0.75, 1)
    assert interval_of_share(one, np.arange(200) % 4) == share_interval(0.75, 4)
    # one room has nearly all the episodes: it counts as little more than one
    low, high = interval_of_share(one, np.maximum(np.arange(200) - 190, 0))
    assert high - low > 0.9


def test_many_rooms_of_several_episodes_are_resampled():
    rooms = np.repeat(np.arange(FEW), 5)
    values = np.arange(5 * FEW) % 3 > 0
    assert interval_of_share(values, rooms) == bootstrap_interval(values, rooms)
    fewer = rooms < FEW - 1
    found = interval_of_share(values[fewer], rooms[fewer])
    assert found == pytest.approx(share_interval(values[fewer].mean(), FEW - 1))


def test_a_bootstrap_resamples_rooms():
    # two rooms that never agree: the interval must span both, however many episodes each has
    values = np.r_[np.ones(500), np.zeros(500)]
    assert bootstrap_interval(values, np.repeat([0, 1], 500)) == (0.0, 1.0)
    low, high = bootstrap_interval(values, np.arange(1000))
    assert 0.46 < low < 0.5 < high < 0.54


def test_other_means_have_none_over_few_groups_or_without_a_spread():
    values = np.linspace(0.2, 0.8, FEW)
    assert interval_of_mean(values[1:], np.arange(FEW - 1)) is None
    low, high = interval_of_mean(values, np.arange(FEW))
    assert 0.35 < low < 0.5 < high < 0.65
    assert interval_of_mean(np.full(40, 0.7), np.arange(40)) is None
    assert interval_of_mean(np.tile((0.1, 0.2, 0.6), 40), np.arange(120) // 3) is None  # rounding
    assert why_none(3, "drives") == f"too few drives for an interval: 3, it takes {FEW}"
    assert why_none(40, "rooms") == "no interval, as all rooms are alike"


def test_ends_are_shown_or_why_there_are_none():
    assert ends_text((0.75, 0.9404)) == "[0.750, 0.940]"
    assert ends_text((-0.1, 0.2), sign="+") == "[-0.100, +0.200]"
    assert ends_text(None, "too few") == "(too few)"
