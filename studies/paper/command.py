"""``cfnav benchmark``: the paper's tables on the built-in rooms, from nothing to figures."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from cfnav_core.command import command_line
from studies.engine.presets import PresetName

TableName = Literal["I", "II", "III", "own", "tenfold"]


@dataclass(frozen=True)
class Benchmark:
    """Make the paper's tables: train what is missing, test it, put the paper's rows beside (torch).

    For example: cfnav benchmark I II III --seeds 2

    Run it again to go on after a kill. Test rooms are looked at when every run is trained.
    """

    tables: Annotated[tuple[TableName, ...], tyro.conf.Positional] = ("I", "II", "III", "own")
    """Tables of the paper, rows of our own, and what ten times as many episodes make of TDANet and
    L-sTDE."""
    scenes: Path = Path("out/paper/rooms")
    """All built-in rooms (cfnav rooms make --out out/paper/rooms)."""
    out: Path = Path("out/paper/grid")
    """Folder of the runs and the results."""
    results: Path | None = None
    """Folder of the summary, the tables and the figures; the grid's when absent."""
    seeds: int = 5
    """Of each row."""
    preset: PresetName = "small"
    """Sizes and numbers: small for two cores, full as published, tiny to try the grid itself."""
    model: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Only rows of this model, given as often as needed."""
    train_only: bool = False
    """Leave the test rooms alone."""
    recorded: bool = False
    """Make tables and curves of results that are there, without rooms and weights."""
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Tasks side by side on this machine."""
    ray: str = ""
    """Address of a Ray cluster to use instead; local starts one here."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where runs live; auto takes a GPU when there is one."""
    precision: Literal["highest", "high", "medium"] = "highest"
    """Of multiplications, see cfnav train."""
    episodes: Path = Path("docs/episodes")
    """Folder of the frozen test episodes, data1_test.json and data2_test.json."""

    def run_command(self) -> None:
        """Train, test, write and print.

        Raises:
            ValueError: there is no such row, or tasks failed; one sentence.
        """
        # a robot has no torch, so it is imported only here
        from studies.paper.run import run_benchmark

        run_benchmark(self, command_line())
