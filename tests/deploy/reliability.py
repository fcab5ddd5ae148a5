"""How good probabilities are: calibration error, Brier score, AUC, and the reliability diagram."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

LOW, HIGH, BINS = 0.05, 0.95, 10
"""Calibration is judged between these, in this many bins: elsewhere every rule is right."""

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


def bins(p: np.ndarray, y: np.ndarray, equal_count: bool = False) -> list[Bin]:
    """The uncertain predictions in bins, empty ones left out.

    Args:
        p: float [N], probabilities.
        y: bool [N], what came true.
        equal_count: bins of equal count, else of equal width.
    """
    inside = (p > LOW) & (p < HIGH)
    p, y = p[inside], y[inside]
    if not len(p):
        return []
    edges = np.linspace(LOW, HIGH, BINS + 1)
    if equal_count:
        edges = np.quantile(p, np.linspace(0, 1, BINS + 1))
    where = np.clip(np.searchsorted(edges, p, side="right") - 1, 0, BINS - 1)
    found = ((where == k, int((where == k).sum())) for k in range(BINS))
    return [Bin(float(p[q].mean()), float(y[q].mean()), n) for q, n in found if n]


def calibration_error(p: np.ndarray, y: np.ndarray, equal_count: bool = False) -> float:
    """Expected calibration error: mean of |predicted - observed| over uncertain predictions.

    Source: Naeini et al., Obtaining Well Calibrated Probabilities Using Bayesian Binning, 2015.
    """
    found = bins(p, y, equal_count)
    total = sum(b.count for b in found)
    if not total:
        return float("nan")
    return sum(b.count * abs(b.predicted - b.observed) for b in found) / total


def error_interval(p: np.ndarray, y: np.ndarray, equal_count: bool = False) -> tuple[float, float]:
    """95 % bootstrap interval of the calibration error, over the uncertain predictions."""
    inside = (p > LOW) & (p < HIGH)
    p, y = p[inside], y[inside]
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


def auc(score: np.ndarray, y: np.ndarray, weight: np.ndarray) -> float:
    """Chance that one that came true scores higher than one that did not; ties count half."""
    order = np.argsort(score, kind="stable")
    score, y, weight = score[order], y[order], weight[order]
    starts = np.flatnonzero(np.r_[True, score[1:] != score[:-1]])
    positive = np.add.reduceat(weight * y, starts)
    negative = np.add.reduceat(weight * ~y, starts)
    below = np.cumsum(negative) - negative
    total = positive.sum() * negative.sum()
    return float((positive * (below + negative / 2)).sum() / total)


def diagram(p: np.ndarray, y: np.ndarray, title: str, path: Path) -> None:
    """Draw observed against predicted with 95 % intervals, and how many predictions fall where."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (top, bottom) = plt.subplots(
        2, 1, figsize=(5.5, 7), height_ratios=(3, 1), sharex=True, layout="constrained"
    )
    top.plot((0, 1), (0, 1), color="0.6", linestyle="--", label="exactly right")
    for equal_count, colour, name in ((False, "C0", "width"), (True, "C1", "count")):
        found = bins(p, y, equal_count)
        low, high = np.transpose([_wilson(b.observed, b.count) for b in found])
        x, observed = ([getattr(b, f) for b in found] for f in ("predicted", "observed"))
        error = [np.array(observed) - low, high - np.array(observed)]
        top.errorbar(
            x, observed, error, color=colour, marker="o", ms=4, lw=1, capsize=2,
            label=f"bins of equal {name}",
        )  # fmt: skip
    top.set(ylabel="share that collided", title=title, xlim=(0, 1), ylim=(0, 1))
    top.legend(loc="upper left", frameon=False)
    bottom.hist(p, bins=np.linspace(0, 1, 41), color="0.5")
    bottom.set(yscale="log", xlabel="predicted probability of a collision", ylabel="motions")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _wilson(share: float, n: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a share of n."""
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    return centre - half, centre + half
