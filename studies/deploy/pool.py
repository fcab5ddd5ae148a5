"""Work on several live graphs side by side, each in a process and a ROS domain of its own."""

from __future__ import annotations

import multiprocessing
import queue
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from cfnav_ros.process.graph_config import GraphConfig
from cfnav_ros.process.processes import GraphError
from cfnav_ros.ros.graph import RosGraph

from cfnav_core.command.interrupt import INTERRUPT
from studies.deploy.places import ROOM, StartPlaces, find_places
from studies.deploy.reactions import Part
from studies.deploy.rig import Rig

NO_ERRORS = Path(__file__).with_name("no_errors.yaml")
"""Of a detector that finds everything, so that there is something that can be wrong."""

ATTEMPTS = 3
"""Graphs that may fail a task before it is given up."""

Work = Callable[[Rig, StartPlaces, Any], tuple[dict[str, Any], bool]]
"""Does one task; returns its result, and whether the graph cannot be used any more."""


def results(
    work: Work, tasks: Sequence[Any], bundle: Path, logs: Path, graphs: int, part: Part = ""
) -> Iterator[dict[str, Any] | str]:
    """Do all tasks and yield each result as it comes, or a sentence for a task that failed.

    To each result is added how many ``attempts`` it took, and the sentences of the ``failures``.

    Args:
        work: function of a module, so that other processes can find it.
        tasks: anything that can be pickled.
        bundle: drives all graphs.
        logs: folder for the logs of their nodes.
        graphs: how many run side by side.
        part: what their robots have besides; a detector makes no errors of its own.

    Raises:
        GraphError: all graphs have ended.
    """
    context = multiprocessing.get_context("spawn")
    inbox, outbox = context.Queue(), context.Queue()
    workers = [
        context.Process(target=_worker, args=(work, (bundle, logs / str(n), part), inbox, outbox))
        for n in range(min(graphs, len(tasks)))
    ]
    for task in [*tasks, *(None for _ in workers)]:
        inbox.put(task)
    for worker in workers:
        worker.start()
    try:
        for _ in tasks:
            yield _next(outbox, workers, logs)
        for worker in workers:
            worker.join()
    finally:
        for worker in workers:
            if worker.is_alive():
                worker.terminate()
            worker.join()


def _next(outbox: Any, workers: Sequence[Any], logs: Path) -> dict[str, Any] | str:
    while True:
        INTERRUPT.check()
        try:
            return outbox.get(timeout=1.0)
        except queue.Empty:
            if not any(worker.is_alive() for worker in workers):
                raise GraphError(f"all graphs ended too early; see {logs}") from None


def _worker(work: Work, asked: tuple[Path, Path, Part], inbox: Any, outbox: Any) -> None:
    """Do tasks until there are no more; the main function of a process."""
    INTERRUPT.catch()
    lab = _Lab(*asked)
    try:
        for task in iter(inbox.get, None):
            outbox.put(lab.do(work, task))
    except KeyboardInterrupt:
        return
    finally:
        lab.close()


class _Lab:
    """One graph at a time, replaced when it has failed or was broken."""

    def __init__(self, bundle: Path, logs: Path, part: Part = "") -> None:
        self._bundle, self._logs, self._part = bundle, logs, part
        self._places = find_places()
        self._opened = 0
        self._rig: Rig | None = None

    def do(self, work: Work, task: Any) -> dict[str, Any] | str:
        """Do a task, on another graph if need be."""
        failures: list[str] = []
        while len(failures) < ATTEMPTS:
            try:
                result, broken = work(self._open(), self._places, task)
            except GraphError as error:
                failures.append(str(error))
                self.close()
                continue
            if broken:
                self.close()
            return {**result, "attempts": len(failures) + 1, "failures": failures}
        return failures[-1]

    def _open(self) -> Rig:
        if self._rig is None:
            self._opened += 1
            logs = self._logs / str(self._opened)
            config = GraphConfig(
                ROOM, logs, bundle=self._bundle, detector=str(NO_ERRORS),
                depth_down_deg=0.0 if self._part == "depth" else None,
            )  # fmt: skip
            self._rig = Rig(RosGraph(config).__enter__())
        return self._rig

    def close(self) -> None:
        """End the graph, if there is one."""
        if self._rig is not None:
            rig, self._rig = self._rig, None
            rig.graph.close(keep_bag=False)
