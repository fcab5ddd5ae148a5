"""The LiDAR's collision probability in every state: ``python -m cfnav_ros.lidar_states SCENES``.

Reads what ``python -m sim_bridge.scans`` wrote beside each scene and writes ``lidar.npy`` there:
float32 [S], the probability that the LiDAR node would publish in each state. With it a policy is
tested offline as it is deployed, ``cfnav evaluate --p-hat lidar``, with its veto or without.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from tqdm import tqdm

from cfnav_core.scene import HORIZONS, LIDAR, SCANS
from cfnav_core.source import made_by, sign, source_identity
from cfnav_core.whole import whole, writing
from cfnav_ros.lidar import estimate_collision
from cfnav_ros.returns import Scan

ANGLE_MIN, ANGLE_MAX = math.pi - math.radians(359.0), math.pi
RANGE_MIN, RANGE_MAX = 0.15, 12.0
"""What the RPLIDAR A1's driver says of a turn (rplidar_ros, branch ros2): radians and metres."""

JUDGE_FILES = ("lidar", "returns", "sweep", "lidar_states")
"""Modules that decide what the LiDAR node says of a scan."""


@dataclass(frozen=True)
class Options:
    """Judge the scans of every state as the LiDAR node does."""

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of scenes with scans."""


def probabilities(turns: np.ndarray) -> np.ndarray:
    """The LiDAR node's probability in every state.

    Args:
        turns: float32 [P, 8, N], ranges in metres.

    Returns:
        float32 [S], by position, heading and horizon; 1 where the scan says nothing.
    """
    scans = turns.reshape(-1, turns.shape[-1])
    increment = (ANGLE_MAX - ANGLE_MIN) / (scans.shape[1] - 1)
    turn = (ANGLE_MIN, ANGLE_MAX, increment, RANGE_MIN, RANGE_MAX)
    p = [estimate_collision(Scan(ranges, *turn)).probability for ranges in scans]
    return np.repeat(np.array(p, np.float32), HORIZONS)


def run(options: Options) -> int:
    """Judge every scanned room that was not judged yet; returns how many are scanned.

    Raises:
        ValueError: no room of the folder was scanned.
        OSError: a file cannot be read or written.
    """
    scanned = sorted(options.scenes.glob(f"*/{SCANS}"))
    if not scanned:
        raise ValueError(
            f"found no {SCANS} in the rooms of {options.scenes}; make them with "
            f"python -m sim_bridge.scans {options.scenes}"
        )
    judge = source_identity(Path(__file__).parent / f"{name}.py" for name in JUDGE_FILES)
    for path in tqdm(scanned, unit="room"):
        out, source = path.parent / LIDAR, f"{judge} of {made_by(path)}"
        if made_by(out) != source:
            judged = probabilities(np.load(path))
            with writing(out), whole(out) as partial, partial.open("wb") as file:
                np.save(file, judged)
            sign(out, source)
    return len(scanned)


def main() -> None:
    """Entry point: exit 2 with one sentence on bad input."""
    options = tyro.cli(Options)
    try:
        print(f"{run(options)} rooms in {options.scenes}")
    except (ValueError, OSError) as error:
        print(f"lidar_states: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
