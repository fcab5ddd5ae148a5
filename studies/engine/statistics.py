"""Means over seeds, and intervals of paired differences over seeds and rooms."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.stats import t

SAMPLES = 10_000


def over_seeds(values: np.ndarray) -> tuple[float, float | None]:
    """Mean and standard deviation of each seed's mean.

    Args:
        values: float [seeds, episodes].

    Returns:
        Mean, and the sample standard deviation, None for one seed.
    """
    means = values.mean(1)
    return float(means.mean()), float(means.std(ddof=1)) if len(means) > 1 else None


def interval(difference: np.ndarray, rooms: np.ndarray, seed: int = 0) -> tuple[float, float]:
    """95 % interval of a mean by a hierarchical bootstrap: seeds and rooms are drawn anew.

    Every seed met the same episodes in the same rooms, so both are drawn independently and all
    episodes of a drawn room go with it.

    Args:
        difference: float [seeds, episodes], paired by seed and episode.
        rooms: [episodes], names or numbers of their rooms.
        seed: of the resampling.

    Returns:
        Lower and upper bound.
    """
    _, index = np.unique(rooms, return_inverse=True)
    seeds, count = len(difference), np.bincount(index)
    sums = np.stack([np.bincount(index, row) for row in difference.astype(float)])
    of_seeds, of_rooms = _drawn(seeds, len(count), seed)
    total = np.einsum("ns,sr,nr->n", of_seeds, sums, of_rooms, optimize=True)
    low, high = np.percentile(total / (seeds * (of_rooms @ count)), (2.5, 97.5))
    return float(low), float(high)


@cache  # tables ask for hundreds of intervals over as many seeds and rooms
def _drawn(seeds: int, rooms: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """How often each seed and each room is drawn in every sample."""
    rng = np.random.default_rng(seed)
    of_seeds = rng.multinomial(seeds, np.full(seeds, 1 / seeds), SAMPLES)
    return of_seeds, rng.multinomial(rooms, np.full(rooms, 1 / rooms), SAMPLES)


def interval_of_seeds(means: np.ndarray) -> tuple[float, float]:
    """95 % interval of a mean by Student's t over few seeds, as if rooms were all there are.

    Args:
        means: float [seeds], of each, two or more.

    Returns:
        Lower and upper bound.
    """
    half = t.ppf(0.975, len(means) - 1) * means.std(ddof=1) / np.sqrt(len(means))
    return float(means.mean() - half), float(means.mean() + half)


def interval_of_trials(
    difference: np.ndarray, rooms: np.ndarray, seed: int = 0
) -> tuple[float, float]:
    """95 % interval of a mean over few fixed rooms: seeds and, in each room of each, trials anew.

    Every seed met starts of its own, so trials are drawn within seeds. One seed is not drawn: the
    interval is then of that policy alone.

    Args:
        difference: float [seeds, trials], paired by seed and trial.
        rooms: [trials], names of their rooms, the same for every seed.
        seed: of the resampling.

    Returns:
        Lower and upper bound.
    """
    rng = np.random.default_rng(seed)
    seeds, total = len(difference), np.zeros(SAMPLES)
    drawn = rng.integers(seeds, size=(SAMPLES, seeds))
    for room in np.unique(rooms):
        there = difference[:, rooms == room].astype(float)
        for of in drawn.T:
            which = rng.integers(there.shape[1], size=(SAMPLES, there.shape[1]))
            total += there[of[:, None], which].sum(1)
    low, high = np.percentile(total / difference.size, (2.5, 97.5))
    return float(low), float(high)
