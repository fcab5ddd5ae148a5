"""Work on many scenes in several processes, results in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import TypeVar

from cfnav_core.scenes.scene import SceneError

T = TypeVar("T")
R = TypeVar("R")


def in_order(
    function: Callable[[T], R], items: Sequence[T], processes: int
) -> Generator[tuple[T, R]]:
    """Apply a function to every item; never much further ahead than the results are taken.

    Args:
        function: may be sent to another process; so may items and results.
        items: in the order of the results.
        processes: one works in this process.

    Raises:
        SceneError: a process was killed. What the function raises comes through.
    """
    if processes <= 1:
        yield from ((item, function(item)) for item in items)
        return
    waiting: deque[tuple[T, Future[R]]] = deque()
    # forked children would share open HDF5 files
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        try:
            for item in items:
                waiting.append((item, pool.submit(function, item)))
                if len(waiting) > processes:
                    done, future = waiting.popleft()
                    yield done, future.result()
            while waiting:
                done, future = waiting.popleft()
                yield done, future.result()
        except BrokenProcessPool as error:
            raise SceneError(
                "found a process killed at work, often for want of memory; use fewer --processes"
            ) from error
        finally:
            pool.shutdown(cancel_futures=True)
