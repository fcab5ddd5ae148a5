"""Scores against numbers worked out by hand; what cannot be told is None with a reason."""

import dataclasses
import json
import math

import numpy as np
import pytest
from cfnav_ros.bags.replay import scores
from cfnav_ros.bags.replay.scores import (
    UNKNOWN,
    Figure,
    agreement,
    brier_skill,
    collision_scores,
    compare,
    disagreements,
    drives_of,
    figure,
    lidar_predictions,
    rgb_predictions,
)

from cfnav_core.task.actions import Action
from cfnav_core.task.intervals import FEW, why_none
from tests.bags.steps import step_of

A, L, R = Action.MoveAhead, Action.RotateLeft, Action.RotateRight


def moves(rows, **fields):
    """Labelled MoveAheads: (drive, p_hat, p_hat of the RGB predictor, collided) each."""
    return [
        step_of(
            **{"p_hat_lidar": p} | fields,
            drive_ns=drive,
            step=k,
            t_ns=k,
            p_hat=0.0,
            p_hat_rgb=rgb,
            collided=y,
        )
        for k, (drive, p, rgb, y) in enumerate(rows)
    ]


FOUR = moves([(0, 0.9, 0.2, True), (0, 0.1, 0.4, False), (1, 0.8, 0.6, False), (1, 0.7, 0.8, True)])


def test_collision_scores_by_hand():
    found = collision_scores(lidar_predictions(FOUR))
    assert (found.moves, found.collisions) == (4, 2)
    # of 4 pairs: 0.9 beats both, 0.7 beats 0.1
    assert found.auc.value == pytest.approx(3 / 4)
    # in order of p: hit, miss, hit: precision 1 at the first half of the recall, 2/3 at the second
    assert found.average_precision.value == pytest.approx((1 + 2 / 3) / 2)
    assert found.brier.value == pytest.approx((0.01 + 0.01 + 0.64 + 0.09) / 4)
    assert found.skill.value == pytest.approx(1 - 0.1875 / 0.25)
    # each prediction is alone in its bin
    assert found.calibration_error.value == pytest.approx((0.1 + 0.1 + 0.8 + 0.3) / 4)
    assert [b.count for b in found.bins] == [1, 1, 1, 1]
    assert found.roc[-1].tolist() == [0.1, 1.0, 1.0]
    assert found.precision_recall[:, 1] == pytest.approx([1, 1 / 2, 2 / 3, 2 / 4])


def test_the_rgb_predictor_is_scored_on_the_same_moves():
    found = collision_scores(rgb_predictions(FOUR))
    # 0.8 beats both, 0.2 beats none
    assert found.auc.value == pytest.approx(2 / 4)


def test_only_executed_moves_with_their_source_count():
    others = [
        step_of(driven=L, collided=None),
        step_of(driven_vetoed=True, collided=None),
    ]
    without_lidar = moves([(2, 0.5, 0.5, True)], p_hat_lidar=math.nan)
    steps = [*FOUR, *others, *without_lidar]
    assert collision_scores(lidar_predictions(steps)).moves == 4
    assert collision_scores(rgb_predictions(steps)).moves == 5


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("collided", "why"), [(True, "every MoveAhead collided"), (False, "no MoveAhead collided")]
)
def test_one_class_cannot_be_told(collided, why):
    steps = moves([(k, 0.1 + k / 50, 0.5, collided) for k in range(FEW)])
    found = collision_scores(lidar_predictions(steps))
    for name in ("auc", "average_precision", "skill"):
        assert getattr(found, name) == Figure(None, why=why)
    assert found.roc.shape == found.precision_recall.shape == (0, 3)
    assert found.brier.value is not None
    assert found.calibration_error.low is not None


@pytest.mark.filterwarnings("error")
def test_nothing_cannot_be_told():
    found = collision_scores(lidar_predictions([]))
    assert (found.moves, found.bins) == (0, [])
    assert found.brier == found.auc == Figure(None, why="there are no decisions")
    none = agreement([])
    assert none.overall.value is None
    assert none.answers.sum() == 0
    assert compare([], []).agreement.value is None


@pytest.mark.filterwarnings("error")
def test_drives_without_a_collision_make_no_resampled_figure_a_number():
    """Of 25 drives one has all the collisions: a third of the resamples lacks it."""
    rows = [(0, 0.9, 0.5, True), (0, 0.2, 0.5, False)]
    rows += [(k, 0.3, 0.5, False) for k in range(1, 25)]
    found = collision_scores(lidar_predictions(moves(rows)))
    assert found.auc == Figure(1.0, why="no interval, as all drives are alike")
    assert 0.0 < found.brier.low < found.brier.value < found.brier.high


def test_an_interval_needs_drives():
    alone = moves([(7, 0.9, 0.2, True), (7, 0.1, 0.4, False)])
    few = f"too few drives for an interval: 1, it takes {FEW}"
    assert collision_scores(lidar_predictions(alone)).auc == Figure(1.0, why=few)
    rare = figure(lambda k: 1.0 if len(set(k)) == 20 else np.nan, np.arange(20), "")
    assert rare == Figure(1.0, why=UNKNOWN)


def test_an_interval_is_over_drives_not_decisions():
    """A thousand decisions of 20 drives are 20 observations."""
    values = np.repeat([0.0, 1.0], 500)
    found = figure(lambda k: float(values[k].mean()), np.repeat(np.arange(20), 50), "")
    assert (found.value, found.low, found.high) == (0.5, 0.3, 0.7)
    many = figure(lambda k: float(values[k].mean()), np.arange(1000), "")
    assert many.high - many.low == pytest.approx(4 * 0.5 / np.sqrt(1000), rel=0.1)


def test_the_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(0)
    drives, covered = np.repeat(np.arange(30), 10), 0
    for trial in range(60):
        values = np.repeat(rng.normal(size=30), 10) + rng.normal(size=300)
        found = figure(lambda k, v=values: float(v[k].mean()), drives, "", seed=trial)
        covered += found.low <= 0.0 <= found.high
    assert covered >= 52  # 95 % of 60 are 57


def test_drives_are_told_apart_by_bag_too():
    steps = [step_of(bag=bag, drive_ns=ns) for bag, ns in (("a", 1), ("b", 1), ("a", 1), ("a", 2))]
    assert drives_of(steps).tolist() == [0, 1, 0, 2]


def driven(rows):
    """Decisions: (drive, driven, the bundle's action, probability of the driven) each."""
    steps = []
    for k, (drive, was, action, p) in enumerate(rows):
        probabilities = np.zeros(6, np.float32)
        probabilities[was] = p
        fields = {"driven": was, "action": action, "probabilities": probabilities}
        steps.append(step_of(drive_ns=drive, step=k, t_ns=k, **fields))
    return steps


ROWS = [(0, A, A, 0.9), (0, A, L, 0.3), (0, L, L, 0.8), (1, A, A, 0.6), (1, R, A, 0.1)]


def test_agreement_by_hand():
    found = agreement(driven(ROWS))
    assert found.steps == 5
    assert found.overall.value == pytest.approx(3 / 5)
    assert found.overall.why == why_none(2, "drives")
    assert found.by_action[A].value == pytest.approx(2 / 3)
    assert found.by_action[L] == Figure(1.0, why=why_none(1, "drives"))
    assert found.by_action[R].value == 0.0
    assert found.by_action[Action.Done].value is None
    assert found.p_driven.value == pytest.approx(2.7 / 5)
    assert (found.answers[A, A], found.answers[A, L], found.answers[R, A]) == (2, 1, 1)
    assert found.answers.sum() == 5


def test_disagreements_are_ranked_by_what_the_bundle_holds_of_the_driven_action():
    steps = driven(ROWS)
    assert disagreements(steps) == [steps[4], steps[1]]
    assert disagreements(steps, most=1) == [steps[4]]
    assert disagreements(steps[:1]) == []


def test_a_comparison_is_paired_by_decision():
    first = driven(ROWS)
    second = driven([(d, was, was, min(p + 0.1, 1.0)) for d, was, _, p in ROWS])
    lost = second[:4][::-1]  # in another order, and one is missing
    found = compare(first, lost)
    assert (found.steps, found.not_paired) == (4, 1)
    assert found.agreement.value == pytest.approx(1 / 4)
    assert found.p_driven.value == pytest.approx(0.1)
    assert found.auc == Figure(None, why="there are no decisions")
    nothing = compare(first, first)
    assert (nothing.agreement.value, nothing.agreement.low) == (0, None)


def test_the_auc_of_two_predictors_is_compared_on_the_same_moves():
    rows = [(d, 0.5, p, y) for d in range(FEW) for p, y in ((0.2, True), (0.6, False), (0.7, True))]
    better = [(d, 0.5, 0.9 if y else 0.1, y) for d, _, _, y in rows]
    found = compare(moves(rows), moves(better)).auc
    # one of two pairs is in order before, both after, in every drive
    assert found.value == pytest.approx(1 - 0.5)
    assert (found.low, found.why) == (None, why_none(FEW, "drives"))
    unlabelled = [dataclasses.replace(s, collided=None) for s in moves(better)]
    assert compare(moves(rows), unlabelled).auc == found


def test_skill_of_the_base_rate_is_nothing():
    y = np.array([1, 0, 0, 0], bool)
    assert brier_skill(np.full(4, 0.25), y) == pytest.approx(0.0)
    assert brier_skill(y.astype(float), y) == 1.0
    assert np.isnan(brier_skill(np.full(4, 0.25), np.zeros(4, bool)))


def test_figures_can_be_written_as_json():
    found = dataclasses.asdict(collision_scores(lidar_predictions(FOUR)).auc)
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_the_draws_are_the_same_every_time(monkeypatch):
    many = lidar_predictions(moves([(k, k / 30, 0.5, k % 3 == 0) for k in range(30)]))
    first = collision_scores(many).brier
    assert collision_scores(many).brier == first
    monkeypatch.setattr(scores, "RESAMPLES", 50)
    assert collision_scores(many).brier.value == first.value
