"""Where motions end: ``python -m studies.deploy.motion_error --out out/bench``.

Drives random MoveAheads, RotateLefts and RotateRights over live graphs at real time and compares
the simulator's truth at rest before and after each. The error of a MoveAhead is the distance of its
true end from the point 0.25 m ahead of its true start along its true heading there; that of a turn
is the difference between the true angle turned and 45 degrees.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cfnav_ros.process.processes import GraphError
from tqdm import tqdm

from cfnav_core.command import run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.task.actions import STEP_M, TURN_RAD, Action
from cfnav_core.task.vocabulary import CATEGORIES
from studies.deploy.bundles import make_bundle
from studies.deploy.judge import TruthSample, rests
from studies.deploy.places import ROOM, StartPlaces, widest_place
from studies.deploy.pool import results
from studies.deploy.rig import Rig

PER_GOAL = 20
"""Motions of one episode."""

TURNS = {Action.RotateLeft: TURN_RAD, Action.RotateRight: -TURN_RAD}
PATIENCE_S = 10.0
"""Real seconds for one motion; its deadline is 5 s."""


@dataclass(frozen=True)
class MotionConfig:
    """Measure where the robot's motions truly end."""

    out: Path = Path("out/bench")
    """Folder of the results: motion_error.json and motion_error.png."""
    n: int = 500
    """Motions; rounded up to whole episodes of 20."""
    graphs: int = 3
    """Graphs side by side."""
    seed: int = 0
    """Draws the motions."""


def draw_actions(rng: np.random.Generator, reach: float) -> list[Action]:
    """Draw motions that stay within ``reach`` metres of the start; half of the draws MoveAheads."""
    x = y = yaw = 0.0
    actions: list[Action] = []
    while len(actions) < PER_GOAL:
        action = Action.MoveAhead if rng.random() < 0.5 else Action(rng.choice([*TURNS]))
        if action is Action.MoveAhead:
            ahead = x + STEP_M * math.cos(yaw), y + STEP_M * math.sin(yaw)
            if math.hypot(*ahead) > reach:
                continue
            x, y = ahead
        yaw += TURNS.get(action, 0.0)
        actions.append(action)
    return actions


def errors(truth: Sequence[TruthSample], actions: Sequence[Action]) -> list[dict[str, Any]]:
    """The error of each motion between two rests.

    Raises:
        GraphError: the truth tells of another number of motions.
    """
    stops = rests(truth)
    if len(stops) != len(actions) + 1:
        raise GraphError(f"{len(stops) - 1} motions were seen of {len(actions)}")
    found = []
    for before, after, action in zip(stops, stops[1:], actions, strict=False):
        turned = math.remainder(after.yaw - before.yaw, math.tau)
        row = {"action": action.name, "turn_deg": 0.0, "forward_cm": 0.0}
        if action is Action.MoveAhead:
            x = before.x + STEP_M * math.cos(before.yaw)
            y = before.y + STEP_M * math.sin(before.yaw)
            row["forward_cm"] = 100 * math.hypot(after.x - x, after.y - y)
        else:
            row["turn_deg"] = abs(math.degrees(math.remainder(turned - TURNS[action], math.tau)))
        found.append(row)
    return found


def drive(
    rig: Rig, places: StartPlaces, task: tuple[str, tuple[Action, ...], int]
) -> tuple[dict[str, Any], bool]:
    """Drive one list of actions from the middle of the free place.

    A drive that ends early, or whose motions cannot be told apart, is a result too: it comes back
    with a ``failure`` that says why, and without motions.
    """
    goal, actions, number = task
    place = places.open
    rig.prepare(ROOM, (place.x, place.y, number % 8 * TURN_RAD), number)
    result = rig.graph.send_goal(goal).get_result_async()
    if not rig.watch(result.done, PATIENCE_S * len(actions)):
        return {"motions": [], "failure": "the drive did not end"}, False
    ended = result.result().result
    if ended.outcome != "done":
        failure = f"the drive ended as {ended.outcome}: {ended.message}"
        return {"motions": [], "failure": failure}, False
    made = [a for a, decision in zip(actions, rig.decisions, strict=False) if not decision.vetoed]
    try:
        return {"motions": errors(rig.truth, made), "failure": ""}, False
    except GraphError as error:
        return {"motions": [], "failure": str(error)}, False


def figures(motions: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Mean and 95th percentile of each kind of error."""
    kinds = {"forward_cm": "MoveAhead", "turn_deg": "Rotate"}
    table = {}
    for name, action in kinds.items():
        values = [row[name] for row in motions if row["action"].startswith(action)]
        table[name] = {
            "mean": round(float(np.mean(values)), 3),
            "p95": round(float(np.percentile(values, 95)), 3),
            "max": round(max(values), 3),
            "n": len(values),
        }
    return table


def measure(config: MotionConfig) -> dict[str, Any]:
    """Drive, write the results and return the figures, with how many drives they leave out.

    Raises:
        GraphError: --n makes no sense, or graphs failed again and again.
    """
    rng = np.random.default_rng(config.seed)
    reach = widest_place().reach
    count = -(-config.n // PER_GOAL)
    if not 0 < count <= len(CATEGORIES):
        raise GraphError(f"--n is {config.n}, expected 1 to {PER_GOAL * len(CATEGORIES)}")
    lists = {goal: tuple(draw_actions(rng, reach)) for goal in CATEGORIES[:count]}
    listed = {goal: (*some, Action.Done) for goal, some in lists.items()}
    bundle = make_bundle(config.out / "bundles", listed)
    tasks = [(goal, some, number) for number, (goal, some) in enumerate(lists.items())]
    drives: list[dict[str, Any]] = []
    broken = []
    logs = config.out / "logs"
    for row in tqdm(results(drive, tasks, bundle, logs, config.graphs), total=count, unit="drive"):
        if isinstance(row, str):
            broken.append(row)
        else:
            drives.append(row)
    motions = [motion for row in drives for motion in row["motions"]]
    if broken or not motions:
        told = broken or [row["failure"] for row in drives]
        raise GraphError(f"{len(told)} of {count} drives failed, such as: {told[0]}")
    failures = [row["failure"] for row in drives if row["failure"]]
    found = {
        **figures(motions),
        "drives": {
            "n": count,
            "left_out": len(failures),
            "attempts": sum(row["attempts"] for row in drives),
        },
    }
    repeated = [sentence for row in drives for sentence in row["failures"]]
    write_json(
        config.out / "motion_error.json",
        {**found, "motions": motions, "failures": failures, "repeated": repeated},
    )
    draw(motions, config.out / "motion_error.png")
    return found


def draw(motions: Sequence[dict[str, Any]], path: Path) -> None:
    """Histograms of both kinds of error, with mean and 95th percentile."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    names = {
        "forward_cm": ("MoveAhead", "end of a MoveAhead off its target, cm"),
        "turn_deg": ("Rotate", "angle of a turn off 45 degrees, deg"),
    }
    found = figures(motions)
    for axis, (name, (action, label)) in zip(axes, names.items(), strict=True):
        values = [row[name] for row in motions if row["action"].startswith(action)]
        axis.hist(values, bins=30, color="#2a9d8f")
        for key, style in (("mean", "-"), ("p95", "--")):
            value = found[name][key]
            axis.axvline(value, color="#264653", linestyle=style, label=f"{key} {value:.2f}")
        axis.set(xlabel=label, ylabel="motions", title=f"{found[name]['n']} motions")
        axis.set_xlim(left=0)
        axis.legend()
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(config: MotionConfig) -> None:
    """Measure and print."""
    for name, values in measure(config).items():
        print(name, "  ".join(f"{key} {value:g}" for key, value in values.items()))


if __name__ == "__main__":
    sys.exit(run_options("motion_error", MotionConfig, main))
