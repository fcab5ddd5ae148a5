"""The tasks of a grid in the process of the test: loading torch anew takes longer than they do."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from cfnav_core.benchmark import grid, p_hat_study, run, shift_study
from cfnav_core.benchmark.work import Task


class Inline:
    """An executor, see ``grid.Executor``, that returns from ``start`` when a task is done."""

    slots = 1

    def __init__(self, slots: int) -> None:
        """Side by side is one after the other here."""

    def start(self, task: Path, log: Path) -> None:
        Task.load(task).do()

    def poll(self, handle: None) -> int:
        return 0

    def stop(self, handles: Sequence[None]) -> None: ...

    def close(self) -> None: ...


@contextmanager
def in_this_process() -> Iterator[None]:
    """Grids and studies that are not on a cluster do their tasks here."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (run, p_hat_study, shift_study):
            patch.setattr(module, "Local", Inline)
        patch.setattr(grid, "POLL_S", 0)
        yield
