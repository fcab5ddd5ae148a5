"""The measuring programs themselves: measures worked out by hand, a few moves really driven."""

import json

import numpy as np
import pytest
from cfnav_ros.lidar.estimate import SweptDisc, estimate_collision
from cfnav_ros.lidar.sweep import NOMINAL

from cfnav_core.task import calibration as rel
from studies.deploy.calibration import (
    CalibrationConfig,
    Predicted,
    figures,
    measure,
    unseen_shares,
)
from studies.deploy.driven_moves import moves, scan_of

P = np.array([0.1, 0.1, 0.1, 0.1, 0.6, 0.6, 0.99, 0.01])
Y = np.array([0, 0, 0, 1, 1, 1, 1, 0], bool)
ONES = np.ones(8)


def test_the_calibration_error_by_hand():
    found = rel.bins(P, Y)
    assert [(b.predicted, b.observed, b.count) for b in found] == [
        (pytest.approx(0.1), 0.25, 4),
        (pytest.approx(0.6), 1.0, 2),
    ]
    # (4 * 0.15 + 2 * 0.4) / 6; what is surely right or wrong does not count.
    assert rel.calibration_error(P, Y) == pytest.approx(1.4 / 6)


def test_brier_and_auc_by_hand():
    assert rel.brier(P, Y, ONES) == pytest.approx(
        (3 * 0.01 + 0.81 + 2 * 0.16 + 0.0001 + 0.0001) / 8
    )
    # Of 16 pairs the 12 of the upper three collisions are in order; the collision at 0.1 beats
    # 0.01 and ties with three.
    assert rel.auc(P, Y, ONES) == pytest.approx((12 + 1 + 1.5) / 16)
    heavy = np.where(P == 0.01, 2.0, 1.0)
    assert rel.auc(P, Y, heavy) == pytest.approx((15 + 2 + 1.5) / 20)


def test_right_probabilities_have_only_the_error_of_chance():
    rng = np.random.default_rng(0)
    p = rng.uniform(size=20_000)
    y = rng.random(20_000) < p
    low, high = rel.error_interval(p, y)
    assert low < rel.calibration_error(p, y) < high < 0.03
    assert rel.chance_error(p) == pytest.approx(rel.calibration_error(p, y), abs=0.01)
    wrong = np.clip(p + 0.1, 0, 1)
    assert rel.calibration_error(wrong, y) > 0.08


def test_driven_moves_bear_the_sure_estimates_out():
    driven = list(moves("bedroom", 3, 60, 0.5))
    p = np.array([estimate_collision(scan_of(m.ranges)).probability for m in driven])
    collided = np.array([m.collided for m in driven])
    travelled = np.array([m.travelled for m in driven])
    assert collided[p > 0.95].mean() > 0.9
    assert collided[p < 0.05].mean() < 0.15
    assert 0 < collided.mean() < 1
    assert travelled[~collided] == pytest.approx(0.2475, abs=0.008)
    assert {m.weight for m in driven} == {1.0, 2.0}
    again = list(moves("bedroom", 3, 60, 0.5))
    assert all((a.ranges == b.ranges).all() for a, b in zip(driven, again, strict=True))


def test_what_the_plane_cannot_show_is_counted_apart_near_and_far():
    # Two free far off, one of them hit; three free beside something, one hit; two in the way.
    beside, far = SweptDisc().step + 0.05, 2.0
    p = np.array([NOMINAL.unseen] * 2 + [NOMINAL.unseen_near] * 3 + [0.5, 1.0])
    clearance = np.array([far, far, beside, beside, beside, beside, 0.0])
    collided = np.array([1, 0, 0, 1, 0, 1, 1], bool)
    found = Predicted(p, clearance, p, collided, p, np.ones(7))
    assert unseen_shares(found) == {"unseen": [1 / 2, 1, 2], "unseen_near": [1 / 3, 1, 3]}


def test_what_the_veto_misses_and_what_it_forbids_in_vain():
    weight = np.where(P == 0.1, 3.0, 1.0)
    found = figures(Predicted(P, 1 - P, P.round(), Y, np.full(8, 0.25), weight))
    # of four collisions the one at 0.1 is missed; nothing free is forbidden
    assert (found["veto_misses"], found["veto_false_alarms"]) == (1 / 4, 0.0)
    assert found["plain_veto_misses"] == pytest.approx(3 / 6)
    free = figures(Predicted(P, 1 - P, P.round(), Y[::-1].copy(), np.full(8, 0.25), weight))
    assert free["veto_false_alarms"] == pytest.approx(2 / 4)


def test_the_whole_program_on_a_few_moves(tmp_path):
    config = CalibrationConfig(tmp_path, 80, (0, 0), 0.2, processes=2)
    result = measure(config)
    assert result["n"] == 80
    assert json.loads((tmp_path / "calibration.json").read_text())["brier"] == result["brier"]
    assert (tmp_path / "calibration.png").read_bytes().startswith(b"\x89PNG")
    assert result["brier_skill"] > 0.5
