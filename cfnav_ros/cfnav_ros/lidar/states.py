"""The LiDAR's collision probability in every state: ``cfnav data lidar SCENES``.

Reads what ``cfnav rooms scan`` wrote beside each scene and writes ``lidar.npy``
there: float32 [S], the probability that the LiDAR node would publish in each state. With it a
policy is tested offline as it is deployed, ``cfnav evaluate --p-hat lidar``, with its veto or
without.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tqdm import tqdm

from cfnav_core.files.provenance import made_by, sha256, sign
from cfnav_core.files.whole import whole, writing
from cfnav_core.scenes.scene import HEADINGS, LIDAR, SCANS, step_m
from cfnav_ros.lidar.estimate import SweptDisc, estimate_collision
from cfnav_ros.lidar.returns import Scan

ESTIMATE_VERSION = 3
"""Rises when the same scans are judged otherwise; a test holds it."""

ANGLE_MIN, ANGLE_MAX = math.pi - math.radians(359.0), math.pi
RANGE_MIN, RANGE_MAX = 0.15, 12.0
"""What the RPLIDAR A1's driver says of a turn (rplidar_ros, branch ros2): radians and metres."""


@dataclass(frozen=True)
class EstimateOptions:
    """Judge the scans of every state as the LiDAR node does."""

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of scenes with scans."""

    def run_command(self) -> None:
        """Judge and count."""
        print(f"{run(self)} rooms in {self.scenes}")


def estimates_of(scans: Path) -> str:
    """What the estimates of a room are made of: the rule's version and the very scans."""
    return f"estimates {ESTIMATE_VERSION} of {sha256(scans)}"


def probabilities(turns: np.ndarray) -> np.ndarray:
    """The LiDAR node's probability at every position and heading, of the grid's MoveAhead there.

    Args:
        turns: float32 [P, 8, N] or [8 P, N], ranges in metres.

    Returns:
        float32 [8 P], by position and heading; 1 where the scan says nothing.
    """
    scans = turns.reshape(-1, turns.shape[-1])
    increment = (ANGLE_MAX - ANGLE_MIN) / (scans.shape[1] - 1)
    turn = (ANGLE_MIN, ANGLE_MAX, increment, RANGE_MIN, RANGE_MAX)
    discs = [SweptDisc(step=float(step)) for step in step_m(np.arange(HEADINGS))]
    p = [
        estimate_collision(Scan(ranges, *turn), discs[k % HEADINGS]).probability
        for k, ranges in enumerate(scans)
    ]
    return np.array(p, np.float32)


def run(options: EstimateOptions) -> int:
    """Judge every scanned room that was not judged yet; returns how many are scanned.

    Raises:
        ValueError: no room of the folder was scanned.
        OSError: a file cannot be read or written.
    """
    scanned = sorted(options.scenes.glob(f"*/{SCANS}"))
    if not scanned:
        raise ValueError(
            f"found no {SCANS} in the rooms of {options.scenes}; make them with "
            f"cfnav rooms scan {options.scenes}"
        )
    for path in tqdm(scanned, unit="room"):
        out, source = path.parent / LIDAR, estimates_of(path)
        if made_by(out) != source:
            try:
                turns = np.load(path)
            except (EOFError, ValueError) as error:
                raise ValueError(
                    f"found no readable {SCANS} in {path.parent} ({error}); delete it, and make it "
                    f"again with cfnav rooms scan {options.scenes}"
                ) from error
            judged = probabilities(turns)
            states = len(np.load(path.parent / "collided.npy", mmap_mode="r"))
            # the LiDAR does not tilt with the camera
            judged = judged.repeat(states // len(judged))
            with writing(out), whole(out) as partial, partial.open("wb") as file:
                np.save(file, judged)
            sign(out, source)
    return len(scanned)
