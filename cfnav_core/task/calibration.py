"""How good probabilities are: reliability, calibration error, Brier score, ROC, precision, recall.

Pure numpy. A figure that these predictions cannot tell is NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cfnav_core.task.intervals import FEW

LOW, HIGH, BINS = 0.05, 0.95, 10
"""Calibration is judged between these, in this many bins: elsewhere every rule is right."""

UNCERTAIN, EVERY = (LOW, HIGH), (-np.inf, np.inf)
"""Which predictions are put into bins: those between these, without the bounds."""

RESAMPLES = 1000


@dataclass(frozen=True)
class Bin:
    """One bin of a reliability diagram.

    Attributes:
        predicted: mean probability.
        observed: share that came true.
        count: of predictions.
    """

    predicted: float
    observed: float
    count: int


def bins(
    p: np.ndarray,
    y: np.ndarray,
    equal_count: bool = False,
    within: tuple[float, float] = UNCERTAIN,
) -> list[Bin]:
    """Predictions in bins, empty ones left out.

    Args:
        p: float [N], probabilities.
        y: bool [N], what came true.
        equal_count: bins of equal count, else of equal width.
        within: UNCERTAIN or EVERY.
    """
    inside = _inside(p, within)
    p, y = p[inside], y[inside]
    if not len(p):
        return []
    edges = np.linspace(max(within[0], 0.0), min(within[1], 1.0), BINS + 1)
    if equal_count:
        edges = np.quantile(p, np.linspace(0, 1, BINS + 1))
    where = np.clip(np.searchsorted(edges, p, side="right") - 1, 0, BINS - 1)
    found = ((where == k, int((where == k).sum())) for k in range(BINS))
    return [Bin(float(p[q].mean()), float(y[q].mean()), n) for q, n in found if n]


def _inside(p: np.ndarray, within: tuple[float, float]) -> np.ndarray:
    return (p > within[0]) & (p < within[1])


def calibration_error(
    p: np.ndarray,
    y: np.ndarray,
    equal_count: bool = False,
    within: tuple[float, float] = UNCERTAIN,
) -> float:
    """Expected calibration error: mean of |predicted - observed|, arguments as for ``bins``.

    Source: Naeini et al., Obtaining Well Calibrated Probabilities Using Bayesian Binning, 2015.
    """
    found = bins(p, y, equal_count, within)
    total = sum(b.count for b in found)
    if not total:
        return float("nan")
    return sum(b.count * abs(b.predicted - b.observed) for b in found) / total


def error_interval(p: np.ndarray, y: np.ndarray, equal_count: bool = False) -> tuple[float, float]:
    """95 % bootstrap interval of the calibration error, over the uncertain predictions.

    NaN where these are too few.
    """
    inside = _inside(p, UNCERTAIN)
    p, y = p[inside], y[inside]
    if len(p) < FEW:
        return float("nan"), float("nan")
    rng = np.random.default_rng(0)
    draws = (rng.integers(len(p), size=len(p)) for _ in range(RESAMPLES))
    values = [calibration_error(p[draw], y[draw], equal_count) for draw in draws]
    low, high = np.quantile(values, (0.025, 0.975))
    return float(low), float(high)


def chance_error(p: np.ndarray, equal_count: bool = False) -> float:
    """Calibration error that these probabilities would show if each were exactly right."""
    rng = np.random.default_rng(1)
    values = [calibration_error(p, rng.random(len(p)) < p, equal_count) for _ in range(200)]
    return float(np.mean(values))


def brier(p: np.ndarray, y: np.ndarray, weight: np.ndarray) -> float:
    """Weighted mean squared error of probabilities."""
    return float(np.average((p - y) ** 2, weights=weight))


def auc(score: np.ndarray, y: np.ndarray, weight: np.ndarray | None = None) -> float:
    """Area under the ROC curve.

    That is the chance that one that came true scores higher than one that did not; ties count half.

    Args:
        score: float [N].
        y: bool [N], which came true.
        weight: float [N]; all alike when None.

    Returns:
        0..1; NaN when all came true, or none.
    """
    weight = np.ones(len(y)) if weight is None else weight
    _, positive, negative = _counted(score, y, weight)
    above = np.cumsum(positive) - positive
    total = positive.sum() * negative.sum()
    return float((negative * (above + positive / 2)).sum() / total) if total else float("nan")


def roc_curve(score: np.ndarray, y: np.ndarray) -> np.ndarray:
    """float64 [K + 1, 3], from the strictest threshold on: its value, false and true positive rate.

    A score at the threshold or above it is an alarm; the first threshold, inf, gives none. Empty
    when all came true, or none.
    """
    thresholds, positive, negative = _counted(score, y, np.ones(len(y)))
    if not positive.sum() * negative.sum():
        return np.empty((0, 3))
    rates = (np.cumsum(n) / n.sum() for n in (negative, positive))
    return np.vstack([(np.inf, 0.0, 0.0), np.column_stack([thresholds, *rates])])


def precision_recall_curve(score: np.ndarray, y: np.ndarray) -> np.ndarray:
    """float64 [K, 3], from the strictest threshold on: its value, precision and recall.

    Empty when nothing came true.
    """
    thresholds, positive, negative = _counted(score, y, np.ones(len(y)))
    found = np.cumsum(positive)
    if not positive.sum():
        return np.empty((0, 3))
    return np.column_stack([thresholds, found / (found + np.cumsum(negative)), found / found[-1]])


def average_precision(score: np.ndarray, y: np.ndarray) -> float:
    """Mean of the precisions, each weighted with the recall that it adds: no interpolation.

    NaN when all came true, or none. Source: Manning et al., Introduction to Information Retrieval,
    8.4, as scikit-learn has it.
    """
    curve = precision_recall_curve(score, y)
    if not len(curve) or y.all():
        return float("nan")
    return float((curve[:, 1] * np.diff(curve[:, 2], prepend=0.0)).sum())


def _counted(
    score: np.ndarray, y: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The distinct scores, highest first, and how many at each came true and how many did not."""
    if not len(score):
        return np.empty(0), np.empty(0), np.empty(0)
    order = np.argsort(-score, kind="stable")
    score, y, weight = score[order], np.asarray(y, bool)[order], weight[order]
    starts = np.flatnonzero(np.r_[True, score[1:] != score[:-1]])
    positive, negative = (np.add.reduceat(weight * which, starts) for which in (y, ~y))
    return score[starts], positive, negative
