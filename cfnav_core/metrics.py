"""SR, SPL, CF-SR (Eq. 1) and CF-SPL over episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class EpisodeResult:
    """One finished episode.

    Attributes:
        success: Done was said with the goal visible.
        collisions: how often the robot collided.
        path_length: d, actions (Done included) or metres.
        shortest_path_length: d*, in the same unit.
    """

    success: bool
    collisions: int
    path_length: float
    shortest_path_length: float

    @property
    def cf_success(self) -> bool:
        """S_i: success without a collision."""
        return self.success and self.collisions == 0

    @property
    def efficiency(self) -> float:
        """d* / max(d*, d); 1 when the start already sees the goal and the robot did not move."""
        longest = max(self.shortest_path_length, self.path_length)
        return self.shortest_path_length / longest if longest > 0 else 1.0


def sr(episodes: Sequence[EpisodeResult]) -> float:
    """Success rate, collisions ignored."""
    return _mean([e.success for e in episodes])


def spl(episodes: Sequence[EpisodeResult]) -> float:
    """Success weighted by path length, collisions ignored."""
    return _mean([e.success * e.efficiency for e in episodes])


def cf_sr(episodes: Sequence[EpisodeResult]) -> float:
    """Collision-free success rate. Source: Eq. 1."""
    return _mean([e.cf_success for e in episodes])


def cf_spl(episodes: Sequence[EpisodeResult]) -> float:
    """Collision-free success weighted by path length. Source: Section III."""
    return _mean([e.cf_success * e.efficiency for e in episodes])


def figures(results: Sequence[EpisodeResult], rooms: np.ndarray) -> dict[str, Any]:
    """SR, SPL, CF-SR, CF-SPL, collisions an episode, and the 95 % interval of CF-SR over rooms.

    Args:
        results: N episodes.
        rooms: [N], names or numbers of their rooms.
    """
    return {
        "episodes": len(results),
        "sr": sr(results), "spl": spl(results),
        "cf_sr": cf_sr(results), "cf_spl": cf_spl(results),
        "cf_sr_interval": bootstrap_interval(np.array([r.cf_success for r in results]), rooms),
        "collisions_per_episode": float(np.mean([r.collisions for r in results])),
        "steps_per_episode": float(np.mean([r.path_length for r in results])),
    }  # fmt: skip


def _mean(values: Sequence[float]) -> float:
    if not len(values):
        raise ValueError("found no episodes, expected at least one to average over")
    return float(np.mean(values))


def bootstrap_interval(
    values: np.ndarray, groups: np.ndarray, samples: int = 2000, seed: int = 0
) -> tuple[float, float]:
    """95 % interval of a mean, resampling whole groups (rooms), which are what varies.

    Args:
        values: float [N].
        groups: int [N], the room of each value.
        samples: bootstrap samples.
        seed: of the resampling.

    Returns:
        Lower and upper bound.
    """
    _, index = np.unique(groups, return_inverse=True)
    total = np.bincount(index, values.astype(float))
    count = np.bincount(index)
    drawn = np.random.default_rng(seed).integers(len(total), size=(samples, len(total)))
    means = total[drawn].sum(1) / count[drawn].sum(1)
    low, high = np.percentile(means, (2.5, 97.5))
    return float(low), float(high)
