"""The fault matrix, measured: ``python -m tests.deploy.fault_matrix --out out/bench/faults.jsonl``.

Runs every cell of ``expectations`` on live graphs, several side by side in ROS domains of their
own, and writes a line for each run as soon as it ends; a second call goes on where it stopped.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import tyro
from cfnav_ros.demo import commit, run_to_exit
from cfnav_ros.graph import Graph, GraphConfig
from cfnav_ros.processes import GraphError
from cfnav_ros.stop_signal import INTERRUPT
from cfnav_ros.trials import read_rows
from tqdm import tqdm

from tests.deploy.bundles import make_bundle
from tests.deploy.cell import LISTS, CellRun
from tests.deploy.expectations import EXPECTATIONS, Expectation, Phase
from tests.deploy.places import ROOM, widest_place
from tests.deploy.rig import Rig

ATTEMPTS = 3
"""Graphs that may fail a run before it is given up."""


@dataclass(frozen=True)
class MatrixConfig:
    """Measure what the deployment does about each fault, in each phase of an episode."""

    out: Path = Path("out/bench/faults.jsonl")
    """File of the runs, one JSON line each; runs in it are not made again."""
    runs: int = field(default_factory=lambda: int(os.environ.get("RUNS", "5")))
    """Runs of each cell; the environment's RUNS when not given."""
    graphs: int = 3
    """Graphs side by side; about two thirds of a core each."""
    only: str = ""
    """Regular expression that the name of a fault must match."""
    phase: tuple[Phase, ...] = tuple(Phase)
    """Phases to measure."""

    @property
    def cells(self) -> list[Expectation]:
        """The cells that are asked for."""
        return [
            cell
            for cell in EXPECTATIONS
            if cell.phase in self.phase and re.search(self.only, cell.fault)
        ]


Task = tuple[int, int]
"""Index of a cell in EXPECTATIONS, number of the run."""


def missing(config: MatrixConfig, rows: list[dict[str, Any]]) -> list[Task]:
    """The runs that no line tells of, those that cost a graph its life last."""
    there = {(row["fault"], row["phase"], row["run"]) for row in rows}
    tasks = [
        (EXPECTATIONS.index(cell), run)
        for run in range(config.runs)
        for cell in config.cells
        if (cell.fault, cell.phase.value, run) not in there
    ]
    return sorted(tasks, key=lambda task: "sig" in EXPECTATIONS[task[0]].fault)


def measure(config: MatrixConfig) -> list[dict[str, Any]]:
    """Make the runs that are missing and return all.

    Raises:
        GraphError: some runs did not come about; those that did are written.
        OSError: the file cannot be read or written.
    """
    rows = read_rows(config.out)
    config.out.parent.mkdir(parents=True, exist_ok=True)
    # Rewritten first, as the next line must not continue one that was cut short.
    config.out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    tasks = missing(config, rows)
    if not tasks:
        return rows
    bundle = config.out.parent / "bundles" / "listed"
    if not bundle.exists():
        make_bundle(bundle, LISTS)
    failures = []
    version = commit()
    with (
        config.out.open("a") as file,
        _workers(config, tasks, bundle) as results,
        tqdm(total=len(tasks), desc="faults", unit="run", smoothing=0.05) as progress,
    ):
        for _ in tasks:
            row = results()
            progress.update()
            if isinstance(row, str):
                failures.append(row)
                progress.write(row)
                continue
            rows.append({**row, "commit": version})
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
    if failures:
        raise GraphError(f"{len(failures)} runs did not come about, such as: {failures[0]}")
    return rows


@contextmanager
def _workers(
    config: MatrixConfig, tasks: list[Task], bundle: Path
) -> Iterator[Callable[[], dict[str, Any] | str]]:
    """Processes that make the runs; yields a function that waits for the next result."""
    context = multiprocessing.get_context("spawn")
    inbox, outbox = context.Queue(), context.Queue()
    logs = config.out.parent / "logs"
    workers = [
        context.Process(target=work, args=(logs / str(n), bundle, inbox, outbox))
        for n in range(min(config.graphs, len(tasks)))
    ]
    for task in [*tasks, *(None for _ in workers)]:
        inbox.put(task)
    for worker in workers:
        worker.start()

    def next_result() -> dict[str, Any] | str:
        while True:
            try:
                return outbox.get(timeout=1.0)
            except multiprocessing.queues.Empty:
                INTERRUPT.check()
                if not any(worker.is_alive() for worker in workers):
                    raise GraphError(f"all graphs ended too early; see {logs}") from None

    try:
        yield next_result
        for worker in workers:
            worker.join()
    finally:
        for worker in workers:
            if worker.is_alive():
                worker.terminate()
            worker.join()


def work(logs: Path, bundle: Path, inbox: Any, outbox: Any) -> None:
    """Make runs on a graph until told to end; a process of its own."""
    INTERRUPT.catch()
    place = widest_place()
    graph: Graph | None = None
    opened = 0
    try:
        for index, number in iter(inbox.get, None):
            cell, failure = EXPECTATIONS[index], ""
            for _ in range(ATTEMPTS):
                try:
                    if graph is None:
                        opened += 1
                        config = GraphConfig(ROOM, logs / str(opened), bundle=bundle)
                        graph = Graph(config).__enter__()
                        rig = Rig(graph)
                    run = CellRun(rig, cell)
                    row = run.run(place, number)
                except GraphError as error:
                    failure = f"{cell.fault}, {cell.phase.value}, run {number}: {error}"
                    run_is_broken = True
                else:
                    failure, run_is_broken = "", run.broken
                    outbox.put(asdict(row))
                if run_is_broken and graph is not None:
                    graph.close(keep_bag=False)
                    graph = None
                if not failure:
                    break
            if failure:
                outbox.put(failure)
    except KeyboardInterrupt:
        return
    finally:
        if graph is not None:
            graph.close(keep_bag=False)


def main() -> None:
    """Run the command line: 0 when every run was made, 1 when not, 130 on Ctrl-C."""
    from tests.deploy.matrix_report import summarise, table

    config = tyro.cli(MatrixConfig, prog="fault_matrix")
    rows = run_to_exit("fault_matrix", lambda: measure(config))
    print(table(summarise(rows)))


if __name__ == "__main__":
    main()
