"""The fault matrix, measured: ``python -m studies.deploy.fault_matrix --out faults.jsonl``.

Runs every cell of ``expectations`` on live graphs, several side by side in ROS domains of their
own, and writes a line for each run as soon as it ends; a second call goes on where it stopped. Runs
that were judged by other terms than today's are made again.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from cfnav_ros.process.processes import GraphError
from tqdm import tqdm

from cfnav_core.command import run_options
from cfnav_core.files.json_lines import append_row, read_rows, write_rows
from cfnav_core.files.provenance import commit
from studies.deploy.bundles import make_bundle
from studies.deploy.cell import LISTS, CellRun
from studies.deploy.expectations import EXPECTATIONS
from studies.deploy.judge import JUDGE
from studies.deploy.matrix_report import summarise, table
from studies.deploy.places import StartPlaces
from studies.deploy.pool import results
from studies.deploy.reactions import PARTS, Expectation, FaultPhase
from studies.deploy.rig import Rig


@dataclass(frozen=True)
class MatrixConfig:
    """Measure what the deployment does about each fault, in each phase of an episode."""

    out: Path = Path("out/bench/faults.jsonl")
    """File of the runs, one JSON line each; runs in it are not made again."""
    runs: int = field(default_factory=lambda: int(os.environ.get("RUNS", "5")))
    """Runs of each cell; the environment's RUNS when not given."""
    graphs: int = 3
    """Graphs side by side."""
    only: str = ""
    """Regular expression that the name of a fault must match."""
    phase: tuple[FaultPhase, ...] = tuple(FaultPhase)
    """Phases to measure."""

    @property
    def cells(self) -> list[Expectation]:
        """The cells that are asked for."""
        asked = re.compile(self.only)
        return [c for c in EXPECTATIONS if c.phase in self.phase and asked.search(c.fault)]


Task = tuple[int, int]
"""Index of a cell in EXPECTATIONS, number of the run."""


def missing(config: MatrixConfig, rows: Sequence[dict[str, Any]]) -> list[Task]:
    """The runs that no line tells of; those that cost a graph its life come last."""
    there = {(row["fault"], row["phase"], row["run"]) for row in rows}
    tasks = [
        (EXPECTATIONS.index(cell), run)
        for run in range(config.runs)
        for cell in config.cells
        if (cell.fault, cell.phase.value, run) not in there
    ]
    return sorted(tasks, key=lambda task: "_sig" in EXPECTATIONS[task[0]].fault)


def today(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows that were judged by the terms of today's table and judge."""
    terms = {(cell.fault, cell.phase.value): cell.terms for cell in EXPECTATIONS}
    return [
        row
        for row in rows
        if row.get("terms", ()) == terms.get((row["fault"], row["phase"]))
        and row.get("judge") == JUDGE
    ]


def run_task(rig: Rig, places: StartPlaces, task: Task) -> tuple[dict[str, Any], bool]:
    """Make one run of one cell.

    Raises:
        GraphError: it did not come about.
    """
    run = CellRun(rig, EXPECTATIONS[task[0]])
    return asdict(run.run(places, task[1])), run.broken


def made(tasks: Sequence[Task], config: MatrixConfig) -> Iterator[dict[str, Any] | str]:
    """See ``results``; robots have what some cells need in those only, which come last."""
    folder = config.out.parent
    for part in ("", *PARTS.values()):
        bundle = make_bundle(folder / "bundles", LISTS, part == "detector")
        of = [task for task in tasks if EXPECTATIONS[task[0]].part == part]
        yield from results(
            run_task, of, bundle, folder / f"logs_{part}".rstrip("_"), config.graphs, part
        )


def measure(config: MatrixConfig) -> list[dict[str, Any]]:
    """Make the runs that are missing and return all that were asked for.

    Raises:
        GraphError: some runs did not come about; those that did are written.
        OSError: the file cannot be read or written.
    """
    rows = today(read_rows(config.out))
    write_rows(config.out, rows)
    tasks = missing(config, rows)
    failures, version = [], commit()
    with tqdm(total=len(tasks), unit="run") as progress:
        for row in made(tasks, config):
            progress.update()
            if isinstance(row, str):
                failures.append(row)
                progress.write(row)
                continue
            rows.append({**row, "judge": JUDGE, "commit": version})
            append_row(config.out, rows[-1])
    if failures:
        raise GraphError(f"{len(failures)} runs did not come about, such as: {failures[0]}")
    asked = {(cell.fault, cell.phase.value) for cell in config.cells}
    return [row for row in rows if (row["fault"], row["phase"]) in asked]


def main(config: MatrixConfig) -> None:
    """Measure and print."""
    print(table(summarise(measure(config))))


if __name__ == "__main__":
    sys.exit(run_options("fault_matrix", MatrixConfig, main))
