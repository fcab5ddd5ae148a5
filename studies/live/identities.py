"""What tells apart the bundles and the simulators that trials were driven with."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from sim_bridge.robot.simulator import SIMULATOR_VERSION
from sim_bridge.room.room import ROOMS_VERSION

from cfnav_core.policy.bundle import BundleHead

WORLD = f"rooms {ROOMS_VERSION}, simulator {SIMULATOR_VERSION}"
"""The simulator: its rooms, its robot, their noise, light and lens."""


def identity_of(bundle: Path) -> str:
    """Of a bundle: hash of all its networks and their weights."""
    files = json.dumps(BundleHead.load(bundle).files, sort_keys=True)
    return hashlib.sha256(files.encode()).hexdigest()[:16]
