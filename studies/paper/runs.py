"""What the training of every run took and reached: ``runs.csv`` beside the tables."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import Any

from cfnav_core.files.whole import write_file
from cfnav_core.learn.run_files import LOG
from studies.engine.jobs import GridFolders, Job
from studies.engine.work import DONE

RUNS = "runs.csv"

COLUMNS = (
    # name of its folder, preset of sizes and numbers, what was trained
    "run", "preset", "split", "model", "method", "seed", "config_hash", "commit",
    # that it trained, with the stage one that it goes on from; seconds are of its own part,
    # validations included
    "episodes", "steps", "cpu_s",
    # of training, over its last episodes; of the checkpoint, the best of stage two
    "sr", "cf_sr", "validation_cf_sr",
)  # fmt: skip


def trained(job: Job, places: GridFolders) -> dict[str, Any]:
    """What a run left beside its weights, under the names in ``COLUMNS``.

    Raises:
        ValueError: the run was not made, or what it left is not there.
    """
    folder = job.options(places).out
    for file in (LOG, DONE):
        if not (folder / file).exists():
            raise ValueError(
                f"found no {file} in {folder}; unpack the archive of seed {job.seed} again, "
                "or train the run without --recorded"
            )
    last = json.loads((folder / LOG).read_text().splitlines()[-1])
    done = json.loads((folder / DONE).read_text())
    about = (job.name, job.preset, job.split, job.model, job.method, job.seed, job.hash)
    reached = (last["sr"], last["cf_sr"], done["validation_cf_sr"])
    took = (last["episodes"], last["steps"], round(last["cpu_s"]))
    values = (*about, done["commit"], *took, *(round(rate, 4) for rate in reached))
    return dict(zip(COLUMNS, values, strict=True))


def write_runs(found: Sequence[Mapping[str, Any]], of_paper: Container[str], out: Path) -> None:
    """Write a line for each run beside those of other runs, and print what these took.

    A run takes the place of one of the same preset and title with another configuration.

    Args:
        found: the runs.
        of_paper: hashes of those that the paper's tables need.
        out: folder that gets the file.

    Raises:
        ValueError: those that are there cannot be read.
        WriteError: it cannot be written.
    """
    path = out / RUNS
    kept = read_runs(path) if path.exists() else []
    made = {(run["preset"], without_hash(run["run"])) for run in found}
    rows = [row for row in kept if (row["preset"], without_hash(row["run"])) not in made]
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows([*rows, *found])
    write_file(path, text.getvalue())
    of_tables = [run for run in found if run["config_hash"] in of_paper]
    said = f"{len(found)} runs took {_hours(found):.1f} processor hours of training"
    if of_tables:
        said += f", the {len(of_tables)} of the paper's tables {_hours(of_tables):.1f}"
    print(f"{said} ({path})\n")


def read_runs(path: Path) -> list[dict[str, str]]:
    """The lines of a ``runs.csv``.

    Raises:
        OSError: it is not there.
        ValueError: it is of another version.
    """
    lines = list(csv.DictReader(path.read_text().splitlines()))
    if lines and set(lines[0]) != set(COLUMNS):
        raise ValueError(
            f"found {path} of another version of cfnav, with other columns; remove it and make "
            "the tables again"
        )
    return lines


def without_hash(run: str) -> str:
    """A run's name but for the hash of its configuration."""
    return run.rpartition("_")[0]


def _hours(runs: Sequence[Mapping[str, Any]]) -> float:
    return sum(run["cpu_s"] for run in runs) / 3600
