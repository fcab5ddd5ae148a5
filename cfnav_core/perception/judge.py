"""How well a perception network knows rendered pictures, of which everything is known."""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata

from cfnav_core.task.vocabulary import CATEGORIES

SHOWN_PIXELS = 12
"""Of an object in the cell that shows most of it, from which it counts as shown."""
LEAST = 10
"""Pictures in which a category is so, from which it counts in a mean."""


def shown_in(heat: np.ndarray) -> np.ndarray:
    """Bool [N, C]: which categories pictures show, by the ``heat`` of their ``PictureSet``."""
    return np.asarray(heat).max((1, 2)) >= SHOWN_PIXELS


def area_under_roc(score: np.ndarray, label: np.ndarray) -> float:
    """Chance that a positive scores above a negative, ties half; NaN without both.

    Args:
        score: float [n].
        label: bool [n].
    """
    positives, negatives = int(label.sum()), int((~label).sum())
    if not positives or not negatives:
        return float("nan")
    ranks = rankdata(score)[label].sum() - positives * (positives + 1) / 2
    return float(ranks / (positives * negatives))


def agreement(
    shown: np.ndarray, near: np.ndarray, is_shown: np.ndarray, is_near: np.ndarray
) -> dict[str, object]:
    """Mean AUC of "shown" and "near" over categories, and F1 of "near" above a half.

    Args:
        shown, near: scores of pictures, float [N, C].
        is_shown, is_near: what is true, bool [N, C].
    """

    def mean_auc(score: np.ndarray, truth: np.ndarray) -> float:
        enough = [c for c in range(truth.shape[1]) if truth[:, c].sum() >= LEAST]
        return float(np.nanmean([area_under_roc(score[:, c], truth[:, c]) for c in enough]))

    def f1(c: int | slice) -> float:
        hit = near[:, c] > 0.5
        return float(2 * (hit & is_near[:, c]).sum() / max(1, hit.sum() + is_near[:, c].sum()))

    often = [c for c in range(is_near.shape[1]) if is_near[:, c].sum() >= LEAST]
    return {
        "shown_auc_mean": mean_auc(shown, is_shown), "near_auc_mean": mean_auc(near, is_near),
        "near_f1": f1(slice(None)),
        "near_f1_by_category": {CATEGORIES[c]: round(f1(c), 3) for c in often},
    }  # fmt: skip
