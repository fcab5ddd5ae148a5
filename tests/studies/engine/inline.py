"""The tasks of a grid in the process of the test: loading torch anew takes longer than they do."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from studies.engine import grid
from studies.engine.work import Task


class Ended:
    """A task that was done when it was started, see ``grid.Process``."""

    def __init__(self, task: Path, log: Path) -> None:
        Task.load(task).do()

    def poll(self) -> int:
        return 0


@contextmanager
def in_this_process() -> Iterator[None]:
    """Grids and studies that are not on a cluster do their tasks here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grid, "start_process", Ended)
        patch.setattr(grid, "POLL_S", 0)
        yield
