"""How good replayed bundles are: calibration, ranking, agreement with what was driven, comparison.

Pure numpy. Intervals are 95 % bootstrap intervals over drives, as the decisions of one drive depend
on each other; few drives have none (``task.intervals``). What cannot be told from these decisions
is None with the reason, never a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from cfnav_core.task.actions import NUM_ACTIONS, Action
from cfnav_core.task.calibration import (
    EVERY,
    Bin,
    auc,
    average_precision,
    bins,
    brier,
    calibration_error,
    precision_recall_curve,
    roc_curve,
)
from cfnav_core.task.intervals import FEW, why_none, with_width
from cfnav_ros.bags.replay.step import ReplayStep

RESAMPLES = 1000

UNKNOWN = "a figure of most resampled sets of drives cannot be told"


@dataclass(frozen=True)
class Figure:
    """A figure with its interval.

    Attributes:
        value: None when it cannot be told.
        low: lower bound, None when the interval cannot be told.
        high: upper bound.
        why: why value or interval cannot be told; part of a sentence, empty when both can.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    why: str = ""


def figure(
    statistic: Callable[[np.ndarray], float], drives: np.ndarray, why: str, seed: int = 0
) -> Figure:
    """A statistic of decisions, with its interval over drives.

    Args:
        statistic: of chosen decisions, int [M], each as often as it is drawn; NaN when they cannot
            tell.
        drives: [N], the drive of each decision.
        why: why the statistic of all of them may be NaN.
        seed: of the resampling.
    """
    value = statistic(np.arange(len(drives))) if len(drives) else float("nan")
    if np.isnan(value):
        return Figure(None, why=why if len(drives) else "there are no decisions")
    order = np.argsort(drives, kind="stable")
    _, begins = np.unique(drives[order], return_index=True)
    rows = np.split(order, begins[1:])
    if len(rows) < FEW:
        return Figure(value, why=why_none(len(rows), "drives"))
    drawn = np.random.default_rng(seed).integers(len(rows), size=(RESAMPLES, len(rows)))
    values = np.array([statistic(np.concatenate([rows[k] for k in draw])) for draw in drawn])
    values = values[~np.isnan(values)]
    if len(values) < RESAMPLES / 2:
        return Figure(value, why=UNKNOWN)
    low, high = np.quantile(values, (0.025, 0.975))
    if ends := with_width(float(low), float(high)):
        return Figure(value, *ends)
    return Figure(value, why=why_none(len(rows), "drives"))


def drives_of(steps: Sequence[ReplayStep]) -> np.ndarray:
    """Int [N], a number for the drive of each step."""
    known: dict[tuple[str, int], int] = {}
    return np.array([known.setdefault((s.bag, s.drive_ns), len(known)) for s in steps], int)


# Would it collide?


@dataclass(frozen=True)
class ExecutedPredictions:
    """Collision probabilities of executed MoveAheads and what happened, in the same order.

    Attributes:
        p: float64 [N].
        collided: bool [N].
        drives: int [N].
    """

    p: np.ndarray
    collided: np.ndarray
    drives: np.ndarray


def lidar_predictions(steps: Sequence[ReplayStep]) -> ExecutedPredictions:
    """What the LiDAR said, of one bundle's labelled steps."""
    return _predictions(steps, lambda step: step.p_hat_lidar)


def rgb_predictions(steps: Sequence[ReplayStep]) -> ExecutedPredictions:
    """p_hat of the bundle's own RGB predictor, of one bundle's labelled steps."""
    return _predictions(steps, lambda step: step.p_hat_rgb)


def _predictions(
    steps: Sequence[ReplayStep], p_hat: Callable[[ReplayStep], float]
) -> ExecutedPredictions:
    known = [s for s in steps if s.collided is not None and math.isfinite(p_hat(s))]
    p, collided = (np.array(values) for values in ([p_hat(s) for s in known], _collided(known)))
    return ExecutedPredictions(p.astype(float), collided.astype(bool), drives_of(known))


def _collided(steps: Sequence[ReplayStep]) -> list[bool]:
    return [bool(s.collided) for s in steps]


@dataclass(frozen=True)
class CollisionScores:
    """How well a probability foretold collisions.

    A veto keeps the surest collisions from being driven, so that those that are left are harder.

    Attributes:
        moves: MoveAheads that were executed.
        collisions: those of them that collided.
        bins: of the reliability diagram, over all predictions.
        calibration_error: expected calibration error over them.
        brier: mean squared error.
        skill: share of the Brier score of the base rate that is saved: 1 is perfect, 0 no better.
        auc: area under the ROC curve.
        average_precision: summary of the precision-recall curve.
        roc: float64 [K, 3], see ``calibration.roc_curve``; empty when it cannot be told.
        precision_recall: float64 [K, 3], see ``calibration.precision_recall_curve``.
    """

    moves: int
    collisions: int
    bins: list[Bin]
    calibration_error: Figure
    brier: Figure
    skill: Figure
    auc: Figure
    average_precision: Figure
    roc: np.ndarray = field(repr=False)
    precision_recall: np.ndarray = field(repr=False)


def collision_scores(found: ExecutedPredictions) -> CollisionScores:
    """Score predictions."""
    p, y, drives = found.p, found.collided, found.drives
    why = "every MoveAhead collided" if y.any() else "no MoveAhead collided"
    one_class = bool(y.all() or not y.any())
    return CollisionScores(
        moves=len(y),
        collisions=int(y.sum()),
        bins=bins(p, y, within=EVERY),
        calibration_error=figure(lambda k: calibration_error(p[k], y[k], within=EVERY), drives, ""),
        brier=figure(lambda k: brier(p[k], y[k], np.ones(len(k))), drives, ""),
        skill=figure(lambda k: brier_skill(p[k], y[k]), drives, why),
        auc=figure(lambda k: auc(p[k], y[k]), drives, why),
        average_precision=figure(lambda k: average_precision(p[k], y[k]), drives, why),
        roc=roc_curve(p, y),
        precision_recall=np.empty((0, 3)) if one_class else precision_recall_curve(p, y),
    )


def brier_skill(p: np.ndarray, y: np.ndarray) -> float:
    """1 - Brier score / that of the base rate; NaN when all came true, or none."""
    base = float(y.mean())
    if base in (0.0, 1.0):
        return float("nan")
    return 1.0 - brier(p, y, np.ones(len(p))) / (base * (1.0 - base))


# Would it have done the same?


@dataclass(frozen=True)
class Agreement:
    """How often a bundle's action is the driven one.

    Attributes:
        steps: decisions.
        overall: share.
        by_action: share among the decisions of each driven action.
        answers: int [6, 6], number of decisions by driven action (row) and the bundle's (column).
        p_driven: mean probability that the bundle gives to the driven action.
    """

    steps: int
    overall: Figure
    by_action: dict[Action, Figure]
    answers: np.ndarray
    p_driven: Figure


def agreement(steps: Sequence[ReplayStep]) -> Agreement:
    """Compare one bundle's actions with the driven ones; decisions that were vetoed count too."""
    same, p_driven, drives = _same(steps), _p_driven(steps), drives_of(steps)
    driven = np.array([int(s.driven) for s in steps], int)
    answers = np.zeros((NUM_ACTIONS, NUM_ACTIONS), int)
    for step in steps:
        answers[step.driven, step.action] += 1

    def among(action: Action) -> Figure:
        chosen = driven == action
        return figure(
            lambda k: _mean(same[chosen][k]), drives[chosen], f"{action.name} was never driven"
        )

    return Agreement(
        steps=len(steps),
        overall=figure(lambda k: _mean(same[k]), drives, ""),
        by_action={action: among(action) for action in Action},
        answers=answers,
        p_driven=figure(lambda k: _mean(p_driven[k]), drives, ""),
    )


def disagreements(steps: Sequence[ReplayStep], most: int = 20) -> list[ReplayStep]:
    """The decisions that the bundle would have taken otherwise, the surest of them first.

    Sure is who gives little probability to what was driven.
    """
    return sorted((s for s in steps if not s.agrees), key=lambda step: step.p_driven)[:most]


# Which is better?


@dataclass(frozen=True)
class DecisionComparison:
    """Second bundle minus first, on the decisions that both were asked for.

    Attributes:
        steps: decisions compared.
        not_paired: decisions that only one of them has.
        agreement: difference of the share of driven actions.
        p_driven: difference of the mean probability of the driven action.
        auc: difference of the AUC of their own RGB predictors.
    """

    steps: int
    not_paired: int
    agreement: Figure
    p_driven: Figure
    auc: Figure


def compare(first: Sequence[ReplayStep], second: Sequence[ReplayStep]) -> DecisionComparison:
    """Compare two bundles, paired by decision; whole drives are resampled for both at once.

    Args:
        first: labelled steps of one bundle.
        second: of the other over the same bags, in any order, labelled or not.
    """
    named = {_name(s): s for s in second}
    pairs = [(s, named[_name(s)]) for s in first if _name(s) in named]
    a, b = [one for one, _ in pairs], [two for _, two in pairs]
    drives = drives_of(a)
    same, p_driven = _same(b) - _same(a), _p_driven(b) - _p_driven(a)
    seen = [(one, two) for one, two in pairs if math.isfinite(one.p_hat_rgb + two.p_hat_rgb)]
    of_a = rgb_predictions([one for one, _ in seen])
    of_b = np.array([two.p_hat_rgb for one, two in seen if one.collided is not None], float)
    y = of_a.collided

    def auc_difference(k: np.ndarray) -> float:
        return auc(of_b[k], y[k]) - auc(of_a.p[k], y[k])

    why = "every MoveAhead collided" if y.any() else "no MoveAhead collided"
    return DecisionComparison(
        steps=len(pairs),
        not_paired=len(first) + len(second) - 2 * len(pairs),
        agreement=figure(lambda k: _mean(same[k]), drives, ""),
        p_driven=figure(lambda k: _mean(p_driven[k]), drives, ""),
        auc=figure(auc_difference, of_a.drives, why),
    )


def _name(step: ReplayStep) -> tuple[str, int, int, int]:
    return step.bag, step.drive_ns, step.step, step.t_ns


def _same(steps: Sequence[ReplayStep]) -> np.ndarray:
    return np.array([s.agrees for s in steps], float)


def _p_driven(steps: Sequence[ReplayStep]) -> np.ndarray:
    return np.array([s.p_driven for s in steps], float)


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")
