"""How well a perception network knows rendered pictures, of which everything is known."""

from __future__ import annotations

import numpy as np

from cfnav_core.task.calibration import auc, average_precision
from cfnav_core.task.vocabulary import CATEGORIES

SHOWN_PIXELS = 12
"""Of an object in the cell that shows most of it, from which it counts as shown."""
LEAST = 10
"""Pictures in which a category is so, from which it counts in a mean."""


def shown_in(heat: np.ndarray) -> np.ndarray:
    """Bool [N, C]: which categories pictures show, by the ``heat`` of their ``PictureSet``."""
    return np.asarray(heat).max((1, 2)) >= SHOWN_PIXELS


def counted(truth: np.ndarray) -> np.ndarray:
    """Int [K]: the categories that count in means, by what is true of pictures, bool [N, C]."""
    return np.flatnonzero(truth.sum(0) >= LEAST)


def agreement(
    shown: np.ndarray, near: np.ndarray, is_shown: np.ndarray, is_near: np.ndarray,
    among: tuple[np.ndarray, np.ndarray] | None = None,
) -> dict[str, object]:  # fmt: skip
    """Mean AUC of "shown" and "near" over categories, and what it is worth to take a half for yes.

    That is F1 of "near", how much of what it says to be near is shown and further away, and of
    "shown" the false alarms a picture: categories that it does not show. The average precision of
    "near", over all categories together, takes no threshold.

    Args:
        shown, near: scores of pictures, float [N, C].
        is_shown, is_near: what is true, bool [N, C].
        among: categories of either mean, for some of the pictures those of all, so that the same
            are compared; ``counted`` when absent. One that is so in none or all does not count.

    Returns:
        Figures by name; a mean over no category is NaN.
    """
    of_shown, of_near = among or (counted(is_shown), counted(is_near))

    def aucs(score: np.ndarray, truth: np.ndarray, which: np.ndarray) -> list[float]:
        return [auc(score[:, c], truth[:, c]) for c in which]

    said = near > 0.5

    def f1(c: int | slice) -> float:
        hit = said[:, c]
        return float(2 * (hit & is_near[:, c]).sum() / max(1, hit.sum() + is_near[:, c].sum()))

    each = aucs(shown, is_shown, of_shown)

    def mean(values: list[float]) -> float:
        known = [value for value in values if not np.isnan(value)]
        return float(np.mean(known)) if known else float("nan")

    return {
        "shown_auc_mean": mean(each),
        "near_auc_mean": mean(aucs(near, is_near, of_near)),
        "near_ap": average_precision(near.ravel(), is_near.ravel()),
        "near_f1": f1(slice(None)),
        "near_but_far": float((said & is_shown & ~is_near).sum() / max(1, said.sum())),
        "false_alarms": float(((shown > 0.5) & ~is_shown).sum(1).mean()),
        "shown_auc_by_category": {
            CATEGORIES[c]: round(auc, 3) for c, auc in zip(of_shown, each, strict=True)
        },
        "near_f1_by_category": {CATEGORIES[c]: round(f1(c), 3) for c in of_near},
    }  # fmt: skip
