"""Every kind of p_hat is made of what it says that it needs, and of nothing else."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from cfnav_core.task.p_hat import (
    DRIVEN,
    FORMERLY,
    SOURCES,
    TESTED,
    Known,
    PHat,
    check_kind,
    make_p_hat,
    recorded,
)

OWN, LIDAR = np.float32([0.1, 0.8, 0.3]), np.float32([0.4, 0.2, 0.3])
EARLIER = np.float32([[0.5, 0.6, 0.7], [0.9, 0.9, 0.9]])
EVERYTHING = Known(
    zero=np.zeros(3, np.float32), own=lambda: OWN, lidar=LIDAR, truth=np.float32([0, 1, 0]),
    mixed=lambda rows: rows[[1, 2, 0]], earlier=EARLIER,
)  # fmt: skip
NOTHING = Known(EVERYTHING.zero)


def test_the_kinds_by_hand():
    expected = {
        "own": OWN, "lidar": LIDAR, "both": [0.4, 0.8, 0.3], "zero": [0, 0, 0], "true": [0, 1, 0],
        "other_episode": [0.8, 0.3, 0.1],
    }  # fmt: skip
    for kind, values in expected.items():
        np.testing.assert_array_equal(make_p_hat(kind, EVERYTHING), np.float32(values))
    assert set(expected) | {"earlier"} == set(SOURCES) == set(get_args(PHat))
    assert set(TESTED) | set(DRIVEN) == set(SOURCES)


def test_an_earlier_one_is_drawn_by_the_number_of_the_decision_alone():
    said = np.arange(40, dtype=np.float32)[:, None]
    given = [
        float(make_p_hat("earlier", replace(NOTHING, lidar=said[n], earlier=said[:n]))[0])
        for n in range(40)
    ]
    assert given[0] == 0
    assert all(value <= n for n, value in enumerate(given))
    assert len(set(given)) > 10
    again = make_p_hat("earlier", replace(NOTHING, lidar=said[30], earlier=said[:30]))
    assert float(again[0]) == given[30]


@pytest.mark.parametrize("kind", SOURCES)
def test_a_kind_needs_what_it_says(kind):
    needed = {name: getattr(EVERYTHING, name) for name in SOURCES[kind].needs}
    alone = replace(NOTHING, **needed)
    np.testing.assert_array_equal(make_p_hat(kind, alone), make_p_hat(kind, EVERYTHING))
    assert set(needed) <= {f.name for f in fields(Known)}
    for name in needed:
        with pytest.raises(ValueError, match=rf"p_hat is '{kind}', .* nothing is known .* {name}"):
            make_p_hat(kind, replace(alone, **{name: None}))


@pytest.mark.parametrize("among", [TESTED, DRIVEN])
def test_the_word_that_meant_two_things_is_answered_with_both(among):
    assert [check_kind(kind, among) for kind in among] == list(among)
    with pytest.raises(ValueError, match=r"meant two things: .* other_episode .* earlier "):
        check_kind(FORMERLY, among)
    with pytest.raises(ValueError, match=rf"p_hat is 'rgb', expected .* or {among[-1]}"):
        check_kind("rgb", among)


def test_results_recorded_under_the_old_word_are_found(tmp_path: Path):
    old, new = (tmp_path / f"test_{kind}_abc.npz" for kind in (FORMERLY, "other_episode"))
    assert recorded(new) == new
    old.touch()
    assert recorded(new) == old
    assert recorded(tmp_path / "ours_earlier_seed0_20.jsonl").name == "ours_earlier_seed0_20.jsonl"
    new.touch()
    assert recorded(new) == new
