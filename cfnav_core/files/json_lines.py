"""Results as JSON lines: one for each episode, so that a run goes on where it stopped. Pure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cfnav_core.files.whole import write_file


def read_rows(path: Path, key: str = "") -> list[dict[str, Any]]:
    """Read the lines of an earlier run; a last line that was cut short does not count.

    Args:
        path: the file, or where it will be.
        key: what every line holds.

    Raises:
        OSError: lines before the last cannot be read; the message says how many and which.
    """
    *ended, last = path.read_bytes().split(b"\n") if path.exists() else [b""]
    found = {number: _row(line, key) for number, line in enumerate(ended, 1) if line}
    if damaged := [str(number) for number, row in found.items() if row is None]:
        raise OSError(
            f"found {len(damaged)} of {len(found)} lines of {path} damaged (line "
            f"{', '.join(damaged)}); remove them, or move the file away, and run the same command "
            "again"
        )
    return [row for row in (*found.values(), _row(last, key)) if row is not None]


def _row(line: bytes, key: str) -> dict[str, Any] | None:
    """What a line holds, None where it is damaged."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    return row if isinstance(row, dict) and (not key or key in row) else None


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
