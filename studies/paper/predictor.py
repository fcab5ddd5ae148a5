"""How good the collision probabilities are: the RGB predictor's, and the LiDAR's in its place.

Both are judged on the same steps: those of the test episodes that ours drove with its own
prediction. What is to be told is whether MoveAhead would collide there, whatever was done.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from cfnav_core.files.json_file import write_json
from cfnav_core.files.whole import write_file
from cfnav_core.scenes.scene import LIDAR
from cfnav_core.scenes.select import lidar_of
from cfnav_core.task import calibration as rel
from studies.engine.bench import Bench
from studies.engine.episodes import load_steps
from studies.engine.pages import Cell, table
from studies.engine.results import Results
from studies.engine.row import Row
from studies.paper.rows import NAMES

JUDGED = ("I", "tenfold")
"""Tables whose rows of ours are judged."""

MEANS = ("blocked", "auc", "ece", "skill")
"""Figures of a run that are averaged over runs."""

COLUMNS: dict[str, Cell] = {
    "data": lambda q: q.split,
    "model": lambda q: q.model,
    "source": lambda q: q.source,
    "AUC": lambda q: f"{q.auc:.3f}",
    "calibration error": lambda q: f"{q.ece:.3f}",
    "Brier skill": lambda q: f"{q.skill:.3f}",
    "blocked": lambda q: f"{100 * q.blocked:.1f} %",
    "steps": lambda q: f"{q.steps:,}",
    "seeds": lambda q: q.seeds,
}


@dataclass(frozen=True)
class Quality:
    """Of one source of probabilities: of a run, or means over runs.

    Attributes:
        source: "RGB predictor", "LiDAR", or "the larger" of both.
        model: with its schedule and its preset where these are not the usual ones.
        split: whose episodes.
        steps: judged, of all runs. blocked: share of them at which MoveAhead would collide.
        auc: area under the ROC curve.
        ece: expected calibration error, 10 bins of equal width.
        skill: Brier skill against the constant share of blocked steps.
        seeds: of training, whose runs were judged.
    """

    source: str
    model: str
    split: str
    steps: int
    blocked: float
    auc: float
    ece: float
    skill: float
    seeds: int = 1


def judge_predictors(rows: Sequence[Row], bench: Bench) -> list[Quality]:
    """How good the probabilities are that ours was given, of every training.

    The LiDAR's are judged beside them where the test rooms were scanned.

    Args:
        rows: tested ones.
        bench: where they are.

    Raises:
        ValueError: a run was not tested yet, or its steps were not kept.
    """
    found: list[Quality] = []
    for row in rows:
        if row.method == "ours" and row.table in JUDGED and not (row.itself or row.sample):
            found += over_runs(judged(row, bench))
    return found


def write_qualities(found: Sequence[Quality], results: Path) -> None:
    """Write and print qualities, beside those of other runs that are there.

    Args:
        found: of the probabilities.
        results: folder that gets ``predictor.json`` and ``predictor.md``.

    Raises:
        WriteError: the results cannot be written.
    """
    if not found:
        return
    path = results / "predictor.json"
    kept = json.loads(path.read_text()) if path.exists() else []
    every = {(q.source, q.model, q.split): q for q in (*(Quality(**q) for q in kept), *found)}
    page = table(COLUMNS, every.values())
    write_file(results / "predictor.md", page)
    write_file(path, json.dumps([asdict(q) for q in every.values()], indent=1))
    print(f"Collision probabilities\n\n{page}")


def judged(row: Row, bench: Bench) -> list[list[Quality]]:
    """The probabilities of each run of a tested row, its own and the LiDAR's on the same steps.

    Kept beside a run's results, as its steps are large.

    Raises:
        ValueError: a run was not tested yet, or its steps were not kept and not judged before.
    """
    scanned = f"{row.split} {LIDAR}" in bench.made.tests
    of = bench.test(replace(row, p_hat="lidar" if scanned else "own")).made_of
    runs = []
    for result in bench.files(row):
        path = result.with_suffix(f".predictor_{of}.json")
        if not path.exists():
            names = sorted(set(Results.load([result]).rooms.tolist()))
            lidar = lidar_of(bench.places.scenes, names) if scanned else None
            found = qualities(_title(row, bench), row.split, load_steps(result), lidar)
            write_json(path, {"sources": [asdict(q) for q in found]})
        runs.append([Quality(**q) for q in json.loads(path.read_text())["sources"]])
    return runs


def _title(row: Row, bench: Bench) -> str:
    more = [row.schedule] * (row.schedule != "usual") + [bench.preset] * (bench.preset != "small")
    return ", ".join([NAMES[row.model], *more])


def qualities(
    model: str, split: str, steps: Mapping[str, np.ndarray], lidar: np.ndarray | None
) -> list[Quality]:
    """Judge the predictor of a run of ours, and the LiDAR where its probabilities are known.

    Args:
        model, split: of the run.
        steps: with its own prediction.
        lidar: float32 [S], by state of the test scenes.
    """
    own = steps["p_hat"].astype(float)
    sources = {"RGB predictor": own}
    if lidar is not None:
        given = lidar[steps["states"]].astype(float)
        sources |= {"LiDAR": given, "the larger": np.maximum(given, own)}
    blocked = float(steps["blocked"].mean())
    return [
        Quality(source, model, split, len(own), blocked, *_figures(p, steps["blocked"]))
        for source, p in sources.items()
    ]


def over_runs(found: Sequence[Sequence[Quality]]) -> list[Quality]:
    """Means over runs, source by source."""
    return [
        replace(
            same[0],
            steps=sum(q.steps for q in same),
            seeds=len(same),
            **{name: float(np.mean([getattr(q, name) for q in same])) for name in MEANS},
        )
        for same in zip(*found, strict=True)
    ]


def _figures(p: np.ndarray, blocked: np.ndarray) -> tuple[float, float, float]:
    ones, base = np.ones(len(p)), blocked.mean()
    skill = 1 - rel.brier(p, blocked, ones) / (base * (1 - base))
    auc, ece = rel.auc(p, blocked), rel.calibration_error(p, blocked, within=rel.EVERY)
    return float(auc), float(ece), float(skill)
