"""What a policy knew when it said Done: ``python -m studies.eyes.wrong_dones POLICY``.

A Done may be wrong since the goal was never detected and the policy gave up, since it was detected
before and is not in view where it was expected, or since what is detected is no goal, or further
away than it is taken to be. Where the goal then is tells these apart.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfnav_core.command import run_options
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Evaluation, evaluate
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.actions import Action
from cfnav_core.task.detections import (
    DETECTED_ABOVE,
    SCORES,
    SIGHTINGS,
    columns,
    confidence_column,
)
from cfnav_core.task.visibility import VISIBLE_DISTANCE_M
from studies.engine.pages import Cell, table
from studies.engine.policy_in_scenes import PolicyInScenes

NEVER, BEFORE = "never detected", "detected before, not now"
NEAR = f"detected now, and taken to be within {VISIBLE_DISTANCE_M:g} m"
FAR = "detected now, further or nobody knows"

BEYOND_M = 2.5
"""A goal whose middle is further away than this is another thing than what was taken for it."""


def _share(name: str) -> Cell:
    return lambda row: "" if row[name] is None else f"{row[name]:.2f}"


COLUMNS: dict[str, Cell] = {
    "the goal is": lambda row: row["known"],
    "Dones": lambda row: f"{row['dones']:,}",
    "right": _share("right"),
    "share of the wrong": _share("of_wrong"),
    "of these the goal is visible there in another direction": _share("turned"),
    f"further than {BEYOND_M:g} m": _share("beyond"),
}


@dataclass(frozen=True)
class WrongDonesOptions(PolicyInScenes):
    """Tell apart what was known of the goal when Done was said."""

    p_hat: str = "own"
    """As for cfnav evaluate."""


def _detected(bank: SceneBank) -> tuple[np.ndarray, np.ndarray]:
    """Whether each object is detected in each state, and taken to be near: bool [S, C] each.

    Raises:
        SceneError: scenes whose detections say nothing of near.
    """
    fields = bank.inputs.fields
    if fields not in (SCORES, SIGHTINGS):
        raise SceneError(
            f"found {bank.names[0]} with detections of {', '.join(fields) or 'nothing'}, expected "
            "such as say what is near; make scenes with cfnav rooms make or cfnav rooms boxes"
        )
    at, sure = columns(fields), confidence_column(fields)

    def of(column: int) -> np.ndarray:
        return np.concatenate([s.detections[:, :, column] for s in bank.scenes])

    if fields == SCORES:
        near = of(at["near"].start) > DETECTED_ABOVE["score"]
        return (of(sure) > DETECTED_ABOVE["score"]) | near, near
    far = of(at["distance"].start)
    return of(sure) > DETECTED_ABOVE["confidence"], (far > 0) & (far <= VISIBLE_DISTANCE_M)


def rows(found: Evaluation) -> list[dict[str, Any]]:
    """Dones by what was known: how many were right, and of the wrong where the goal was.

    Raises:
        SceneError: scenes whose detections say nothing of near.
    """
    bank, goals = found.bank, found.episodes.goals
    detected, close = _detected(bank)
    ever, known = np.zeros(len(goals), bool), np.full(len(goals), "", object)
    metres, around = np.full(len(goals), np.inf), np.zeros(len(goals), bool)
    places = bank.place.cpu().numpy()
    visible = np.zeros((places.max() + 1, len(bank.objects)), bool)
    np.logical_or.at(visible, places, bank.visible)
    for step in found.trace:
        its = goals[step.episodes]
        now, near = detected[step.states, its], close[step.states, its]
        ever[step.episodes] |= now
        unseen = np.where(ever[step.episodes], BEFORE, NEVER)
        said = step.actions == Action.Done
        known[step.episodes[said]] = np.where(now, np.where(near, NEAR, FAR), unseen)[said]
        place = places[step.states[said]]
        metres[step.episodes[said]] = bank.distance[place, its[said]].cpu().numpy()
        around[step.episodes[said]] = visible[place, its[said]]
    wrong = (known != "") & ~np.array([result.success for result in found.results])
    kinds = (NEVER, BEFORE, FAR, NEAR)
    return [_row(kind, known == kind, wrong, around, metres) for kind in kinds]


def _row(
    kind: str, its: np.ndarray, wrong: np.ndarray, around: np.ndarray, metres: np.ndarray
) -> dict[str, Any]:
    def share(part: np.ndarray, whole: np.ndarray) -> float | None:
        return float(part[whole].mean()) if whole.any() else None

    return {
        "known": kind,
        "dones": int(its.sum()),
        "right": share(~wrong, its),
        "of_wrong": share(its, wrong),
        "turned": share(around, its & wrong),
        "beyond": share(metres > BEYOND_M, its & wrong),
    }


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
