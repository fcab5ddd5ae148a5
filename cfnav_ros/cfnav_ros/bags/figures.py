"""Figures over drives, each with the drives it rests on, its 95 % interval and what it leaves out.

SR, SPL, CF-SR and CF-SPL are those of ``cfnav_core.metrics`` with path lengths in metres. A drive
that lacks anything a figure needs is left out of it, whatever else is known of the drive: to keep
the failures among such drives alone would bend the mean. Pure.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import bootstrap

from cfnav_core import metrics
from cfnav_ros.bags.outcomes import DriveOutcome, Fact

SAMPLES = 2000
"""Of the bootstrap, as in ``metrics.bootstrap_interval``."""


@dataclass(frozen=True)
class Mean:
    """A figure over drives.

    Attributes:
        value: None when no drive has what it needs.
        interval: 95 %, by resampling drives; None with fewer than two.
        drives: how many it rests on.
        sources: how many of them by where their facts come from.
        left_out: how many were left out, by the reason.
    """

    value: float | None
    interval: tuple[float, float] | None = None
    drives: int = 0
    sources: Mapping[str, int] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)


def over_drives(outcomes: Sequence[DriveOutcome]) -> dict[str, Mean]:
    """Work out all figures.

    Returns:
        ``sr``, ``spl``, ``cf_sr``, ``cf_spl``; ``collisions`` a drive, ``collisions_per_m`` (all
        collisions over all metres); means of ``path_length_m``, ``seconds``, ``impact_speed``
        (of the hardest contact, over drives with one), ``clearance_m`` (the least of a drive).
    """
    means = {
        name: _score(outcomes, score, facts, value)
        for name, (score, facts, value) in _SCORES.items()
    }
    for name in ("collisions", "path_length_m", "impact_speed", "clearance_m"):
        means[name] = _mean([getattr(outcome, name) for outcome in outcomes])
    means["seconds"] = _mean([Fact(outcome.seconds, "bag") for outcome in outcomes])
    means["collisions_per_m"] = _per_metre(outcomes)
    return means


Score = Callable[[Sequence[metrics.EpisodeResult]], float]

_SUCCESS = ("success",)
_COLLISIONS = ("collisions",)
_WAYS = ("driven_m", "shortest_path_m")
_SCORES: dict[str, tuple[Score, tuple[str, ...], Callable[[metrics.EpisodeResult], float]]] = {
    "sr": (metrics.sr, _SUCCESS, lambda e: e.success),
    "spl": (metrics.spl, _SUCCESS + _WAYS, lambda e: e.success * e.efficiency),
    "cf_sr": (metrics.cf_sr, _SUCCESS + _COLLISIONS, lambda e: e.cf_success),
    "cf_spl": (
        metrics.cf_spl,
        _SUCCESS + _COLLISIONS + _WAYS,
        lambda e: e.cf_success * e.efficiency,
    ),
}
"""Of each: the function over episodes, the facts it needs, its value of one episode."""


def _score(
    outcomes: Sequence[DriveOutcome],
    score: Score,
    facts: Sequence[str],
    value: Callable[[metrics.EpisodeResult], float],
) -> Mean:
    rows = [[getattr(outcome, name) for name in facts] for outcome in outcomes]
    whole = [all(fact.known for fact in row) for row in rows]
    results = [
        _result(outcome) for outcome, all_there in zip(outcomes, whole, strict=True) if all_there
    ]
    sources = Counter(_sources(row) for row, there in zip(rows, whole, strict=True) if there)
    left_out = _reasons(rows)
    if not results:
        return Mean(None, left_out=left_out)
    values = np.array([value(result) for result in results], np.float64)
    return Mean(score(results), _interval(values), len(results), sources, left_out)


def _result(outcome: DriveOutcome) -> metrics.EpisodeResult:
    """The drive for ``metrics``; what a figure does not need may be missing, and is 0 then."""
    return metrics.EpisodeResult(
        success=bool(outcome.success.value),
        collisions=outcome.collisions.value or 0,
        path_length=outcome.driven_m.value or 0.0,
        shortest_path_length=outcome.shortest_path_m.value or 0.0,
    )


def _mean(facts: Sequence[Fact]) -> Mean:
    known = [fact for fact in facts if fact.known]
    left_out = _reasons([[fact] for fact in facts])
    if not known:
        return Mean(None, left_out=left_out)
    values = np.array([fact.value for fact in known], np.float64)
    sources = Counter(fact.source for fact in known)
    return Mean(float(values.mean()), _interval(values), len(known), sources, left_out)


def _per_metre(outcomes: Sequence[DriveOutcome]) -> Mean:
    """All collisions over all metres, so that a short drive counts for little."""
    known = [outcome for outcome in outcomes if outcome.collisions_per_m.known]
    left_out = _reasons([[outcome.collisions_per_m] for outcome in outcomes])
    if not known:
        return Mean(None, left_out=left_out)
    counts = np.array([outcome.collisions.value for outcome in known], np.float64)
    ways = np.array([outcome.counted_m.value for outcome in known], np.float64)
    sources = Counter(outcome.collisions_per_m.source for outcome in known)
    interval = None
    if len(known) > 1:
        found = bootstrap(
            (counts, ways),
            lambda count, way, axis: count.sum(axis) / way.sum(axis),
            paired=True,
            n_resamples=SAMPLES,
            method="percentile",
            rng=0,
        ).confidence_interval
        interval = (float(found.low), float(found.high))
    return Mean(float(counts.sum() / ways.sum()), interval, len(known), sources, left_out)


def _interval(values: np.ndarray) -> tuple[float, float] | None:
    """The 95 % interval of a mean over drives."""
    if len(values) < 2:
        return None
    return metrics.bootstrap_interval(values, np.arange(len(values)), SAMPLES)


def _sources(facts: Sequence[Fact]) -> str:
    """Where the facts of one drive come from."""
    return ", ".join(dict.fromkeys(fact.source for fact in facts))


def _reasons(rows: Sequence[Sequence[Fact]]) -> Counter[str]:
    """How many drives lack a fact, by the first reason of each."""
    lacking = (next((fact.why for fact in row if not fact.known), "") for row in rows)
    return Counter(reason for reason in lacking if reason)
