"""One self-contained HTML page about recorded drives.

Needs no ROS and no network, neither to write the page nor to read it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from cfnav_core.files.whole import write_file
from cfnav_ros.bags.evaluation import BagEvaluation, EvaluatedDrive
from cfnav_ros.bags.judge.figures import Mean
from cfnav_ros.bags.replay.scores import Figure
from cfnav_ros.bags.results import left_out
from cfnav_ros.bags.summary import BundleScores, Summary, drives_in, summarise
from cfnav_ros.report.cards import (
    CARDS,
    MEANING,
    disagreements_of,
    in_themes,
    key_pictures,
    remarks,
    signed,
    uri,
    why_no_pictures,
    with_pictures,
    words_of,
)
from cfnav_ros.report.plot_theme import ACTION_STYLE, DASH, MINUS
from cfnav_ros.report.score_plot import CURVES, RELIABILITY, score_png
from cfnav_ros.report.timeline_plot import timeline_png
from cfnav_ros.report.trajectory_plot import course_of, trajectory_png

FINDINGS = 40
"""Findings shown of each bag; all of them are in ``health.csv``."""

ROWS = 500
"""Drives shown in the table; all of them are in ``drives.csv``."""


@dataclass(frozen=True)
class Tile:
    """One figure of the summary: its name, its key in ``figures``, its unit, what it means."""

    name: str
    key: str
    unit: str
    meaning: str
    digits: int = 2


TILES = (
    Tile("CF-SR", "cf_sr", "", "reached, nothing touched"),
    Tile("SR", "sr", "", "reached"),
    Tile("CF-SPL", "cf_spl", "", "CF-SR by path length"),
    Tile("SPL", "spl", "", "SR by path length"),
    Tile("Collisions per metre", "collisions_per_m", "", "all collisions over all metres", 3),
    Tile("Collisions", "collisions", "", "a drive"),
    Tile("Impact speed", "impact_speed", "m/s", "hardest touch of a drive that touched"),
    Tile("Clearance", "clearance_m", "m", "least of a drive, straight ahead"),
    Tile("Path", "path_length_m", "m", "a drive, by odometry"),
    Tile("Time", "seconds", "s", "a drive", 1),
)


def write_report(
    evaluations: Sequence[BagEvaluation],
    html: Path,
    facts: Mapping[str, str],
    summary: Summary | None = None,
    failed: Sequence[str] = (),
) -> None:
    """Write the page.

    Args:
        evaluations: of the bags, in the order of the page.
        html: file to write; its folder is made.
        facts: what else stands at the end, such as seed, commit, command.
        summary: of the same evaluations; worked out when not given.
        failed: a sentence for each bag that could not be evaluated at all.

    Raises:
        WriteError: the disk is full or refuses.
    """
    write_file(html, report_page(evaluations, facts, summary or summarise(evaluations), failed))


def report_page(
    evaluations: Sequence[BagEvaluation],
    facts: Mapping[str, str],
    summary: Summary,
    failed: Sequence[str] = (),
) -> str:
    """Return the page as text; arguments as for ``write_report``."""
    drives = [drive for _, drive in drives_in(evaluations)]
    rows = [(number, *row) for number, row in enumerate(drives_in(evaluations), 1)]
    pictured = with_pictures(drives)
    return (
        _environment()
        .get_template("report.html")
        .render(
            bags=evaluations,
            rows=rows[:ROWS],
            drives=len(drives),
            pictured={place + 1 for place in pictured},
            cards=[row for row in rows if row[0] - 1 in pictured],
            most_cards=CARDS,
            tiles=[(tile, summary.figures[tile.key]) for tile in TILES],
            drivers=summary.drivers,
            sources=_sources(summary, drives),
            bundles=[(scores, _score_pictures(scores)) for scores in summary.bundles],
            pairs=summary.pairs,
            disagreements=disagreements_of(drives),
            missing=[(bag, left_out(bag)) for bag in evaluations],
            most_findings=FINDINGS,
            failed=failed,
            facts=facts,
            legend=[(action.name, *look) for action, look in ACTION_STYLE.items()],
        )
    )


def write_trajectories(drives: Sequence[EvaluatedDrive], folder: Path) -> list[Path]:
    """Write one PNG of each drive from above into a folder; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, evaluated in enumerate(drives, 1):
        outcome = evaluated.outcome
        words = (f"{number:02d}", outcome.room.replace(":", ""), outcome.goal)
        name = "_".join(filter(None, words)).replace("/", "-")
        (folder / f"{name}.png").write_bytes(trajectory_png(evaluated))
        paths.append(folder / f"{name}.png")
    return paths


def number_text(value: float | None, digits: int = 2) -> str:
    """A number for reading; a dash when it is not known."""
    return DASH if value is None else f"{value:.{digits}f}".replace("-", MINUS)


def figure_text(figure: Figure, digits: int = 2) -> str:
    """A figure with its 95 % interval, or why it has none."""
    if figure.value is None:
        return f"{DASH} ({figure.why})"
    value = number_text(figure.value, digits)
    if figure.low is None or figure.high is None:
        return f"{value} ({figure.why})"
    return f"{value} ({number_text(figure.low, digits)} to {number_text(figure.high, digits)})"


def change_text(figure: Figure, digits: int = 3) -> str:
    """A difference with its sign and its interval."""
    text = figure_text(figure, digits)
    return f"+{text}" if figure.value is not None and figure.value > 0 else text


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("cfnav_ros.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number_text,
        "figure": figure_text,
        "change": change_text,
        "interval": interval_text,
        "words": words_of,
        "remarks": remarks,
        "signed": signed,
        "uri": uri,
        "course": lambda drive: course_of(drive).words,
        "trajectory": lambda drive: in_themes(partial(trajectory_png, drive)),
        "timeline": lambda drive, bag: in_themes(partial(timeline_png, drive, tuple(bag.bundles))),
        "key_pictures": key_pictures,
        "why_no_pictures": why_no_pictures,
    }
    return environment


def _sources(summary: Summary, drives: Sequence[EvaluatedDrive]) -> dict[str, str]:
    """The words for sources that are used on the page, with their meaning."""
    used = {
        word for mean in summary.figures.values() for source in mean.sources
        for word in source.split(", ")
    }  # fmt: skip
    used |= {source for drive in drives for source in drive.outcome.collisions_by}
    return {word: meaning for word, meaning in MEANING.items() if word in used}


def _score_pictures(scores: BundleScores) -> list[dict[str, Any]]:
    """Reliability diagram, ROC, precision and recall of one bundle, with captions."""
    both = (scores.lidar, scores.rgb)
    if not any(found.moves for found in both):
        return []
    curves = any(0 < found.collisions < found.moves for found in both)
    return [
        {
            "uris": in_themes(partial(score_png, diagram, *both)),
            "text": diagram.caption,
        }
        for diagram in (RELIABILITY, *(CURVES if curves else ()))
    ]


def interval_text(mean: Mean, digits: int = 2) -> str:
    """The 95 % interval of a figure over drives, or why it has none."""
    if mean.low is None or mean.high is None:
        return mean.why
    return f"95 %: {number_text(mean.low, digits)} to {number_text(mean.high, digits)}"
