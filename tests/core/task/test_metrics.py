import numpy as np
import pytest

from cfnav_core.task.intervals import FEW, share_interval
from cfnav_core.task.metrics import (
    EpisodeResult,
    cf_spl,
    cf_sr,
    figures,
    paired,
    paired_text,
    spl,
    sr,
)

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


def test_a_clean_evaluation_of_one_room_is_not_sure():
    clean = [EpisodeResult(True, 0, 4, 4)] * 100
    assert figures(clean, np.full(100, "kitchen:20"))["cf_sr_interval"] == share_interval(1.0, 1)


def test_a_difference_over_few_rooms_has_no_interval_and_says_so():
    a, b = np.array([1, 1, 0, 1], bool), np.array([1, 0, 0, 0], bool)
    found = paired(a, b, np.array(["kitchen:20", "kitchen:21"] * 2))
    assert (found["cf_sr_difference"], found["interval"]) == (0.5, None)
    assert paired_text(found) == (f"+0.500 (too few rooms for an interval: 2, it takes {FEW})")
    many = paired(np.tile(a, 10), np.tile(b, 10), np.arange(40))
    low, high = many["interval"]
    assert 0.3 < low < 0.5 < high < 0.7
    assert paired_text(many) == f"+0.500 [{low:+.3f}, {high:+.3f}]"
    # as bundles recorded it
    assert paired_text({"cf_sr_difference": -0.1, "interval": [-0.2, 0.05]}) == (
        "-0.100 [-0.200, +0.050]"
    )
    same = paired(np.tile(a, 10), np.tile(a, 10), np.arange(40))
    assert paired_text(same) == "+0.000 (no interval, as all rooms are alike)"
