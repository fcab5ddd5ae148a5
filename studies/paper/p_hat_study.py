"""How p_hat should enter: ``python -m studies.paper.p_hat_study``, in validation rooms.

The paper feeds one number and does not say where. Here the methods of a grid stand beside variants
of ours, each given other probabilities. No test room is looked at, and nothing is chosen for the
tables of the paper.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import tyro

from cfnav_core.agent.config import MethodName, ModelName
from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.whole import write_file
from cfnav_core.models.size import PUBLISHED
from cfnav_core.task.p_hat import PHat
from studies.engine.bench import Bench, GridOptions
from studies.engine.grid import executor_of, run_tasks
from studies.engine.pages import Cell, change, spread, table
from studies.engine.results import compared, measured
from studies.engine.row import Row, Schedule, Split, Variant
from studies.engine.stamps import Made, check_rooms, identity_of_rooms
from studies.engine.work import Task
from studies.paper.rows import DRIVEN, GIVEN, NAMES, STUDIED

PLAIN = "plain"

Way = tuple[str, MethodName, Variant]
"""A way for p_hat to enter: in words, its method and variant of training."""

SCALAR: Way = ("ours: one number of the LSTM's input", "ours", "")
LOGITS: Way = ("ours, also added to the action logits", "ours", "listening")
TOLD: Way = ("told the true flag in training", "truth", "")
DROPPED: Way = (f"ours, dropout {PUBLISHED.dropout} on picture features", "ours", "dropout")

STUDIES: dict[tuple[ModelName, Split], tuple[Way, ...]] = {
    DRIVEN: (SCALAR, LOGITS, TOLD),
    STUDIED: (SCALAR, LOGITS, DROPPED, TOLD),
}
"""TDANet-style reads no picture features, L-sTDE does."""

ASKED: tuple[PHat, ...] = ("own", *GIVEN)


@dataclass(frozen=True)
class PHatStudy(GridOptions):
    """Study how p_hat should enter; trains what is missing and goes on where it was stopped.

    Writes p_hat.md and p_hat.json. Their names also bear the model where only one was asked for,
    and schedule and first seed where these are not the usual one and 0:
    p_hat_tdanet_tenfold_from_seed3.md. The validation rooms need scans and LiDAR states.
    """

    episodes: int = 2_000
    """Of each seed."""
    model: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Only this model, given as often as needed."""
    schedule: Schedule = "usual"
    """Of training."""


def rows_of(model: ModelName, split: Split, schedule: Schedule) -> list[Row]:
    """Plain, then every way for p_hat to enter with every probability."""
    rows = [Row("p_hat", PLAIN, model, "plain", split, schedule=schedule)]
    rows += [
        Row("p_hat", name, model, method, split, p_hat=p_hat, against="plain", schedule=schedule,
            variant=variant)
        for name, method, variant in STUDIES[model, split]
        for p_hat in ASKED
    ]  # fmt: skip
    return rows


def run(study: PHatStudy, command: str) -> None:
    """Train, evaluate and write.

    Raises:
        ValueError: the grid has not trained what is compared, training failed, or a model is none
            of the study.
        SceneError: the scenes cannot be used, or lack what the LiDAR says.
    """
    if unknown := set(study.model) - {model for model, _ in STUDIES}:
        raise ValueError(
            f"found no study of {', '.join(sorted(unknown))}, expected "
            f"{' or '.join(model for model, _ in STUDIES)}"
        )
    studies = [of for of in STUDIES if not study.model or of[0] in study.model]
    rows = [row for of in studies for row in rows_of(*of, study.schedule)]
    made = replace(Made.read(study.grid), tests={})
    if not study.recorded:
        rooms = [f"{split}:validation" for _, split in studies]
        made = replace(made, tests={of: identity_of_rooms(study.scenes, of) for of in rooms})
    bench = Bench(study.places, study.episodes, study.every_seed, study.preset, made, command)
    if not study.recorded:
        _train_and_test(study, rows, bench)
    lines = [_line(row, bench) for row in rows]
    asked = [model for model, _ in studies] if len(studies) < len(STUDIES) else []
    schedule = [study.schedule] if study.schedule != "usual" else []
    later = [f"from_seed{study.first_seed}"] if study.first_seed else []
    name = "_".join(["p_hat", *asked, *schedule, *later])
    about = {"command": command, "schedule": study.schedule, "first_seed": study.first_seed,
             "seeds": study.seeds, "episodes": study.episodes}  # fmt: skip
    write_json(study.results / f"{name}.json", about | {"rows": lines})
    seeds = ", ".join(map(str, study.every_seed))
    page = f"{study.episodes:,} episodes of each training seed ({seeds}).\n\n"
    page += table(COLUMNS, lines)
    write_file(study.results / f"{name}.md", page)
    print(page)


def _train_and_test(study: PHatStudy, rows: Sequence[Row], bench: Bench) -> None:
    """Train the variants that are missing; what they are compared with is the grid's."""
    jobs = [job for job in bench.jobs(rows) if job.variant]
    sources = [job.stage1 for job in jobs if job.stage1]
    train = [Task(job, bench.places) for job in (*sources, *jobs)]
    if missing := [task for task in train if not task.result.exists()]:
        check_rooms(bench.places, dict.fromkeys(task.job.split for task in missing))
    with executor_of(study.jobs, study.ray) as executor:
        run_tasks([*dict.fromkeys(train), *bench.tests(rows)], executor)


def _line(row: Row, bench: Bench) -> dict[str, Any]:
    """Figures of a row: "over_plain", and "over_scalar", over ``SCALAR`` given the same p_hat."""
    found = bench.results(row)
    figures = measured(found)
    line = {
        "split": row.split, "model": NAMES[row.model], "variant": row.name,
        "p_hat": GIVEN.get(row.p_hat, "its own"), "commit": figures["commit"],
        "cf_sr_mean": figures["cf_sr_mean"], "cf_sr_std": figures["cf_sr_std"],
        "over_plain": None, "over_plain_ci95": None, "over_scalar": None, "over_scalar_ci95": None,
    }  # fmt: skip
    if row.reference:
        line |= compared("over_plain", found, bench.results(row.reference), bench.interval)
        if row.name != SCALAR[0]:
            scalar = bench.results(replace(row, method=SCALAR[1], variant=SCALAR[2]))
            line |= compared("over_scalar", found, scalar, bench.interval)
    return line


COLUMNS: dict[str, Cell] = {
    "data": lambda line: line["split"],
    "model": lambda line: line["model"],
    "p_hat enters": lambda line: line["variant"],
    "p_hat": lambda line: "" if line["variant"] == PLAIN else line["p_hat"],
    "CF-SR": lambda line: spread(line["cf_sr_mean"], line["cf_sr_std"]),
    "over plain [95 %]": lambda line: change(line["over_plain"], line["over_plain_ci95"]),
    "over one number [95 %]": lambda line: change(line["over_scalar"], line["over_scalar_ci95"]),
}


def main(study: PHatStudy) -> None:
    """Make the study and print its page."""
    run(study, command_line())


if __name__ == "__main__":
    sys.exit(run_options("p_hat_study", PHatStudy, main))
