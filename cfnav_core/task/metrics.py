"""SR, SPL, CF-SR (Eq. 1) and CF-SPL over episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfnav_core.task.intervals import ends_text, interval_of_mean, interval_of_share, why_none


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
        "cf_sr_interval": interval_of_share(np.array([r.cf_success for r in results]), rooms),
        "collisions_per_episode": float(np.mean([r.collisions for r in results])),
        "steps_per_episode": float(np.mean([r.path_length for r in results])),
    }  # fmt: skip


def paired(a: np.ndarray, b: np.ndarray, rooms: np.ndarray) -> dict[str, Any]:
    """CF-SR of ``a`` minus that of ``b`` on the same episodes.

    Args:
        a, b: bool [N], whether each episode succeeded without a collision.
        rooms: [N], names or numbers of their rooms.

    Returns:
        ``cf_sr_difference``; its 95 % ``interval`` over rooms, None where it cannot be told; and
        ``why`` not, empty where it can.
    """
    difference = a.astype(int) - b.astype(int)
    ends = interval_of_mean(difference, rooms)
    return {
        "cf_sr_difference": float(difference.mean()),
        "interval": ends,
        "why": "" if ends else why_none(len(np.unique(rooms)), "rooms"),
    }


def paired_text(found: Mapping[str, Any]) -> str:
    """A difference of ``paired`` with its interval, or why it has none."""
    ends = ends_text(found["interval"], found.get("why", ""), "+")
    return f"{found['cf_sr_difference']:+.3f} {ends}"


def _mean(values: Sequence[float]) -> float:
    if not len(values):
        raise ValueError("found no episodes, expected at least one to average over")
    return float(np.mean(values))
