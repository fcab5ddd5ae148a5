"""Which episodes the path figure shows."""

import numpy as np

from studies.engine.results import Results
from studies.paper.paths import telling


def results(success, collisions):
    n = len(success)
    return Results(
        np.array([success], bool), np.array([collisions]), np.ones((1, n)), np.ones((1, n)),
        np.array(list("aabbc")), frozenset(), frozenset(), "episodes",
    )  # fmt: skip


def test_the_worst_episode_of_each_room_that_was_then_driven_clean_comes_first():
    first = results([0, 0, 1, 0, 0], [9, 7, 2, 3, 5])
    second = results([1, 1, 1, 1, 0], [1, 0, 0, 0, 0])
    assert telling(first, second) == [1, 3]  # episode 0 touched again, 4 missed its goal


def test_an_episode_without_a_collision_shows_nothing():
    clean = results([1] * 5, [0] * 5)
    assert telling(clean, clean) == []
