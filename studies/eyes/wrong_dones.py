"""What a policy knew when it said Done: ``python -m studies.eyes.wrong_dones POLICY``.

Of policies that read sightings, in scenes that ``cfnav rooms boxes`` made. A Done may be wrong
since the goal was never sighted and the policy gave up, since it was sighted before and is not in
view where it was expected, or since what is sighted is further away than it is taken to be.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from cfnav_core.command import run_options
from cfnav_core.learn.evaluate import Evaluation, evaluate
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.actions import Action
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.visibility import VISIBLE_DISTANCE_M
from studies.engine.pages import Cell, table

NEVER, BEFORE = "never sighted", "sighted before, not now"
NEAR = f"sighted now, by its distance within {VISIBLE_DISTANCE_M:g} m"
FAR = "sighted now, further or nobody knows"

COLUMNS: dict[str, Cell] = {
    "the goal is": lambda row: row["known"],
    "Dones": lambda row: f"{row['dones']:,}",
    "right": lambda row: f"{row['right']:.2f}" if row["dones"] else "",
    "share of the wrong": lambda row: f"{row['of_wrong']:.2f}",
}


@dataclass(frozen=True)
class WrongDonesOptions:
    """Tell apart what was known of the goal when Done was said."""

    policy: Annotated[Path, tyro.conf.Positional]
    """A bundle, or a checkpoint such as best.safetensors."""
    scenes: Path
    """Folder of scenes (cfnav rooms boxes)."""
    rooms: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """TYPE:SEED, TYPE:FIRST-LAST or a split, given as often as needed; all when absent."""
    episodes: int = 4000
    """Frozen episodes."""
    seed: int = 0
    """Draws starts and goals."""
    p_hat: str = "lidar"
    """As for cfnav evaluate."""


def rows(found: Evaluation) -> list[dict[str, Any]]:
    """Dones by what was known, how many of them were right, and their share of the wrong ones.

    Raises:
        SceneError: scenes whose detections are no sightings.
    """
    scenes = found.bank.scenes
    if others := [s.name for s in scenes if s.fields != SIGHTINGS]:
        raise SceneError(
            f"found {others[0]} without sightings, expected them; make it with cfnav rooms boxes"
        )
    sure, far = (
        np.concatenate([s.detections[:, :, SIGHTINGS.index(field)] for s in scenes])
        for field in ("confidence", "distance")
    )
    goals = found.episodes.goals
    ever, known = np.zeros(len(goals), bool), np.full(len(goals), "", object)
    for step in found.trace:
        its = goals[step.episodes]
        now = sure[step.states, its] > 0
        ever[step.episodes] |= now
        near = (far[step.states, its] > 0) & (far[step.states, its] <= VISIBLE_DISTANCE_M)
        unseen = np.where(ever[step.episodes], BEFORE, NEVER)
        said = step.actions == Action.Done
        known[step.episodes[said]] = np.where(now, np.where(near, NEAR, FAR), unseen)[said]
    right = np.array([result.success for result in found.results])
    wrong = (known != "") & ~right
    return [
        {
            "known": kind,
            "dones": int((known == kind).sum()),
            "right": float(right[known == kind].mean()) if (known == kind).any() else None,
            "of_wrong": float((wrong & (known == kind)).sum() / max(wrong.sum(), 1)),
        }
        for kind in (NEVER, BEFORE, FAR, NEAR)
    ]


def main(options: WrongDonesOptions) -> None:
    """Judge and print.

    Raises:
        ValueError: policy, scenes or rooms that cannot be used.
    """
    found = evaluate(
        options.policy, options.scenes, options.episodes, options.seed, p_hat=options.p_hat,
        rooms=options.rooms,
    )  # fmt: skip
    print(table(COLUMNS, rows(found)))
    print(f"{found.wrong_done:.3f} of {len(found.results):,} episodes end with a wrong Done")


if __name__ == "__main__":
    sys.exit(run_options("wrong_dones", WrongDonesOptions, main))
