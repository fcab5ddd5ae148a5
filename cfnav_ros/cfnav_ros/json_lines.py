"""Results as JSON lines: one for each episode, so that a run goes on where it stopped. Pure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cfnav_core.whole import write_file


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Read the lines of an earlier run; a last line that was cut short does not count.

    Raises:
        OSError: a line before the last cannot be read.
    """
    lines = path.read_text().split("\n") if path.exists() else []
    rows = []
    for number, line in enumerate(lines, 1):
        if not line:
            continue
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            if number < len(lines):
                raise OSError(f"{path}: line {number} is damaged; remove it") from None
    return rows


def write_rows(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write all lines anew, as the next one must not continue one that was cut short.

    Raises:
        WriteError: the disk is full or refuses; what was there stays.
    """
    write_file(path, "".join(json.dumps(row) + "\n" for row in rows))


def append_row(path: Path, row: dict[str, Any]) -> None:
    """Add a line."""
    with path.open("a") as file:
        file.write(json.dumps(row) + "\n")
