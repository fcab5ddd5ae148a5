"""The report's numbers for programs: one JSON file and three tables. Pure.

``metrics.json``: numbers are finite or null. A *figure* is ``{value, low, high, why}``: 95 %
interval over drives, and why something of it is null.

=================== ==============================================================================
``facts``           what the caller says of the run: strings by name
``figures``         by name (``figures.over_drives``): figures with ``drives``, ``sources``
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
with ``*_source``; ``collisions_*`` by source; ``missing`` (which fact, and why, or
what to bear in mind of it), ``notes``.

``decisions.csv``: ``bag``, ``drive``, ``seconds`` from its start, then the fields of ``ReplayStep``
by their names, actions by theirs, and ``agrees, p_driven``, ``p_*`` by action.

``health.csv``: ``bag, topic, kind, start, end`` (s from the bag's start), ``count, text, treated``.

In the tables text that begins like a formula has a ``'`` before it.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from cfnav_core.task.actions import Action
from cfnav_ros.bags.evaluation import BagEvaluation, EvaluatedDrive
from cfnav_ros.bags.judge.contacts import OBSERVABLE, SOURCES
from cfnav_ros.bags.judge.figures import counted_reasons
from cfnav_ros.bags.replay.step import ReplayStep
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
    "driven_vetoed", "driven_p_hat", "action", "agrees", "p_driven", "p_hat",
    "p_hat_lidar", "p_hat_rgb",
    "detection_score", "would_veto", "intact", "collided",
)  # fmt: skip

BAG = ("name", "seconds", "events", "damaged", "messages", "unchecked", "missing", "notes")
"""Of an ``BagEvaluation``; the others have other names."""

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
    evaluations: Sequence[BagEvaluation],
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
        "facts": facts,
        "figures": summary.figures,
        "drivers": [
            {"name": name, "figures": figures} for name, figures in summary.drivers.items()
        ],
        "drives": drives,
        "bundles": [_bundle(scores) for scores in summary.bundles],
        "comparison": [
            {"first": first, "second": second, **vars(found)}
            for (first, second), found in summary.pairs.items()
        ],
        "bags": [_bag(evaluation) for evaluation in evaluations],
        "failed": failed,
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
    row = {"bag": bag, "drive": number, "seconds": evaluated.drive.since_start(step.t_ns)}
    row |= {name: getattr(step, name) for name in ANSWERS}
    return row | {f"p_{action.name}": step.probabilities[action] for action in Action}


def health_rows(evaluation: BagEvaluation) -> list[dict[str, Any]]:
    """The findings about the sensors of one bag."""
    return [{"bag": evaluation.name, **asdict(finding)} for finding in evaluation.findings]


def left_out(evaluation: BagEvaluation) -> list[tuple[str, str, int]]:
    """Decisions that were not answered: bundle (empty: all), the first's reason, how many.

    Reasons that differ in numbers only, such as stamps, are one.
    """
    reasons: dict[str, list[str]] = {}
    for out in evaluation.left_out:
        reasons.setdefault(out.bundle, []).append(out.reason)
    return [
        (bundle, reason, count)
        for bundle, told in reasons.items()
        for reason, count in counted_reasons(told).items()
    ]


def _bag(evaluation: BagEvaluation) -> dict[str, Any]:
    return {
        **{name: getattr(evaluation, name) for name in BAG},
        "topics": evaluation.roles,
        "left_out": [
            {"bundle": bundle, "reason": reason, "count": count}
            for bundle, reason, count in left_out(evaluation)
        ],
        "rates": [{**asdict(topic), "rate": topic.rate} for topic in evaluation.topics],
        "findings": health_rows(evaluation),
    }


def _bundle(scores: BundleScores) -> dict[str, Any]:
    found = scores.agreement
    return {
        "name": scores.name,
        "own_name": scores.own_name,
        "decisions": found.steps,
        "left_out": scores.left_out,
        "agreement": {
            "overall": found.overall,
            "p_driven": found.p_driven,
            "by_action": found.by_action,
            "answers": {
                driven: {own: found.answers[driven, own] for own in Action} for driven in Action
            },
        },
        "collision": {"lidar": scores.lidar, "rgb": scores.rgb},
        "reproduction": scores.own,
    }


def _table(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Comma-separated values with a header; what is not known is an empty cell."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: _cell(_plain(value)) for key, value in row.items()} for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    """Text that a spreadsheet would take for a formula is marked as text, as OWASP has it.

    A bag names itself, its drives and what became of them; whoever made it may be a stranger.
    """
    if not isinstance(value, str):
        return value
    value = value.replace("\r", "\n")  # the writer does not quote it, and a reader ends the row
    return f"'{value}" if value.startswith(("=", "+", "-", "@", "\t", "\n")) else value


def _plain(value: Any) -> Any:
    """What JSON and a table can hold; a number that is not finite becomes null."""
    if is_dataclass(value):
        return _plain(vars(value))
    if isinstance(value, Mapping):
        return {_plain(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Action):
        return value.name
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
