"""Judge every episode of a recorded bag: ``python -m cfnav_ros.bag_eval BAG [--json FILE]``.

Needs no ROS. What counts is written in ``outcome.py``; the figures over episodes are those of
``cfnav_core.metrics``, with path lengths in metres.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import tyro

from cfnav_core import metrics
from cfnav_core.json_file import write_json
from cfnav_ros.bag_reader import BagError, read_events
from cfnav_ros.outcome import Episode, Outcome, split_episodes


def evaluate_bag(bag: Path) -> tuple[Episode, ...]:
    """Read a bag and judge its episodes.

    Raises:
        BagError: the bag cannot be read, or lacks what an outcome needs.
    """
    try:
        return split_episodes(read_events(bag))
    except ValueError as error:
        raise BagError(f"{bag}: {error}") from None


def figures(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Return ``sr``, ``spl``, ``cf_sr``, ``cf_spl`` over episodes, path lengths in metres.

    Source: Eq. 1 and Section V of the paper, see ``cfnav_core.metrics``.
    """
    results = [
        metrics.EpisodeResult(
            success=o.success,
            collisions=o.collisions,
            path_length=o.path_length_m,
            shortest_path_length=o.shortest_path_m,
        )
        for o in outcomes
    ]
    names = ("sr", "spl", "cf_sr", "cf_spl")
    return {name: float(getattr(metrics, name)(results)) for name in names}


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the episodes as lines of text for a terminal."""
    head = ("room", "goal", "outcome", "reached", "touched", "steps", "m")
    lines = ["{:<16}{:<15}{:<12}{:<9}{:<9}{:>6}{:>8}".format(*head)]
    for o in outcomes:
        reached = "yes" if o.success else "no"
        lines.append(
            f"{o.room:<16}{o.goal:<15}{o.outcome:<12}{reached:<9}{o.collisions:<9}{o.steps:>6}"
            f"{o.path_length_m:>8.2f}"
        )
    return "\n".join(lines)


def evaluate(
    bag: Annotated[Path, tyro.conf.Positional],
    json_file: Annotated[Path | None, tyro.conf.arg(name="json")] = None,
) -> None:
    """Judge every episode of a recorded bag.

    Args:
        bag: folder of the bag, or its .mcap file.
        json_file: where the figures are written too, for programs.
    """
    outcomes = [episode.outcome for episode in evaluate_bag(bag)]
    result = figures(outcomes)
    print(table(outcomes))
    print("  ".join(f"{name} {value:.3f}" for name, value in result.items()))
    if json_file:
        rows = [asdict(outcome) for outcome in outcomes]
        write_json(json_file, {"episodes": rows, **result})


def main() -> None:
    """Run the command line; a bag that cannot be judged ends it with one sentence and code 2."""
    try:
        tyro.cli(evaluate, prog="bag_eval")
    except BagError as error:
        print(f"bag_eval: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
