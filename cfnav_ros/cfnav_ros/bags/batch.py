"""Many bags side by side: one process a bag, one bar of progress. Knows no ROS."""

from __future__ import annotations

import multiprocessing
import queue
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import replace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from cfnav_ros.bags.evaluation import BagEvaluation, JudgeOptions, evaluate
from cfnav_ros.bags.files.decode import WITH_EVENTS
from cfnav_ros.bags.files.finding import unique_names
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.judge.episodes_file import EpisodeRow, rows_by_bag

LOOK_S = 0.2
"""Between looks at how far the processes are."""


def evaluate_all(
    options: Mapping[Path, JudgeOptions], rows: Sequence[EpisodeRow], jobs: int
) -> list[BagEvaluation | str]:
    """Evaluate bags, with a bar of progress; one that goes wrong leaves the others whole.

    Args:
        options: of each of the bags that ``find_bags`` gives.
        rows: of the episodes file; each bag takes its own.
        jobs: processes; 1 works in this one.

    Returns:
        In the order of the bags; of one that could not be evaluated a sentence that says why.

    Raises:
        EpisodesError: a row of the episodes file fits no bag, or several; nothing was evaluated.
    """
    bags = [*options]
    mine = rows_by_bag(rows, bags)
    each = [
        (bag, replace(options[bag], rows=mine[bag]), name)
        for bag, name in zip(bags, unique_names(bags), strict=True)
    ]
    with tqdm(total=_events(options) or None, unit="event") as bar:
        bar.unit_scale = True
        if min(jobs, len(bags)) <= 1:
            return [_attempt(bar.update, *task) for task in each]
        return _side_by_side(each, min(jobs, len(bags)), bar.update)


def _side_by_side(
    each: Sequence[tuple[Path, JudgeOptions, str]], jobs: int, advance: Callable[[int], Any]
) -> list[BagEvaluation | str]:
    # spawned, as a fork would take over the threads of an inference session half-way
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, ProcessPoolExecutor(jobs, context) as pool:
        progress = manager.Queue()
        futures = [pool.submit(_attempt, progress.put, *task) for task in each]
        running: set[Future] = set(futures)
        while running:
            _, running = wait(running, LOOK_S, FIRST_COMPLETED)
            _take(progress, advance)
        return [_result(future, *task) for future, task in zip(futures, each, strict=True)]


def _take(progress: Any, advance: Callable[[int], Any]) -> None:
    while True:
        try:
            advance(progress.get_nowait())
        except queue.Empty:
            return


def _result(future: Future, bag: Path, *_: Any) -> BagEvaluation | str:
    error = future.exception()
    if error is None:
        return future.result()
    return f"{bag} could not be evaluated: its process ended ({error})."


def _attempt(
    tick: Callable[[int], Any], bag: Path, options: JudgeOptions, name: str
) -> BagEvaluation | str:
    try:
        return evaluate(bag, options, tick, name)
    except (ValueError, OSError, MemoryError) as error:
        return f"{bag} could not be evaluated: {error}"


def _events(options: Mapping[Path, JudgeOptions]) -> int:
    """How many messages will be read, as far as the bags know; 0 when one does not."""
    total = 0
    for path, asked in options.items():
        with Bag(path) as bag:
            roles = asked.assigned(bag.topics)
            counts = [roles.topics[role].count for role in WITH_EVENTS if role in roles.topics]
        if any(count is None for count in counts):
            return 0
        total += sum(count for count in counts if count)
    return total
