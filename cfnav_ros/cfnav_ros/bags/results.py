"""The report's numbers for programs: one JSON file and three tables. Pure.

``metrics.json``: numbers are finite or null. A *figure* is ``{value, low, high, why}``: 95 %
interval over drives, and why something of it is null.

=================== ==============================================================================
``facts``           what the caller says of the run: strings by name
``figures``         by name (``figures.over_drives``): ``value, low, high, drives``, ``sources``
                    (drives by source), ``left_out`` (drives by the reason)
``drivers``         ``name`` (empty: not told) and ``figures`` of each bundle that drove; none when
                    one drove them all
``drives``          one object a drive: the columns of ``drives.csv``
``bundles``         ``name, own_name, decisions, left_out, agreement`` (figures ``overall`` and
                    ``p_driven``, ``by_action``; ``answers`` by driven and own action),
                    ``collision`` (``lidar`` and ``rgb``: ``moves, collisions``, figures, ``bins``,
                    ``roc`` and ``precision_recall`` as rows of ``CollisionScores``),
                    ``reproduction`` (``Reproduction``)
``comparison``      ``first, second, steps, not_paired``, figures of second minus first
``bags``            ``name, seconds, events, damaged, messages, unchecked`` (how many of them no
                    checksum protects), ``topics`` (by role), ``missing``, ``notes``,
                    ``left_out`` (``bundle, reason, count``), ``rates`` (``TopicHealth``, ``rate``
                    in Hz from first to last), ``findings`` (the columns of ``health.csv``)
``failed``          a sentence for each bag that could not be evaluated
=================== ==============================================================================

``drives.csv``: ``bag``, ``drive`` (number within the report), ``found, start_ns, seconds, goal,
room, bundle`` (the driver), ``outcome, message, steps, vetoes``; the facts of ``DriveOutcome`` each
with ``*_source``; ``collisions_*`` by source; ``missing`` (which fact, and why), ``notes``.

``decisions.csv``: ``bag``, ``drive``, ``seconds`` from its start, then the fields of ``ReplayStep``
by their names, actions by theirs, and ``agrees, p_driven``, ``p_*`` by action.

``health.csv``: ``bag, topic, kind, start, end`` (s from the bag's start), ``count, text, treated``.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from cfnav_core.actions import Action
from cfnav_ros.bags.contacts import OBSERVABLE, SOURCES
from cfnav_ros.bags.evaluation import EvaluatedDrive, Evaluation
from cfnav_ros.bags.figures import Mean
from cfnav_ros.bags.replay_step import ReplayStep
from cfnav_ros.bags.scores import Agreement, CollisionScores, Comparison, Figure
from cfnav_ros.bags.summary import BundleScores, Summary, drives_in

METRICS, DRIVES, DECISIONS, HEALTH = "metrics.json", "drives.csv", "decisions.csv", "health.csv"

FACTS = (
    "success", "collisions", "cf_success", "path_length_m", "truth_length_m", "shortest_path_m",
    "collisions_per_m", "impact_speed", "clearance_m",
)  # fmt: skip
"""Of a ``DriveOutcome``, each with its source."""

TOLD = ("goal", "room", "bundle", "outcome", "message", "seconds", "steps", "vetoes")

ANSWERS = (
    "bundle", "driver", "goal", "step", "t_ns", "until_ns", "image_ns", "estimate_ns", "driven",
    "driven_vetoed", "driven_p_hat", "action", "agrees", "p_driven", "p_hat", "p_hat_rgb",
    "detection_score", "would_veto", "intact", "collided",
)  # fmt: skip

DRIVE_COLUMNS = (
    "bag", "drive", "found", "start_ns", *TOLD,
    *(name for fact in FACTS for name in (fact, f"{fact}_source")),
    *(f"collisions_{source}" for source in (*SOURCES, OBSERVABLE)), "missing", "notes",
)  # fmt: skip
DECISION_COLUMNS = (
    "bag", "drive", "seconds", *ANSWERS, *(f"p_{action.name}" for action in Action),
)  # fmt: skip
HEALTH_COLUMNS = ("bag", "topic", "kind", "start", "end", "count", "text", "treated")


def result_files(
    evaluations: Sequence[Evaluation],
    summary: Summary,
    facts: Mapping[str, str],
    failed: Sequence[str] = (),
) -> dict[str, str]:
    """Everything that is known, as the texts of files by their names.

    Args:
        evaluations: of the bags.
        summary: of the same evaluations.
        facts: what else belongs to the results, such as command and commit.
        failed: a sentence for each bag that could not be evaluated at all.
    """
    drives = [
        drive_row(number, bag.name, drive)
        for number, (bag, drive) in enumerate(drives_in(evaluations), 1)
    ]
    decisions = [
        decision_row(number, bag.name, drive, step)
        for number, (bag, drive) in enumerate(drives_in(evaluations), 1)
        for step in drive.steps
    ]
    found = [row for bag in evaluations for row in health_rows(bag)]
    metrics = {
        "facts": dict(facts),
        "figures": {name: _mean(mean) for name, mean in summary.figures.items()},
        "drivers": [
            {"name": name, "figures": {key: _mean(mean) for key, mean in figures.items()}}
            for name, figures in summary.drivers.items()
        ],
        "drives": drives,
        "bundles": [_bundle(scores) for scores in summary.bundles],
        "comparison": [
            {"first": pair.first, "second": pair.second, **_comparison(pair.found)}
            for pair in summary.pairs
        ],
        "bags": [_bag(evaluation) for evaluation in evaluations],
        "failed": list(failed),
    }
    return {
        METRICS: json.dumps(_plain(metrics), indent=1, allow_nan=False, ensure_ascii=False) + "\n",
        DRIVES: _table(DRIVE_COLUMNS, drives),
        DECISIONS: _table(DECISION_COLUMNS, decisions),
        HEALTH: _table(HEALTH_COLUMNS, found),
    }


def drive_row(number: int, bag: str, evaluated: EvaluatedDrive) -> dict[str, Any]:
    """The figures of one drive."""
    drive, outcome = evaluated.drive, evaluated.outcome
    facts = {name: getattr(outcome, name) for name in FACTS}
    row = {"bag": bag, "drive": number, "found": drive.found, "start_ns": drive.start_ns}
    row |= {name: getattr(outcome, name) for name in TOLD}
    for name, fact in facts.items():
        row |= {name: fact.value, f"{name}_source": fact.source}
    counted = outcome.collisions_by
    row |= {f"collisions_{source}": counted.get(source) for source in (*SOURCES, OBSERVABLE)}
    missing = [f"{name}: {fact.why}" for name, fact in facts.items() if fact.why]
    return row | {"missing": "; ".join(missing), "notes": " ".join(outcome.notes)}


def decision_row(
    number: int, bag: str, evaluated: EvaluatedDrive, step: ReplayStep
) -> dict[str, Any]:
    """The answer of one bundle to one decision."""
    row = {"bag": bag, "drive": number, "seconds": (step.t_ns - evaluated.drive.start_ns) * 1e-9}
    for name in ANSWERS:
        value = getattr(step, name)
        row[name] = value.name if isinstance(value, Action) else value
    return row | {f"p_{action.name}": float(step.probabilities[action]) for action in Action}


def health_rows(evaluation: Evaluation) -> list[dict[str, Any]]:
    """The findings about the sensors of one bag."""
    return [{"bag": evaluation.name, **asdict(finding)} for finding in evaluation.findings]


def left_out(evaluation: Evaluation) -> list[tuple[str, str, int]]:
    """Decisions that were not answered: bundle (empty: all), the first's reason, how many.

    Reasons that differ in numbers only, such as stamps, are one.
    """
    counts: dict[tuple[str, str], int] = {}
    first: dict[tuple[str, str], str] = {}
    for out in evaluation.left_out:
        key = (out.bundle, re.sub(r"\d+(\.\d+)?", "#", out.reason))
        counts[key] = counts.get(key, 0) + 1
        first.setdefault(key, out.reason)
    return [(key[0], first[key], count) for key, count in counts.items()]


def _bag(evaluation: Evaluation) -> dict[str, Any]:
    return {
        "name": evaluation.name,
        "seconds": evaluation.seconds,
        "events": evaluation.events,
        "damaged": evaluation.damaged,
        "messages": evaluation.messages,
        "unchecked": evaluation.unchecked,
        "topics": dict(evaluation.roles),
        "missing": list(evaluation.missing),
        "notes": list(evaluation.notes),
        "left_out": [
            {"bundle": bundle, "reason": reason, "count": count}
            for bundle, reason, count in left_out(evaluation)
        ],
        "rates": [{**asdict(topic), "rate": topic.rate} for topic in evaluation.topics],
        "findings": health_rows(evaluation),
    }


def _bundle(scores: BundleScores) -> dict[str, Any]:
    return {
        "name": scores.name,
        "own_name": scores.own_name,
        "decisions": scores.agreement.steps,
        "left_out": scores.left_out,
        "agreement": _agreement(scores.agreement),
        "collision": {"lidar": _collision(scores.lidar), "rgb": _collision(scores.rgb)},
        "reproduction": asdict(scores.own),
    }


def _agreement(found: Agreement) -> dict[str, Any]:
    answers = {
        driven.name: {own.name: int(found.answers[driven, own]) for own in Action}
        for driven in Action
    }
    return {
        "overall": asdict(found.overall),
        "p_driven": asdict(found.p_driven),
        "by_action": {action.name: asdict(value) for action, value in found.by_action.items()},
        "answers": answers,
    }


def _collision(found: CollisionScores) -> dict[str, Any]:
    figures = {name: asdict(value) for name, value in vars(found).items() if _is_figure(value)}
    return {
        "moves": found.moves,
        "collisions": found.collisions,
        **figures,
        "bins": [asdict(one) for one in found.bins],
        "roc": found.roc,
        "precision_recall": found.precision_recall,
    }


def _comparison(found: Comparison) -> dict[str, Any]:
    figures = {name: asdict(value) for name, value in vars(found).items() if _is_figure(value)}
    return {"steps": found.steps, "not_paired": found.not_paired, **figures}


def _is_figure(value: object) -> bool:
    return isinstance(value, Figure)


def _mean(mean: Mean) -> dict[str, Any]:
    low, high = mean.interval or (None, None)
    return {
        "value": mean.value,
        "low": low,
        "high": high,
        "drives": mean.drives,
        "sources": dict(mean.sources),
        "left_out": dict(mean.left_out),
    }


def _table(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Comma-separated values with a header; what is not known is an empty cell."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _plain(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def _plain(value: Any) -> Any:
    """What JSON can hold; a number that is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
