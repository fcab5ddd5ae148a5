"""Table IV over the live graph: ``python -m studies.live.trials table-iv``.

The paper drove a TurtleBot 4 through three rooms. Here the mock drives through three furnished
rooms in which nothing was trained, chosen or tested before, by another light and through another
lens than in training (``sim_bridge.world.visual_shift``), with its noise; the LiDAR gives p_hat
and has no veto, as in the paper. Rows of our own follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from cfnav_core.files.json_lines import read_rows
from cfnav_core.files.whole import write_file
from cfnav_core.task.p_hat import recorded
from studies.engine.results import Figures, Results, figures_of
from studies.engine.row import Row, Schedule
from studies.engine.statistics import interval_of_trials
from studies.live.drive import TrialDrive, by_trial
from studies.live.identities import WORLD
from studies.live.table_iv_rows import (
    GOALS,
    PAPERS,
    PLACES,
    ROWS,
    SOURCES,
    TRIALS,
    key_of,
    trials_of,
)
from studies.paper.summary import write_tables

Trials = list[dict[str, Any]]
"""What was driven, as ``drive`` writes it, in the order of ``trials_of``."""


@dataclass(frozen=True)
class TableIV:
    """Drive Table IV: 15 trials a method as in the paper, or more over several training seeds."""

    bundles: Path = Path("out/paper/bundles")
    """Folder of bundles METHOD_seedN, or METHOD_SCHEDULE_seedN where it is not the usual one: of
    plain, reward_only, stage_only, ours and truth."""
    schedule: Schedule = "usual"
    """How long the policies were trained; tenfold: with ten times as many episodes in stage two."""
    trials: int = TRIALS
    """Of each row."""
    seeds: int = 1
    """Training seeds that share the trials."""
    first_seed: int = 0
    """The others follow it."""
    rows: Literal["paper", "sources", "main", "all"] = "all"
    """The paper's; or plain, and ours with the LiDAR's, RGB's and the larger p_hat; or the paper's,
    the method Truth, and ours with RGB, zero, an earlier p_hat or the truth for the LiDAR's; or
    also drawn actions, the larger of LiDAR and RGB, veto, no visual shift."""
    only: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Only these rows, by the method's name, given as often as needed; writes no table."""
    recorded: bool = False
    """Drive nothing; rows that were not driven are left out."""
    out: Path = Path("out/paper/trials")
    """Folder of what was driven; episodes in it are not driven again."""
    results: Path | None = None
    """Folder of the tables and figures; that of what was driven when absent."""
    speed: float = 0.0
    """Simulated seconds per second; 0 is as fast as the machine can."""
    domain: Annotated[int | None, tyro.conf.arg(metavar="ID")] = None
    """ROS domain; one that is free when not given."""

    @property
    def every_seed(self) -> range:
        """The training seeds."""
        return range(self.first_seed, self.first_seed + self.seeds)

    @property
    def each(self) -> int:
        """Trials of a training seed."""
        return self.trials // self.seeds

    def words(self, before: str, seed: str) -> str:
        """What is not usual about the trials, in names.

        Args:
            before: each word. seed: before the first seed.
        """
        schedule = "" if self.schedule == "usual" else f"{before}{self.schedule}"
        return schedule + (f"{before}{seed}{self.first_seed}" if self.first_seed else "")

    def drive(self, row: Row, seed: int) -> TrialDrive:
        """The trials of a row and a training seed."""
        schedule = "" if self.schedule == "usual" else f"_{self.schedule}"
        return TrialDrive(
            row, seed, self.schedule, self.bundles / f"{row.method}{schedule}_seed{seed}",
            recorded(self.out / f"{key_of(row)}{schedule}_seed{seed}_{self.each}.jsonl"), self.each,
        )  # fmt: skip


def run(config: TableIV, command: str) -> None:
    """Drive what is missing; then write and print the table and draw its figure.

    Args:
        config: of the command line.
        command: as it was given, for the results.

    Raises:
        BundleError: a bundle cannot be used.
        GraphError: the graph did not run.
        ValueError: trials that the seeds cannot share.
        OSError: results cannot be read or written.
    """
    if config.trials % config.seeds:
        raise ValueError(
            f"found {config.trials} trials for {config.seeds} seeds; expected a multiple"
        )
    rows = ROWS[config.rows]
    if unknown := set(config.only) - {row.method for row in rows}:
        raise ValueError(f"found no row of {', '.join(sorted(unknown))} in Table IV")
    asked = [row for row in rows if not config.only or row.method in config.only]
    drives = [config.drive(row, seed) for row in asked for seed in config.every_seed]
    if config.recorded:
        there = {drive.row for drive in drives if drive.file.exists()}
        rows = tuple(row for row in rows if row in there)
    else:
        for drive in [drive for drive in drives if drive.missing()]:
            drive.run(config.speed, config.domain)
    if not config.only:
        _write(config, rows, command)


def _write(config: TableIV, rows: Sequence[Row], command: str) -> None:
    """Write and print the table and draw the paths of the first trial of each goal."""
    # matplotlib is slow to import
    from studies.live.table_iv_plot import draw_table_iv

    driven = Driven(config, command, {row: _driven(config, row) for row in rows})
    worlds = {t["world"] for of in driven.trials.values() for trials in of for t in trials}
    if len(worlds) > 1:
        raise OSError(
            f"found trials in {len(worlds)} versions of the simulator in {config.out}, which "
            f"do not compare; remove those whose world is not {WORLD}"
        )
    results = config.results or config.out
    write_tables([figures_of(row, driven, rows) for row in rows], results)
    # of the last seed; the first goal in the first room, the second in the second, and so on
    shown = SOURCES if config.rows == "sources" else PAPERS
    first = {row.name: driven.trials[row][-1][: 3 * len(GOALS) : 4] for row in shown}
    trained = "" if config.schedule == "usual" else f", trained {config.schedule}"
    title = f"One trial of each goal by training seed {config.every_seed[-1]}{trained}"
    picture = draw_table_iv(first, config.out / "maps", PLACES, title)
    of = f"{config.trials}{'_sources' if shown is SOURCES else ''}{config.words('_', 'from_seed')}"
    write_file(results / f"table_IV_{of}.png", picture)


def _driven(config: TableIV, row: Row) -> list[Trials]:
    """The trials of each seed, so that those of two rows are pairs.

    Raises:
        OSError: some were not driven.
    """
    driven = []
    for seed in config.every_seed:
        file = config.drive(row, seed).file
        found, asked = by_trial(read_rows(file)), trials_of(config.each, seed)
        if missing := len(set(asked) - found.keys()):
            raise OSError(
                f"found {missing} trials missing in {file}; drive them, without --recorded"
            )
        driven.append([found[trial] for trial in asked])
    return driven


@dataclass(frozen=True)
class Driven:
    """The trials of rows, see ``results.ResultSource``.

    Attributes:
        config: of the table. command: that made it. trials: of each seed.
    """

    config: TableIV
    command: str
    trials: Mapping[Row, Sequence[Trials]]

    @staticmethod
    def interval(difference: np.ndarray, rooms: np.ndarray) -> tuple[float, float] | None:
        """Trials that all ended alike say nothing of how far others may differ."""
        return interval_of_trials(difference, rooms) if difference.any() else None

    def results(self, row: Row) -> Results | None:
        """What was driven; None for a row that is not in this table."""
        of = {key_of(known): trials for known, trials in self.trials.items()}.get(key_of(row))
        if of is None:
            return None

        def each(name: str) -> np.ndarray:
            return np.array([[trial[name] for trial in trials] for trials in of])

        return Results(
            each("success"), each("collisions"), each("path_length_m"), each("shortest_path_m"),
            rooms=each("room")[0], aborted=each("outcome") == "aborted",
            commits=frozenset(trials[0]["run"]["commit"] for trials in of),
            tested_at=frozenset(trial["commit"] for trials in of for trial in trials),
        )  # fmt: skip

    def about(self, row: Row) -> Figures:
        """How a row was made."""
        run = self.trials[row][0][0]["run"]
        return {
            "split": f"{self.config.trials} live trials{self.config.words(', ', 'from seed ')}",
            "preset": run["preset"], "command": self.command, "config_hash": run["config_hash"],
        }  # fmt: skip
