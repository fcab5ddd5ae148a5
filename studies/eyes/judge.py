"""How well scores tell which things real pictures show: AUC, recall, false alarms, intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cfnav_core.task.calibration import auc
from cfnav_core.task.vocabulary import CATEGORIES

ENOUGH = 3
"""Pictures that show a category, and as many that do not, for its AUC to count in the mean."""

SAMPLES = 2000

Interval = tuple[float, float]


@dataclass(frozen=True)
class Judgement:
    """One network on labelled pictures.

    Attributes:
        auc: of "shown" by category, wherever some pictures show it and some do not.
        mean_auc: over categories with ``ENOUGH`` pictures either way, and its 95 % interval.
        threshold: above which a score counts as "shown".
        recall: share of the things that are shown that score above it, and its interval.
        false_alarms: categories a picture that are not shown and score above it, and its interval.
        precision: share of what scores above it that is shown.
        categories: that have an AUC and count in the mean.
        asked: categories that the network knows.
    """

    auc: dict[str, float]
    mean_auc: float
    mean_auc_interval: Interval
    threshold: float
    recall: float
    recall_interval: Interval
    false_alarms: float
    false_alarms_interval: Interval
    precision: float
    categories: tuple[str, ...]
    asked: int


def auc_of_clear(scores: np.ndarray, labels: np.ndarray) -> float:
    """Chance that a picture that shows a thing scores above one that does not, ties half.

    Args:
        scores: float [n].
        labels: int8 [n], 1 shown, 0 not, -1 unclear and left out.

    Returns:
        NaN without both kinds.
    """
    known = labels >= 0
    return auc(scores[known], labels[known] == 1)


def judge(
    scores: np.ndarray, labels: np.ndarray, among: np.ndarray, recall: float | None = None,
    seed: int = 0,
) -> Judgement:  # fmt: skip
    """Judge the scores of one network.

    Args:
        scores: float [n, C], NaN of categories that it does not know.
        labels: int8 [n, C], see ``pictures.Crop``.
        among: bool [C], categories to judge by; those that it does not know are left out.
        recall: the threshold is chosen so that this share of what is shown scores at least as
            high; None: it is 0.5.
        seed: of the bootstrap over pictures.
    """
    known = among & ~np.isnan(scores).any(0)
    counts = [(labels == value).sum(0) for value in (1, 0)]
    counted = np.flatnonzero(known & (np.minimum(*counts) >= ENOUGH))
    some = np.flatnonzero(known & (np.minimum(*counts) > 0))
    of_shown = scores[:, known][labels[:, known] == 1]
    threshold = 0.5 if recall is None or not len(of_shown) else threshold_for(recall, of_shown)
    hit = (scores >= threshold) & known
    shown, absent = (labels == 1) & known, (labels == 0) & known

    def mean_auc(index: np.ndarray) -> float:
        of = [auc_of_clear(scores[index, c], labels[index, c]) for c in counted]
        return float(np.nanmean(of)) if of and not np.isnan(of).all() else float("nan")

    def recalled(index: np.ndarray) -> float:
        return float((hit & shown)[index].sum() / max(1, shown[index].sum()))

    def alarms(index: np.ndarray) -> float:
        return float((hit & absent)[index].sum() / len(index))

    every = np.arange(len(scores))
    right, wrong = int((hit & shown).sum()), int((hit & absent).sum())
    return Judgement(
        auc={CATEGORIES[c]: auc_of_clear(scores[:, c], labels[:, c]) for c in some},
        mean_auc=mean_auc(every), mean_auc_interval=interval(mean_auc, len(scores), seed),
        threshold=threshold,
        recall=recalled(every), recall_interval=interval(recalled, len(scores), seed),
        false_alarms=alarms(every), false_alarms_interval=interval(alarms, len(scores), seed),
        precision=right / max(1, right + wrong),
        categories=tuple(CATEGORIES[c] for c in counted), asked=int(known.sum()),
    )  # fmt: skip


def threshold_for(recall: float, shown: np.ndarray) -> float:
    """The score at or above which this share of the scores of what is shown, float [n], lie."""
    return float(np.sort(shown)[::-1][max(0, round(recall * len(shown)) - 1)])


def interval(figure: Callable[[np.ndarray], float], pictures: int, seed: int) -> Interval:
    """95 % interval of a figure, pictures drawn anew; NaN where it has none."""
    low, high = intervals(lambda index: [figure(index)], pictures, seed)[0]
    return low, high


def intervals(
    figures: Callable[[np.ndarray], Sequence[float]], count: int, seed: int, samples: int = SAMPLES
) -> list[Interval]:
    """95 % intervals of some figures of ``count`` pictures or rooms, these drawn anew."""
    rng = np.random.default_rng(seed)
    drawn = np.array([figures(rng.integers(count, size=count)) for _ in range(samples)])
    return [
        (float("nan"), float("nan")) if np.isnan(column).all()
        else tuple(np.nanpercentile(column, (2.5, 97.5)).tolist())
        for column in drawn.T
    ]  # fmt: skip


def difference(
    first: np.ndarray, second: np.ndarray, labels: np.ndarray, among: np.ndarray, seed: int = 0
) -> tuple[float, Interval]:
    """By how much the first network's mean AUC is above the second's, on the same categories.

    Args:
        first, second: float [n, C], as for ``judge``.
        labels: int8 [n, C].
        among: bool [C].
        seed: of the bootstrap over pictures.
    """
    enough = np.minimum((labels == 1).sum(0), (labels == 0).sum(0)) >= ENOUGH
    known = ~np.isnan(first).any(0) & ~np.isnan(second).any(0)
    counted = np.flatnonzero(among & enough & known)

    def gain(index: np.ndarray) -> float:
        of = [
            auc_of_clear(first[index, c], labels[index, c])
            - auc_of_clear(second[index, c], labels[index, c])
            for c in counted
        ]
        return float(np.nanmean(of)) if of and not np.isnan(of).all() else float("nan")

    return gain(np.arange(len(labels))), interval(gain, len(labels), seed)
