"""The curves of a run: a line of log.jsonl for each validation, and the same for TensorBoard."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from torch.utils.tensorboard import SummaryWriter

from cfnav_core.files.json_lines import append_row, read_rows, write_rows
from cfnav_core.files.whole import writing
from cfnav_core.learn.run_files import LOG


class RunLog:
    """The curves in the folder of a run.

    Args:
        folder: of the run.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._path = folder, folder / LOG
        self._board: SummaryWriter | None = None

    def go_on_from(self, episodes: int) -> None:
        """Take lines out of what is trained again: a killed run wrote them.

        A last line that was cut short is one of them, and is told on standard error.

        Raises:
            OSError: lines before it are damaged; which stands in the message.
        """
        if not self._path.exists():
            return
        rows, written = read_rows(self._path, "episodes"), self._path.read_bytes()
        lines = written.split(b"\n")
        if len(rows) < sum(map(bool, lines)):
            print(
                f"found line {len(lines)} of {self._path}, the last one, cut short by a kill; it "
                "is left out, and its validation is made again",
                file=sys.stderr,
            )
        write_rows(self._path, [row for row in rows if row["episodes"] <= episodes])

    def add(self, figures: dict[str, Any]) -> None:
        """Append one line to log.jsonl, and the same numbers as TensorBoard scalars.

        Raises:
            WriteError: the disk is full or refuses.
        """
        with writing(self._path):
            append_row(self._path, figures)
        episodes = figures["episodes"]
        if self._board is None:
            # scalars of episodes that a killed run lost are hidden
            self._board = SummaryWriter(self._folder, purge_step=episodes)
        for name, value in figures.items():
            self._board.add_scalar(name, value, episodes)
        self._board.flush()
