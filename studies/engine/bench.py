"""``Bench``: a grid of trained runs, and the tests that rows need of them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from cfnav_core.scenes.scene import LIDAR
from studies.engine.episodes import RunTest
from studies.engine.jobs import GridFolders, Job, jobs_of
from studies.engine.presets import PRESETS, PresetName
from studies.engine.results import Figures, Results
from studies.engine.row import Row, Split
from studies.engine.stamps import Made
from studies.engine.statistics import interval
from studies.engine.work import Task


@dataclass(frozen=True)
class Bench:
    """What the rows were made with, see ``results.ResultSource``.

    Attributes:
        places: of the grid.
        episodes: folder of the frozen test episodes, or how many are drawn in validation rooms.
        seeds: of training. preset: of sizes and numbers. made: what tests are made of.
        command: that made the rows.
    """

    places: GridFolders
    episodes: Path | int
    seeds: range
    preset: PresetName
    made: Made
    command: str
    interval = staticmethod(interval)

    def job(self, row: Row, seed: int) -> Job:
        """A run of a row."""
        return Job.of_row(row, seed, self.preset, self.made.perception)

    def jobs(self, rows: Iterable[Row]) -> list[Job]:
        """The runs that rows need."""
        return jobs_of(rows, self.seeds, self.preset, self.made.perception)

    def test(self, row: Row) -> RunTest:
        """The test of a row.

        Raises:
            ValueError: it was not noted what it is made of.
        """
        if isinstance(self.episodes, int):
            rooms = f"{row.split}:validation"
            made_of = self.made.tests.get(rooms, "")
            return RunTest(row.p_hat, row.veto, None, self.episodes, made_of, rooms=rooms)
        key = f"{row.split} {LIDAR}" if row.reads_lidar else row.split
        of = self.made.tests.get(key)
        if of is None:
            raise ValueError(
                f"found no test of {key} in {self.places.out}; test it, without --recorded, first"
            )
        frozen, most = episodes_of(self.episodes, row.split), PRESETS[self.preset].test_episodes
        return RunTest(row.p_hat, row.veto, frozen, most, of, row.sample)

    def tests(self, rows: Iterable[Row]) -> list[Task]:
        """Every test that rows need, each once."""
        wanted = {
            Task(self.job(of, seed), self.places, self.test(of)): None
            for row in rows
            for of in (row, *row.compared)
            for seed in self.seeds
        }
        return list(wanted)

    def files(self, row: Row) -> list[Path]:
        """Files of a row's results by seed."""
        test = self.test(row)
        return [test.result(self.job(row, s).options(self.places).out) for s in self.seeds]

    def results(self, row: Row) -> Results:
        """What a row's policies did.

        Raises:
            ValueError: a run was not tested yet.
        """
        return Results.load(self.files(row))

    def about(self, row: Row) -> Figures:
        """How a row was made."""
        return {
            "split": row.split, "preset": self.preset, "command": self.command,
            "config_hash": self.job(row, self.seeds[0]).hash,
        }  # fmt: skip


def episodes_of(folder: Path, split: Split) -> Path:
    """The file of a split's frozen test episodes."""
    return folder / f"{split}_test.json"


@dataclass(frozen=True)
class GridOptions:
    """What every study of a trained grid is asked."""

    scenes: Path = Path("out/paper/rooms")
    """All built-in rooms as they look in training."""
    grid: Path = Path("out/paper/grid")
    """Folder of a grid (cfnav benchmark)."""
    results: Path = Path("out/paper/results")
    """Folder of the pages."""
    seeds: int = 5
    """Of each row."""
    first_seed: int = 0
    """The others follow it."""
    recorded: bool = False
    """Make pages of results that are there, without rooms and weights."""
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes side by side."""
    ray: str = ""
    """Address of a Ray cluster to use instead; local starts one here."""
    preset: PresetName = "small"
    """That of the grid."""

    @property
    def every_seed(self) -> range:
        """The training seeds."""
        return range(self.first_seed, self.first_seed + self.seeds)

    @property
    def places(self) -> GridFolders:
        """Of the grid."""
        return GridFolders(self.scenes.resolve(), self.grid.resolve())
