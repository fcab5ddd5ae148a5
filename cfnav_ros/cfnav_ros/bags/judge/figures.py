"""Figures over drives, each with the drives it rests on, its 95 % interval and what it leaves out.

SR, SPL, CF-SR and CF-SPL are those of ``cfnav_core.task.metrics`` with path lengths in metres. A
drive that lacks anything a figure needs is left out of it, whatever else is known of the drive: to
keep the failures among such drives alone would bend the mean. Pure.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cfnav_core.task.intervals import interval_of_mean, interval_of_share, why_none
from cfnav_core.task.metrics import EpisodeResult
from cfnav_ros.bags.judge.outcomes import DriveOutcome, Fact, sources_of


@dataclass(frozen=True)
class Mean:
    """A figure over drives.

    Attributes:
        value: None when no drive has what it needs.
        low: lower bound of its 95 % interval over drives (``task.intervals``), None when it cannot
            be told.
        high: upper bound.
        why: why the interval cannot be told; part of a sentence, empty when it can.
        drives: how many it rests on.
        sources: how many of them by where their facts come from.
        left_out: how many were left out, by the reason (``counted_reasons``).
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    why: str = ""
    drives: int = 0
    sources: Mapping[str, int] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)


def counted_reasons(reasons: Iterable[str]) -> dict[str, int]:
    """How often each reason is given; of those that differ in numbers only, the first stands."""
    first: dict[str, str] = {}
    counts = Counter(
        first.setdefault(re.sub(r"\d+(\.\d+)?", "#", reason), reason) for reason in reasons
    )
    return dict(counts)


def over_drives(outcomes: Sequence[DriveOutcome]) -> dict[str, Mean]:
    """Work out all figures.

    Returns:
        ``sr``, ``spl``, ``cf_sr``, ``cf_spl``; ``collisions`` a drive, ``collisions_per_m`` (all
        collisions over all metres, so that a short drive counts for little); means of
        ``path_length_m``, ``seconds``, ``impact_speed`` (of the hardest contact, over drives with
        one), ``clearance_m`` (the least of a drive).
    """

    def mean_of(name: str) -> Mean:
        return _mean(outcomes, lambda o: [getattr(o, name)], lambda o: getattr(o, name).value)

    return {
        "sr": _mean(outcomes, lambda o: [o.success], lambda o: _result(o).success, share=True),
        "spl": _mean(
            outcomes,
            lambda o: [o.success, o.driven_m, o.shortest_path_m],
            lambda o: _result(o).success * _result(o).efficiency,
        ),
        "cf_sr": _mean(
            outcomes,
            lambda o: [o.success, o.collisions],
            lambda o: _result(o).cf_success,
            share=True,
        ),
        "cf_spl": _mean(
            outcomes,
            lambda o: [o.success, o.collisions, o.driven_m, o.shortest_path_m],
            lambda o: _result(o).cf_success * _result(o).efficiency,
        ),
        "collisions": mean_of("collisions"),
        "path_length_m": mean_of("path_length_m"),
        "impact_speed": mean_of("impact_speed"),
        "clearance_m": mean_of("clearance_m"),
        "seconds": _mean(outcomes, lambda o: [Fact(o.seconds, "bag")], lambda o: o.seconds),
        "collisions_per_m": _mean(
            outcomes,
            lambda o: [o.collisions_per_m],
            lambda o: o.collisions.value,
            lambda o: o.counted_m.value,
        ),
    }


def _mean(
    outcomes: Sequence[DriveOutcome],
    facts_of: Callable[[DriveOutcome], Sequence[Fact]],
    value_of: Callable[[DriveOutcome], float],
    weight_of: Callable[[DriveOutcome], float] = lambda outcome: 1.0,
    share: bool = False,
) -> Mean:
    """The sum of the drives' values over that of their weights.

    Args:
        outcomes: of the drives.
        facts_of: what of a drive must be known; the first that is not says why it is left out.
        value_of: a drive of which it is.
        weight_of: likewise.
        share: whether values are 0 or 1, and so the mean is a share of drives.
    """
    sources, reasons, known = Counter[str](), list[str](), []
    for outcome in outcomes:
        facts = facts_of(outcome)
        lacking = [fact.why for fact in facts if not fact.known]
        if lacking:
            reasons.append(lacking[0])
        else:
            sources[sources_of(*facts)] += 1
            known.append(outcome)
    left_out = counted_reasons(reasons)
    if not known:
        return Mean(None, left_out=left_out)
    values = np.array([value_of(outcome) for outcome in known], np.float64)
    weights = np.array([weight_of(outcome) for outcome in known], np.float64)
    each = np.arange(len(known))
    ends = interval_of_share(values, each) if share else interval_of_mean(values, each, weights)
    low, high = ends or (None, None)
    why = "" if ends else why_none(len(known), "drives")
    value = float(values.sum() / weights.sum())
    return Mean(value, low, high, why, len(known), sources, left_out)


def _result(outcome: DriveOutcome) -> EpisodeResult:
    """The drive for ``metrics``; what a figure does not need may be missing, and is 0 then."""
    return EpisodeResult(
        success=bool(outcome.success.value),
        collisions=outcome.collisions.value or 0,
        path_length=outcome.driven_m.value or 0.0,
        shortest_path_length=outcome.shortest_path_m.value or 0.0,
    )
