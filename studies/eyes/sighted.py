"""What a detector leaves of the goals to find: ``python -m studies.eyes.sighted SCENES``.

Of scenes that ``cfnav rooms boxes`` made: in how many of the states where Done would be a success a
goal is sighted, and in how many of those where it is sighted Done would be one. No policy that
reads sightings can do better than these allow, but by luck or memory.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from cfnav_core.command import run_options
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.scenes.select import open_scenes
from cfnav_core.task.detections import SIGHTINGS, columns


@dataclass(frozen=True)
class SightedOptions:
    """Count sightings of goals."""

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of scenes (cfnav rooms boxes)."""
    rooms: Annotated[list[str], tyro.conf.UseAppendAction] = field(default_factory=list)
    """TYPE:SEED, TYPE:FIRST-LAST or a split, given as often as needed; all when absent."""


@dataclass(frozen=True)
class Sighted:
    """Of one goal, over all rooms that offer it.

    Attributes:
        rooms: that offer it.
        visible: states in which Done is a success.
        sighted: states in which it is sighted, wherever.
        both: states of both kinds.
    """

    rooms: int
    visible: int
    sighted: int
    both: int


def sightings_of_goals(scenes: Sequence[OfflineScene]) -> dict[str, Sighted]:
    """Count, goal by goal.

    Raises:
        SceneError: scenes whose detections are no sightings.
    """
    counts: dict[str, list[tuple[int, int, int, int]]] = defaultdict(list)
    for scene in scenes:
        if scene.fields != SIGHTINGS:
            raise SceneError(
                f"found {scene.name} with {', '.join(scene.fields) or 'no fields'}, expected "
                "sightings; make them with cfnav rooms boxes"
            )
        confidence = scene.detections[:, :, columns(scene.fields)["confidence"].start]
        for goal in scene.goals:
            row = scene.objects.index(goal)
            visible, sighted = np.asarray(scene.visible[:, row], bool), confidence[:, row] > 0
            counts[goal].append((1, visible.sum(), sighted.sum(), (visible & sighted).sum()))
    return {goal: Sighted(*map(int, np.sum(of, 0))) for goal, of in sorted(counts.items())}


def table(found: dict[str, Sighted]) -> str:
    """As Markdown, what is found best first."""
    lines = [
        "| goal | rooms | sighted of the states where it is visible | visible of those where it is "
        "sighted |",
        "|---|---|---|---|",
    ]
    for goal, of in sorted(found.items(), key=lambda item: -item[1].both / item[1].visible):
        right = f"{of.both / of.sighted:.2f}" if of.sighted else "never sighted"
        lines.append(f"| {goal} | {of.rooms} | {of.both / of.visible:.2f} | {right} |")
    return "\n".join(lines)


def main(options: SightedOptions) -> None:
    """Count and print.

    Raises:
        SceneError: there are no such scenes.
    """
    print(table(sightings_of_goals(open_scenes(options.scenes, options.rooms))))


if __name__ == "__main__":
    sys.exit(run_options("sighted", SightedOptions, main))
