"""Figures of trials over the live graph: ``python -m studies.live.live_results OURS [PLAIN]``.

Reads the JSON lines that ``studies.live.trials`` wrote. Two files are compared on the episodes that
both hold.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from cfnav_ros.live.plan import Trial

from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.json_lines import read_rows
from cfnav_core.task.intervals import ends_text
from cfnav_core.task.metrics import EpisodeResult, figures, paired, paired_text
from studies.live.drive import by_trial
from studies.live.trials import CONDITIONS, conditions_of

COMPARED = tuple(name for name in CONDITIONS if name not in ("bundle", "networks"))
"""Conditions under which two bundles can be compared."""


@dataclass(frozen=True)
class LiveResultOptions:
    """Turn trials over the live graph into figures."""

    trials: Annotated[Path, tyro.conf.Positional]
    """File of python -m studies.live.trials."""
    against: Annotated[Path | None, tyro.conf.Positional] = None
    """A second one, compared on the same episodes."""
    json: Path | None = None
    """Also write the figures here; cfnav export --live puts them into a bundle."""


def live_results(trials: Path, against: Path | None = None) -> dict[str, Any]:
    """Return the figures of one file, or of the episodes that two files share.

    ``spl`` and ``cf_spl`` are taken in metres; intervals are 95 % over rooms. With two files
    ``against`` holds the second one's figures and ``paired`` the difference of CF-SR.

    Raises:
        OSError: a file cannot be read.
        ValueError: a file is empty or mixes conditions, or the two share no episode or condition.
    """
    first = _by_trial(trials)
    if against is None:
        return _summary(trials, first, list(first))
    second = _by_trial(against)
    ways = [_conditions(*one) for one in ((trials, first), (against, second))]
    if any(ways[0][name] != ways[1][name] for name in COMPARED):
        raise ValueError(
            f"found {trials} run with {ways[0]}, but {against} with {ways[1]}; run both alike"
        )
    shared = [trial for trial in first if trial in second]
    if not shared:
        raise ValueError(f"found no episode in both {trials} and {against}; run both with one seed")
    ours, plain = (np.array([r[t]["cf_success"] for t in shared]) for r in (first, second))
    return {
        **_summary(trials, first, shared),
        "against": _summary(against, second, shared),
        "paired": paired(ours, plain, np.array([t.room for t in shared])),
    }


def _by_trial(path: Path) -> dict[Trial, dict[str, Any]]:
    rows = by_trial(read_rows(path))
    if not rows:
        raise ValueError(
            f"found no episodes in {path}; run python -m studies.live.trials --out {path}"
        )
    return rows


def _conditions(path: Path, rows: dict[Trial, dict[str, Any]]) -> dict[str, Any]:
    """What holds for every episode of a file."""
    found = [conditions_of(row) for row in rows.values()]
    if any(other != found[0] for other in found):
        raise ValueError(f"found episodes run in different ways in {path}; keep one way a file")
    return found[0]


def _summary(path: Path, rows: dict[Trial, dict[str, Any]], trials: list[Trial]) -> dict[str, Any]:
    chosen = [rows[t] for t in trials]
    results = [
        EpisodeResult(r["success"], r["collisions"], r["path_length_m"], r["shortest_path_m"])
        for r in chosen
    ]
    return {
        "bundle": chosen[0]["bundle"],
        "commits": sorted({r["commit"] for r in chosen}),
        **_conditions(path, rows),
        **figures(results, np.array([t.room for t in trials])),
        "steps_per_episode": float(np.mean([r["steps"] for r in chosen])),
        "outcomes": {
            name: sum(r["outcome"] == name for r in chosen)
            for name in sorted({r["outcome"] for r in chosen})
        },
        "rooms": sorted({t.room for t in trials}),
    }


def main(options: LiveResultOptions) -> None:
    """Work out, print and write."""
    content = live_results(options.trials, options.against)
    for f in (content, content.get("against")):
        if f:
            print(
                f"{f['bundle']}: {f['episodes']} episodes  SR {f['sr']:.3f}  "
                f"CF-SR {f['cf_sr']:.3f} {ends_text(f['cf_sr_interval'])}  "
                f"CF-SPL {f['cf_spl']:.3f}  collisions {f['collisions_per_episode']:.2f}"
            )
    if "paired" in content:
        print(f"CF-SR difference {paired_text(content['paired'])}")
    if options.json is not None:
        write_json(options.json, {"command": command_line(), **content})


if __name__ == "__main__":
    sys.exit(run_options("live_results", LiveResultOptions, main))
