"""What tells apart the bundles and the simulators that trials were driven with."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from sim_bridge.robot.simulator import SIMULATOR_VERSION
from sim_bridge.room.room import room_source

from cfnav_core.policy.bundle import BundleHead
from cfnav_core.task.rooms import parse_rooms


def world_of(rooms: Sequence[str]) -> str:
    """The simulator of trials in some rooms: how these are made, its robot, noise, light and lens.

    Args:
        rooms: such as kitchen:25.
    """
    made = sorted({room_source(kind) for kind, _ in parse_rooms(rooms)})
    return f"{', '.join(made)}, simulator {SIMULATOR_VERSION}"


WORLD = world_of(["kitchen:0"])
"""That of our own rooms."""


def identity_of(bundle: Path) -> str:
    """Of a bundle: hash of all its networks and their weights."""
    files = json.dumps(BundleHead.load(bundle).files, sort_keys=True)
    return hashlib.sha256(files.encode()).hexdigest()[:16]
