"""The outcome of one episode: the simulator's own account of it, and that of its bag. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

from cfnav_core.task import metrics

UNFINISHED = "unfinished"
"""Outcome of an episode whose end the bag does not hold."""


@dataclass(frozen=True)
class Outcome:
    """The figures of one episode, under the names of ``metrics.json``."""

    goal: str
    room: str
    outcome: str
    success: bool
    collisions: int
    cf_success: bool
    steps: int
    path_length_m: float
    shortest_path_m: float


def agree(live: Outcome, bag: Outcome) -> bool:
    """Tell whether the bag's outcome is that of the simulator's own account.

    Everything must be equal; path lengths within 2 cm or 2 %, as the bag joins poses that were
    sampled at 20 Hz.
    """

    def rest(outcome: Outcome) -> Outcome:
        return replace(outcome, path_length_m=0.0, shortest_path_m=0.0)

    return (
        rest(live) == rest(bag)
        and math.isclose(live.path_length_m, bag.path_length_m, rel_tol=0.02, abs_tol=0.02)
        and math.isclose(live.shortest_path_m, bag.shortest_path_m, rel_tol=1e-6)
    )


def figures(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Return ``sr``, ``spl``, ``cf_sr``, ``cf_spl`` over episodes, path lengths in metres.

    Source: Eq. 1 and Section V of the paper, see ``cfnav_core.task.metrics``.
    """
    results = [
        metrics.EpisodeResult(
            success=o.success,
            collisions=o.collisions,
            path_length=o.path_length_m,
            shortest_path_length=o.shortest_path_m,
        )
        for o in outcomes
    ]
    names = ("sr", "spl", "cf_sr", "cf_spl")
    return {name: float(getattr(metrics, name)(results)) for name in names}


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the episodes as lines of text for a terminal."""
    head = ("room", "goal", "outcome", "reached", "touched", "steps", "m")
    lines = ["{:<16}{:<15}{:<12}{:<9}{:<9}{:>6}{:>8}".format(*head)]
    for o in outcomes:
        reached = "yes" if o.success else "no"
        lines.append(
            f"{o.room:<16}{o.goal:<15}{o.outcome:<12}{reached:<9}{o.collisions:<9}{o.steps:>6}"
            f"{o.path_length_m:>8.2f}"
        )
    return "\n".join(lines)


class Timed(Protocol):
    """What has a time, nanoseconds."""

    @property
    def t_ns(self) -> int: ...  # noqa: D102


M = TypeVar("M", bound=Timed)


def nearest(samples: Sequence[M], t_ns: int) -> M:
    """Return the sample nearest to a time; the first of two as near."""
    return min(samples, key=lambda sample: abs(sample.t_ns - t_ns))
