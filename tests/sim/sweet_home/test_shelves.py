"""Places inside furniture: a case of boards, open or closed in front."""

from __future__ import annotations

import numpy as np
import pytest
from sim_bridge.sweet_home.shelves import shelves
from sim_bridge.world.meshes import box

SIZE = (0.9, 0.36, 1.5)


def board(centre: tuple[float, float, float], half: tuple[float, float, float]) -> np.ndarray:
    """Triangles of a box."""
    vertices, _, faces = box(half, None)
    return (vertices + centre)[faces]


def case(*more: np.ndarray) -> np.ndarray:
    """Sides, a back, and boards at the bottom, in the middle and on top."""
    w, d, h = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
    sides = [board((x, 0, h / 2), (0.01, d, h / 2)) for x in (-w + 0.01, w - 0.01)]
    boards = [board((0, 0, z), (w, d, 0.01)) for z in (0.06, 0.75, h - 0.01)]
    return np.concatenate([*sides, board((0, -d + 0.01, h / 2), (w, 0.01, h / 2)), *boards, *more])


def test_a_case_has_a_place_on_each_board_but_the_top():
    low, high = shelves(case(), SIZE)
    assert (low.z, high.z) == pytest.approx((0.07, 0.76), abs=0.011)
    for shelf in (low, high):
        assert shelf.x == pytest.approx(0, abs=0.02)
        assert 0.8 < shelf.width < 0.88
        assert 0.6 < shelf.clear < 0.72


def test_an_upright_divides_a_place_and_a_door_closes_it():
    upright = board((0.1, 0, 1.1), (0.01, 0.17, 0.36))
    door = board((-0.18, 0.17, 1.1), (0.27, 0.01, 0.36))
    found = shelves(case(upright), SIZE)
    assert [round(s.x, 1) for s in found if s.z > 0.5] == [-0.2, 0.3]
    open_ones = [s for s in shelves(case(upright, door), SIZE) if s.z > 0.5]
    assert [round(s.x, 1) for s in open_ones] == [0.3]


def test_what_has_no_boards_has_no_places():
    assert shelves(board((0, 0, 0.75), (0.45, 0.18, 0.75)), SIZE) == []
