"""95 % intervals over rooms or drives: one rule for shares, one for other means. Pure.

What varies is the room, or the drive: its episodes stand and fall together, so it is one *group*.
Percentiles of a bootstrap over groups are too narrow where these are few, and of no width where all
are alike: 4 drives that each reach their goal with probability 0.95 all do in 0.95^4 = 81 of 100
cases, and then the interval is 1 to 1. So:

- A share (SR, CF-SR) has the interval of Clopper and Pearson, each group one trial, which holds the
  truth in at least 95 of 100 cases whatever it is. That of Wilson is narrower and at times holds it
  less often: for a robot that shall touch nothing, too wide errs on the right side. Rooms of
  unequal size count as Kish's effective number of them. This takes all episodes of a room for
  alike, the worst that can be, and is too wide where rooms are many.
- So FEW rooms or more, with several episodes, have the percentiles of the bootstrap.
- So has any other mean; over fewer it has no interval, as nothing is known of how it spreads.

Sources: Clopper and Pearson, The Use of Confidence or Fiducial Limits, 1934; Kish, Survey Sampling,
1965; Brown, Cai and DasGupta, Interval Estimation for a Binomial Proportion, 2001.
"""

from __future__ import annotations

import numpy as np

FEW = 20
"""Groups that a bootstrap takes: with fewer it holds a mean clearly less often than it says."""

Ends = tuple[float, float]
"""Lower and upper bound."""


def share_interval(share: float, trials: float) -> Ends:
    """Interval of a share by Clopper and Pearson.

    Args:
        share: 0 to 1, of the trials.
        trials: how many, above 0; an effective number need not be whole.
    """
    from scipy.special import betaincinv  # here, as nodes that drive need neither it nor the time

    hits, misses = share * trials, (1.0 - share) * trials
    low = betaincinv(hits, misses + 1.0, 0.025) if hits > 0 else 0.0
    high = betaincinv(hits + 1.0, misses, 0.975) if misses > 0 else 1.0
    return float(low), float(high)


def interval_of_share(values: np.ndarray, groups: np.ndarray) -> Ends:
    """Interval of the mean of what is 0 or 1.

    Args:
        values: bool [N], one or more.
        groups: [N], the room or drive of each value.
    """
    _, count = np.unique(groups, return_counts=True)
    if len(count) < len(values) and (found := interval_of_mean(values, groups)):
        return found
    return share_interval(float(np.mean(values)), count.sum() ** 2 / (count**2).sum())


def interval_of_mean(
    values: np.ndarray, groups: np.ndarray, weights: np.ndarray | None = None
) -> Ends | None:
    """Interval of a mean; None where there are too few groups, or all are alike.

    Args:
        values: float [N].
        groups: [N], the room or drive of each value.
        weights: float [N], such as metres: what the sum of the values is divided by; 1 each when
            not given.
    """
    if len(np.unique(groups)) < FEW:
        return None
    return with_width(*bootstrap_interval(values, groups, weights=weights))


def with_width(low: float, high: float) -> Ends | None:
    """The ends of a bootstrap; None when they are one, up to rounding: all groups are alike."""
    return (low, high) if high - low > 1e-9 else None


def bootstrap_interval(
    values: np.ndarray,
    groups: np.ndarray,
    samples: int = 2000,
    seed: int = 0,
    weights: np.ndarray | None = None,
) -> Ends:
    """Percentiles of a mean, resampling whole groups; too narrow where these are few.

    Args:
        values, groups, weights: as for ``interval_of_mean``.
        samples: bootstrap samples.
        seed: of the resampling.
    """
    _, index = np.unique(groups, return_inverse=True)
    total = np.bincount(index, values.astype(float))
    count = np.bincount(index, weights)
    drawn = np.random.default_rng(seed).integers(len(total), size=(samples, len(total)))
    means = total[drawn].sum(1) / count[drawn].sum(1)
    low, high = np.percentile(means, (2.5, 97.5))
    return float(low), float(high)


def why_none(groups: int, what: str) -> str:
    """Why a mean has no interval, as part of a sentence.

    Args:
        groups: how many there are.
        what: they are, such as drives.
    """
    if groups < FEW:
        return f"too few {what} for an interval: {groups}, it takes {FEW}"
    return f"no interval, as all {what} are alike"


def ends_text(ends: Ends | None, why: str = "", sign: str = "") -> str:
    """``[0.750, 0.940]``, or why there are none in round brackets; sign "+" for a difference."""
    if ends is None:
        return f"({why})"
    low, high = ends
    return f"[{low:{sign}.3f}, {high:{sign}.3f}]"
