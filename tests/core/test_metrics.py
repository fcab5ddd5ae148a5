import numpy as np
import pytest

from cfnav_core.metrics import EpisodeResult, bootstrap_interval, cf_spl, cf_sr, spl, sr

EPISODES = [
    EpisodeResult(True, 0, 10, 5),  # collision-free, twice the shortest way
    EpisodeResult(True, 2, 5, 5),  # reached, but touched something
    EpisodeResult(False, 0, 30, 6),
    EpisodeResult(True, 0, 4, 4),
]


def test_figures_equal_those_worked_out_by_hand():
    assert sr(EPISODES) == 3 / 4
    assert cf_sr(EPISODES) == 2 / 4
    assert spl(EPISODES) == (0.5 + 1 + 1) / 4
    assert cf_spl(EPISODES) == (0.5 + 1) / 4


def test_a_path_shorter_than_the_shortest_counts_as_one():
    assert EpisodeResult(True, 0, 3.9, 4.0).efficiency == 1.0
    assert EpisodeResult(True, 0, 0.0, 0.0).efficiency == 1.0


def test_no_episodes_is_an_error():
    with pytest.raises(ValueError, match="no episodes"):
        cf_sr([])


def test_interval_resamples_rooms():
    # two rooms that never agree: the interval must span both, however many episodes each has
    values = np.r_[np.ones(500), np.zeros(500)]
    assert bootstrap_interval(values, np.repeat([0, 1], 500)) == (0.0, 1.0)
    low, high = bootstrap_interval(values, np.arange(1000))
    assert 0.46 < low < 0.5 < high < 0.54
