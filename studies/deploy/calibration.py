"""Is the LiDAR's collision probability right? ``python -m studies.deploy.calibration --n 20000``.

Random free poses in rooms never used for any setting; the scan as the simulated driver publishes
it, the estimate by the shipped code, then the MoveAhead really driven: a collision is a contact.
Poses near obstacles are over-sampled (``driven_moves.NEAR_M``), because elsewhere hardly anything
is uncertain; figures named plain are weighted back to a plain draw of poses.

What the error model owes to measurement is settled in the training rooms, never in the test rooms:
``python -m studies.deploy.calibration --seeds 0 19 --out out/training``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

import numpy as np
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.lidar.estimate import SweptDisc, estimate_collision
from cfnav_ros.lidar.sweep import NOMINAL
from sim_bridge.robot.rplidar import MODES, ScanMode

from cfnav_core.command import run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.task import calibration as rel
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.deploy import reliability
from studies.deploy.driven_moves import moves, plane_way, scan_of

FREE = 0.005
"""A motion that meets what the scanner's plane shows or hides with less chance is free by it."""


@dataclass(frozen=True)
class CalibrationConfig:
    """Compare predicted with driven collisions."""

    out: Path = Path("out/bench")
    """Folder of calibration.json and calibration.png."""
    n: int = 20_000
    """Motions to drive."""
    seeds: tuple[int, int] = (20, 29)
    """First and last seed of the rooms, of every type; 0 to 19 train, 20 to 29 test."""
    rest: float = 0.05
    """Share kept of the poses that are not near an obstacle."""
    noise: float = 1.0
    """Scale of the simulator's noise."""
    scan_mode: Literal["Sensitivity", "Standard"] = "Sensitivity"
    """Of the LiDAR: 8 kHz, as a TurtleBot 4's, or 2 kHz."""
    processes: int = 2


@dataclass(frozen=True)
class Predicted:
    """Predictions and outcomes, arrays of the same length.

    Attributes:
        p: probability.
        clearance: published, metres.
        plain: the geometric rule's answer, 0 or 1.
        collided: what happened.
        travelled: metres.
        weight: of each in a plain draw.
    """

    p: np.ndarray
    clearance: np.ndarray
    plain: np.ndarray
    collided: np.ndarray
    travelled: np.ndarray
    weight: np.ndarray


def drive_all(config: CalibrationConfig) -> Predicted:
    """Drive in all rooms, in several processes."""
    first, last = config.seeds
    rooms = [(kind, seed) for seed in range(first, last + 1) for kind in ROOM_TYPES]
    each = -(-config.n // len(rooms))
    mode = MODES[config.scan_mode]
    tasks = [(kind, seed, each, config.rest, config.noise, mode) for kind, seed in rooms]
    with get_context("spawn").Pool(config.processes) as pool:
        rows = [row for part in pool.imap(_room, tasks) for row in part]
    return Predicted(*(np.array(column) for column in zip(*rows[: config.n], strict=True)))


def _room(
    task: tuple[str, int, int, float, float, ScanMode],
) -> list[tuple[float, float, float, bool, float, float]]:
    disc, rows = SweptDisc(), []
    for move in moves(*task):
        scan = scan_of(move.ranges)
        estimate = estimate_collision(scan, disc)
        plain = float(plane_way(scan, disc) <= disc.step)
        rows.append((
            estimate.probability, estimate.clearance, plain, move.collided, move.travelled,
            move.weight,
        ))  # fmt: skip
    return rows


def free_by_plane(found: Predicted) -> tuple[np.ndarray, np.ndarray]:
    """Motions that are free as far as the plane shows: bool [N] far from, bool [N] beside what is.

    Their probability is the model's own share for what the plane cannot show, and hardly more.
    """
    more = [1 - (1 - found.p) / (1 - share) for share in (NOMINAL.unseen, NOMINAL.unseen_near)]
    far, beside = ((part > -1e-9) & (part < FREE) for part in more)
    return far, beside


def unseen_shares(found: Predicted) -> dict[str, list[float]]:
    """``ErrorModel.unseen`` and ``unseen_near`` as driven: share, collisions, motions of each."""
    counted = {}
    for name, free in zip(("unseen", "unseen_near"), free_by_plane(found), strict=True):
        collided, motions = int(found.collided[free].sum()), int(free.sum())
        counted[name] = [collided / motions if motions else float("nan"), collided, motions]
    return counted


def figures(found: Predicted) -> dict[str, float | int | list[float] | list[list[float]]]:
    """Everything that is reported; see ``cfnav_core.task.calibration`` for the measures.

    The veto misses a motion that collides when it does not forbid it, and gives a false alarm when
    it forbids one that would not.
    """
    p, y, ones = found.p, found.collided, np.ones(len(found.p))
    base, plain_base = float(y.mean()), float(np.average(y, weights=found.weight))
    brier, plain_brier = rel.brier(p, y, ones), rel.brier(p, y, found.weight)
    free = np.logical_or(*free_by_plane(found))
    apart, vetoed = ~y, p >= EpisodeLimits().veto_probability
    return {
        "n": len(p),
        "n_uncertain": int(((p > rel.LOW) & (p < rel.HIGH)).sum()),
        "base_rate": base,
        "ece": rel.calibration_error(p, y),
        "ece_interval": list(rel.error_interval(p, y)),
        "ece_by_chance": rel.chance_error(p),
        "ece_equal_count": rel.calibration_error(p, y, equal_count=True),
        "ece_equal_count_interval": list(rel.error_interval(p, y, equal_count=True)),
        "brier": brier,
        "brier_skill": 1 - brier / (base * (1 - base)),
        "auc": rel.auc(p, y),
        "auc_clearance": rel.auc(-found.clearance, y),
        "brier_geometric": rel.brier(found.plain, y, ones),
        "auc_geometric": rel.auc(found.plain, y),
        "plain_base_rate": plain_base,
        "plain_brier": plain_brier,
        "plain_brier_skill": 1 - plain_brier / (plain_base * (1 - plain_base)),
        "plain_auc": rel.auc(p, y, found.weight),
        "plain_auc_clearance": rel.auc(-found.clearance, y, found.weight),
        "plain_brier_geometric": rel.brier(found.plain, y, found.weight),
        "plain_auc_geometric": rel.auc(found.plain, y, found.weight),
        "veto_misses": float(1 - vetoed[y].mean()),
        "veto_false_alarms": float(vetoed[apart].mean()),
        "plain_veto_misses": float(1 - np.average(vetoed[y], weights=found.weight[y])),
        "plain_veto_false_alarms": float(np.average(vetoed[apart], weights=found.weight[apart])),
        "free_by_plane": int(free.sum()),
        "free_by_plane_collided": float(y[free].mean()),
        "free_by_plane_predicted": float(p[free].mean()),
        **unseen_shares(found),
        "travel_mean_m": float(found.travelled[apart].mean()),
        "travel_sd_m": float(found.travelled[apart].std()),
        "bins": [[b.predicted, b.observed, b.count] for b in rel.bins(p, y)],
    }


def measure(
    config: CalibrationConfig,
) -> dict[str, float | int | list[float] | list[list[float]]]:
    """Measure, write calibration.json and calibration.png into a folder, return the figures."""
    config.out.mkdir(parents=True, exist_ok=True)
    found = drive_all(config)
    result = figures(found)
    first, last = config.seeds
    title = (
        f"{len(found.p)} MoveAheads in rooms {first} to {last}\nECE {result['ece']:.3f} "
        f"of the {result['n_uncertain']} predicted between {rel.LOW:g} and {rel.HIGH:g}"
    )
    reliability.diagram(found.p, found.collided, title, config.out / "calibration.png")
    write_json(config.out / "calibration.json", result)
    return result


def main(config: CalibrationConfig) -> None:
    """Measure and print."""
    for name, value in measure(config).items():
        print(f"{name}: {value}")


if __name__ == "__main__":
    sys.exit(run_options("calibration", CalibrationConfig, main))
