"""What the training of every run took and reached: ``runs.csv`` beside the tables."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Container, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from cfnav_core.benchmark.jobs import Job, Places
from cfnav_core.benchmark.work import DONE
from cfnav_core.run_files import LOG
from cfnav_core.whole import write_file

RUNS = "runs.csv"


@dataclass(frozen=True)
class Trained:
    """One run.

    Attributes:
        run: name of its folder. preset: of sizes and numbers.
        config_hash: of its configuration. commit: of the code.
        episodes, steps: that it trained, with the stage one that it goes on from.
        cpu_s: processor seconds of its own part, validations included.
        sr, cf_sr: of training, over its last episodes.
        validation_cf_sr: of the checkpoint, the best of stage two.
    """

    run: str
    preset: str
    split: str
    model: str
    method: str
    seed: int
    config_hash: str
    commit: str
    episodes: int
    steps: int
    cpu_s: float
    sr: float
    cf_sr: float
    validation_cf_sr: float

    @classmethod
    def read(cls, job: Job, places: Places) -> Trained:
        """From what a run left beside its weights.

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
        return cls(
            job.name, job.preset, job.split, job.model, job.method, job.seed, job.hash,
            done["commit"],
            last["episodes"], last["steps"], round(last["cpu_s"]),
            round(last["sr"], 4), round(last["cf_sr"], 4), round(done["validation_cf_sr"], 4),
        )  # fmt: skip


def write_runs(found: Sequence[Trained], of_paper: Container[str], out: Path) -> None:
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
    made = {(run.preset, without_hash(run.run)) for run in found}
    rows = [row for row in kept if (row["preset"], without_hash(row["run"])) not in made]
    rows += map(asdict, found)
    text = io.StringIO()
    table = csv.DictWriter(text, list(asdict(found[0])), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write_file(path, text.getvalue())
    of_tables = [run for run in found if run.config_hash in of_paper]
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
    if lines and set(lines[0]) != {spec.name for spec in fields(Trained)}:
        raise ValueError(
            f"found {path} of another version of cfnav, with other columns; remove it and make "
            "the tables again"
        )
    return lines


def without_hash(run: str) -> str:
    """A run's name but for the hash of its configuration."""
    return run.rpartition("_")[0]


def _hours(runs: Sequence[Trained]) -> float:
    return sum(run.cpu_s for run in runs) / 3600
