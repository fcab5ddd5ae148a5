"""Do live account and bag agree? ``python -m studies.bags.agreement --out drives.jsonl``.

Seeded episodes over live graphs in lock-step, recorded, and judged again from the bag alone, in
rooms that neither training nor the rules of the judging have seen. Half of them are driven by the
shipped bundle, half by one that answers listed actions whatever it sees, so that many touch.

Two things are measured. Plumbing: the outcome from the simulator's topics in the bag is that of
the simulator's own account. Truth: collisions and success as judged only from topics that a real
robot has, beside the simulator's truth. Goes on where it stopped.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cfnav_ros.bags.evaluation import EvaluatedDrive, JudgeOptions, evaluate
from cfnav_ros.bags.judge.contacts import OBSERVABLE
from cfnav_ros.bags.judge.outcomes import live_outcome
from cfnav_ros.bags.replay.step import reproduction
from cfnav_ros.drive.outcome import Outcome, agree
from cfnav_ros.live.demo import DemoConfig, known_goals, run_trials
from cfnav_ros.live.plan import Trial
from cfnav_ros.process.graph_config import GraphConfig
from cfnav_ros.ros.graph import RosGraph
from tqdm import tqdm

from cfnav_core.command import run_options
from cfnav_core.files.json_lines import read_rows, write_rows
from cfnav_core.files.provenance import commit
from cfnav_core.policy.bundle import BundleHead, shipped_bundle
from cfnav_core.task.actions import Action
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.deploy.bundles import make_bundle
from studies.live.identities import identity_of

A_BAG = 4
"""Episodes of one bag, one in a room of each type: it is judged and removed before the next, as
pictures take gigabytes."""

FIRST_ROOM, ROOMS = 20, 10

BLIND_STEPS = 40


@dataclass(frozen=True)
class AgreementConfig:
    """Compare bags with what really happened."""

    out: Path = Path("out/bench/drives.jsonl")
    """One JSON line for each episode."""
    bags: int = 25
    """Of four episodes each; the two drivers take turns."""
    seed: int = 0
    """Draws goals, starts and the listed actions."""


def blind_bundle(folder: Path, seed: int) -> Path:
    """A bundle that drives listed actions, mostly ahead, and says Done at the end."""
    rng = np.random.default_rng(seed)
    moves = [Action.MoveAhead, Action.RotateLeft, Action.RotateRight]
    goals = BundleHead.load(shipped_bundle()).goals
    lists = {
        goal: [Action(a) for a in rng.choice(moves, BLIND_STEPS, p=[0.7, 0.15, 0.15])]
        + [Action.Done]
        for goal in goals
    }
    return make_bundle(folder, lists)


def measure(config: AgreementConfig) -> dict[str, Any]:
    """Run what is missing and sum everything up."""
    rows = read_rows(config.out)
    own = {"seed": config.seed, "networks": identity_of(shipped_bundle())}
    for row in rows:
        if (found := {key: row.get(key) for key in own}) != own:
            raise OSError(f"{config.out} holds drives of {found}, not {own}; choose another --out")
    made = {row["number"] for row in rows}
    blind = blind_bundle(config.out.parent / "bundles", config.seed)
    for number in tqdm(range(config.bags), unit="bag"):
        if number not in made:
            driven = judged(config, number, None if number % 2 == 0 else blind)
            rows += [own | row for row in driven]
            write_rows(config.out, rows)
    return summary(rows)


def judged(config: AgreementConfig, number: int, bundle: Path | None) -> list[dict[str, Any]]:
    """Drive and record some episodes, judge their bag, remove it."""
    folder = config.out.parent / "drives"
    shutil.rmtree(folder, ignore_errors=True)
    rooms = [f"{kind}:{FIRST_ROOM + number // 2 % ROOMS}" for kind in ROOM_TYPES]
    demo = DemoConfig(
        room=",".join(rooms), seed=config.seed + number, episodes=A_BAG, bundle=bundle, speed=0.0
    )
    graph = GraphConfig(
        room=rooms[0], logs=folder / "logs", speed=0.0, bundle=bundle, veto=False,
        bag=folder / "bag", lock_step=True,
    )  # fmt: skip
    live: list[tuple[Trial, Outcome]] = []
    with RosGraph(graph) as running:
        run_trials(running, demo, known_goals(demo), lambda *run: live.append(run))
    driver = "blind" if bundle else "shipped"
    found = evaluate(folder / "bag", JudgeOptions(bundles={driver: str(bundle or "")}))
    rows = [
        {"number": number, **_row(driver, trial, outcome, drive)}
        for (trial, outcome), drive in zip(live, found.drives, strict=True)
    ]
    shutil.rmtree(folder)
    return rows


def _row(driver: str, trial: Trial, live: Outcome, found: EvaluatedDrive) -> dict[str, Any]:
    bag = live_outcome(found.drive)
    own = reproduction(found.steps)
    return {
        "driver": driver,
        "trial": asdict(trial),
        "commit": commit(),
        "live": asdict(live),
        "bag": asdict(bag) if bag else None,
        "equal": bag is not None and agree(live, bag),
        "collisions_by": dict(found.outcome.collisions_by),
        "observed_collisions": found.outcome.collisions_by.get(OBSERVABLE),
        "observed_success": found.outcome.success_by.get(OBSERVABLE),
        "decisions": len(found.drive.decisions),
        "reproduced": own.equal,
        "compared": own.decisions,
        "notes": list(found.drive.notes),
    }


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Both measurements, and the bundles' own decisions."""
    decisions = sum(row["decisions"] for row in rows)
    return {
        "agreement": {"episodes": len(rows), "equal": sum(row["equal"] for row in rows)},
        "observable": {
            **_confusion(
                [(row["live"]["collisions"] > 0, row["observed_collisions"]) for row in rows]
            ),
            "success": _confusion(
                [(row["live"]["success"], row["observed_success"]) for row in rows]
            ),
            "collisions_true": sum(row["live"]["collisions"] for row in rows),
            "collisions_observed": sum(row["observed_collisions"] or 0 for row in rows),
        },
        "own_decisions_reproduced": {
            "decisions": decisions,
            "reproduced": sum(row["reproduced"] for row in rows),
            "not_compared": decisions - sum(row["compared"] for row in rows),
        },
        "commits": sorted({row["commit"] for row in rows}),
    }


def _confusion(pairs: Sequence[tuple[bool, Any]]) -> dict[str, int]:
    told = [(true, bool(seen)) for true, seen in pairs if seen is not None]
    return {
        "tp": sum(true and seen for true, seen in told),
        "fp": sum(seen and not true for true, seen in told),
        "fn": sum(true and not seen for true, seen in told),
        "tn": sum(not true and not seen for true, seen in told),
        "untold": len(pairs) - len(told),
    }


def main(config: AgreementConfig) -> None:
    """Measure and print."""
    print(json.dumps(measure(config), indent=1))


if __name__ == "__main__":
    sys.exit(run_options("agreement", AgreementConfig, main))
