"""Outcomes of episodes: the live account beside that of the bag, and figures over them."""

from __future__ import annotations

import dataclasses

import pytest
from cfnav_ros.drive.outcome import Outcome, agree, figures, nearest, table

CLEAN = Outcome("Mug", "kitchen:25", "done", True, 0, True, 6, 1.0, 1.0)


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({}, True),
        ({"path_length_m": 1.019}, True),
        ({"path_length_m": 1.03}, False),
        ({"shortest_path_m": 1.001}, False),
        ({"collisions": 1}, False),
        ({"steps": 7}, False),
        ({"outcome": "step_limit"}, False),
        ({"success": False}, False),
    ],
)
def test_a_bag_agrees_when_all_is_equal_but_for_the_sampling_of_the_path(
    change: dict, same: bool
) -> None:
    assert agree(CLEAN, dataclasses.replace(CLEAN, **change)) is same


def test_figures_over_episodes() -> None:
    touched = dataclasses.replace(CLEAN, collisions=2, cf_success=False, path_length_m=2.0)
    missed = dataclasses.replace(CLEAN, success=False, cf_success=False)
    assert figures([CLEAN, touched, missed]) == pytest.approx(
        {"sr": 2 / 3, "spl": 1.5 / 3, "cf_sr": 1 / 3, "cf_spl": 1 / 3}
    )


def test_the_table_has_a_line_an_episode() -> None:
    head, line = table([CLEAN]).splitlines()
    assert head.split() == ["room", "goal", "outcome", "reached", "touched", "steps", "m"]
    assert line.split() == ["kitchen:25", "Mug", "done", "yes", "0", "6", "1.00"]


def test_the_nearest_sample_is_the_first_of_two_as_near() -> None:
    @dataclasses.dataclass(frozen=True)
    class At:
        t_ns: int

    assert nearest([At(0), At(10), At(20)], 15) == At(10)
    assert nearest([At(0), At(10), At(20)], 16) == At(20)
