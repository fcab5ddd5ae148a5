"""Which run of each model is shipped: ``python -m studies.paper.best``.

It is of the configuration of ours that reached the highest CF-SR in validation rooms, its seeds
averaged. Of its runs it is the best one whose weights are in the grid, with those of plain beside
it: results that were unpacked have none.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from cfnav_core.command import run_options
from cfnav_core.learn.run_files import BEST
from studies.engine.presets import PresetName
from studies.paper.runs import RUNS, read_runs, without_hash

Line = Mapping[str, str]
"""A line of ``runs.csv``."""


def best_runs(lines: Iterable[Line], here: Container[str]) -> list[tuple[Line, str]]:
    """Of each model the run that is shipped.

    Args:
        lines: of ``runs.csv``.
        here: folders of the runs whose weights are at hand.

    Returns:
        For each model, by name: its line, and the folder of the plain run of the same split, seed
        and schedule; "" where no pair of both is at hand. Of equal ones the first by name.
    """
    lines = sorted(lines, key=lambda line: line["run"])
    plain = {without_hash(line["run"]): line["run"] for line in lines if line["method"] == "plain"}
    kinds: dict[str, dict[str, list[Line]]] = {}
    for line in lines:
        if line["method"] == "ours":
            of_model = kinds.setdefault(line["model"], {})
            of_model.setdefault(_without_seed(line["run"]), []).append(line)
    found = []
    for _, of_model in sorted(kinds.items()):
        runs = max(of_model.values(), key=lambda of: mean(map(_reached, of)))
        beside = {line["run"]: plain.get(_plain_beside(line["run"]), "") for line in runs}
        pairs = [line for line in runs if line["run"] in here and beside[line["run"]] in here]
        best = max(pairs or runs, key=_reached)
        found.append((best, beside[best["run"]] if pairs else ""))
    return found


def _reached(line: Line) -> float:
    return float(line["validation_cf_sr"])


def _plain_beside(run: str) -> str:
    """Name, without its hash, of the plain run that a run of ours is compared with."""
    return without_hash(run).replace("_ours_", "_plain_")


def _without_seed(run: str) -> str:
    return re.sub(r"_seed\d+$", "", without_hash(run))


@dataclass(frozen=True)
class Best:
    """Print model, split, run and plain run of each model, a line each.

    Models of which no pair is at hand are named on stderr.
    """

    results: Path = Path("out/paper/results")
    """Folder with runs.csv (cfnav benchmark)."""
    grid: Path = Path("out/paper/grid")
    """Folder of the runs with their weights."""
    preset: PresetName = "small"
    """Of the runs."""


def main(options: Best) -> None:
    """See ``Best``."""
    grid = options.grid
    here = {path.parent.name for path in grid.glob(f"runs/*/{BEST}")}
    lines = read_runs(options.results / RUNS)
    found = best_runs([line for line in lines if line["preset"] == options.preset], here)
    for line, plain in found:
        if plain:
            print(line["model"], line["split"], line["run"], plain)
        else:
            print(
                f"best: found no weights of {_without_seed(line['run'])}_seed* and of plain beside "
                f"it in {grid}; train one seed of both to ship {line['model']}",
                file=sys.stderr,
            )


if __name__ == "__main__":
    sys.exit(run_options("best", Best, main))
