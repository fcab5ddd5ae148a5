"""What tells apart the bundles and the simulators that trials were driven with."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from cfnav_core.bundle import BundleHead
from cfnav_core.source import source_identity


def identity_of(bundle: Path) -> str:
    """Of a bundle: hash of all its networks and their weights."""
    files = json.dumps(BundleHead.load(bundle).files, sort_keys=True)
    return hashlib.sha256(files.encode()).hexdigest()[:16]


@cache
def world_source() -> str:
    """Identity of the simulator: its rooms, its robot, their noise, light and lens.

    Raises:
        OSError: it is not installed.
    """
    found = find_spec("sim_bridge")
    if found is None or found.origin is None:
        raise OSError("found no sim_bridge, in which trials are driven: run make setup")
    files = Path(found.origin).parent.glob("*.py")
    # How a process starts and ends is not part of its world.
    return source_identity(sorted(f for f in files if f.name != "mock_turtlebot4.py"))
