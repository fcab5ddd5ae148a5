"""Many bags side by side: one process a bag, one bar of progress. Knows no ROS."""

from __future__ import annotations

import multiprocessing
import queue
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from cfnav_ros.bags.decode import WITH_EVENTS
from cfnav_ros.bags.episodes_file import rows_by_bag
from cfnav_ros.bags.evaluation import Evaluation, Options, evaluate
from cfnav_ros.bags.reading import Bag, unique_names
from cfnav_ros.bags.roles import assign

LOOK_S = 0.2
"""Between looks at how far the processes are."""


@dataclass(frozen=True)
class Failed:
    """A bag that could not be evaluated at all; ``reason`` is one sentence."""

    name: str
    reason: str


@dataclass(frozen=True)
class _Task:
    bag: Path
    name: str
    options: Options


def evaluate_all(
    bags: Sequence[Path], options: Options, jobs: int, show: bool = True
) -> list[Evaluation | Failed]:
    """Evaluate bags; one that goes wrong leaves the others whole.

    Args:
        bags: those that ``find_bags`` gives.
        options: for all of them; each takes its own rows of the episodes file.
        jobs: processes; 1 works in this one.
        show: a bar of progress on the terminal.

    Returns:
        In the order of the bags.

    Raises:
        EpisodesError: a row of the episodes file fits no bag, or several; nothing was evaluated.
    """
    rows = rows_by_bag(options.rows, bags)
    each = [
        _Task(bag, name, replace(options, rows=rows[bag]))
        for bag, name in zip(bags, unique_names(bags), strict=True)
    ]
    with tqdm(total=_events(bags, options) or None, unit="event", disable=not show) as bar:
        bar.unit_scale = True
        if min(jobs, len(bags)) <= 1:
            return [_attempt(task, bar.update) for task in each]
        return _side_by_side(each, min(jobs, len(bags)), bar.update)


def _side_by_side(
    each: Sequence[_Task], jobs: int, advance: Callable[[int], Any]
) -> list[Evaluation | Failed]:
    # spawned, as a fork would take over the threads of an inference session half-way
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, ProcessPoolExecutor(jobs, context) as pool:
        progress = manager.Queue()
        futures = [pool.submit(_attempt, task, progress.put) for task in each]
        running: set[Future] = set(futures)
        while running:
            _, running = wait(running, LOOK_S, FIRST_COMPLETED)
            _take(progress, advance)
        return [_result(future, task) for future, task in zip(futures, each, strict=True)]


def _take(progress: Any, advance: Callable[[int], Any]) -> None:
    while True:
        try:
            advance(progress.get_nowait())
        except queue.Empty:
            return


def _result(future: Future, task: _Task) -> Evaluation | Failed:
    error = future.exception()
    if error is None:
        return future.result()
    return Failed(task.name, f"{task.bag} could not be evaluated: its process ended ({error}).")


def _attempt(task: _Task, tick: Callable[[int], Any]) -> Evaluation | Failed:
    try:
        return evaluate(task.bag, task.options, tick, task.name)
    except (ValueError, OSError, MemoryError) as error:
        return Failed(task.name, f"{task.bag} could not be evaluated: {error}")


def _events(bags: Sequence[Path], options: Options) -> int:
    """How many messages will be read, as far as the bags know; 0 when one does not."""
    total = 0
    for path in bags:
        with Bag(path) as bag:
            roles = assign(bag.topics, options.topics)
            counts = [roles.topics[role].count for role in WITH_EVENTS if role in roles.topics]
        if any(count is None for count in counts):
            return 0
        total += sum(count for count in counts if count)
    return total
