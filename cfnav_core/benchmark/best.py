"""Which run of each model is shipped: ``python -m cfnav_core.benchmark.best RESULTS``."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from cfnav_core.benchmark.runs import RUNS

OURS = ("ours", "listening")
"""Methods of ``runs.csv`` that are ours, whatever their schedule."""


def best_runs(rows: Iterable[Mapping[str, str]]) -> list[tuple[Mapping[str, str], str]]:
    """Of ours of each model the run with the highest CF-SR in validation rooms.

    Args:
        rows: of ``runs.csv``.

    Returns:
        For each model, by name: its row, and the folder's name of the plain run of the same split,
        seed and schedule. Of equal ones the first by the folder's name.

    Raises:
        ValueError: there is no such plain run.
    """
    rows = sorted(rows, key=lambda row: row["run"])
    plain = {_without_hash(row["run"]): row["run"] for row in rows if row["method"] == "plain"}
    best: dict[str, Mapping[str, str]] = {}
    for row in rows:
        if row["method"] not in OURS:
            continue
        first = best.setdefault(row["model"], row)
        if float(row["validation_cf_sr"]) > float(first["validation_cf_sr"]):
            best[row["model"]] = row
    found = []
    for _, row in sorted(best.items()):
        beside = _without_hash(row["run"]).replace("_ours_listening_", "_ours_")
        beside = beside.replace("_ours_", "_plain_")
        if beside not in plain:
            raise ValueError(
                f"found no run {beside}_* beside {row['run']}; train plain of the same seed too"
            )
        found.append((row, plain[beside]))
    return found


def _without_hash(run: str) -> str:
    return run.rpartition("_")[0]


def main() -> int:
    """Print model, split, run and plain run of each model, a line each."""
    path = Path(sys.argv[1]) / RUNS
    try:
        found = best_runs(csv.DictReader(path.read_text().splitlines()))
    except (OSError, ValueError) as error:
        print(f"best: {error}", file=sys.stderr)
        return 2
    for row, plain in found:
        print(row["model"], row["split"], row["run"], plain)
    return 0


if __name__ == "__main__":
    sys.exit(main())
