"""Programs that measure several things one after the other and keep what was measured before."""

from __future__ import annotations

import json
import os
import platform
import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cfnav_ros.process.processes import GraphError

from cfnav_core.files.json_file import write_json
from cfnav_core.files.provenance import commit

Part = Callable[[], dict[str, Any]]
"""Measures and gives the figures that it adds."""


def measure_parts(
    path: Path,
    module: str,
    parts: Mapping[str, Part],
    only: str,
    after: Callable[[str, dict[str, Any]], None] = lambda name, found: None,
) -> dict[str, Any]:
    """Measure parts and write the results after each, with command, commit and the machine's load.

    Args:
        path: JSON file of the results; those of parts that are left out stay.
        module: that was run, for the command.
        parts: by name.
        only: names of parts, comma-separated; empty: all.
        after: called with the name and all results before they are written.

    Raises:
        GraphError: a part that does not exist, or could not be measured.
        OSError: the file cannot be read or written.
    """
    names = [word.strip() for word in only.split(",") if word.strip()] or list(parts)
    for name in names:
        if name not in parts:
            raise GraphError(f"--only names {name!r}, expected parts of {', '.join(parts)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    found: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    for name in names:
        load = os.getloadavg()[0]
        found |= parts[name]()
        found.setdefault("measured", {})[name] = {
            "commit": commit(),
            "command": shlex.join(["python", "-m", module, *sys.argv[1:]]),
            "load_before": round(load, 2),
            "load_after": round(os.getloadavg()[0], 2),
            "cores": os.cpu_count(),
            "machine": platform.machine(),
        }
        after(name, found)
        write_json(path, found)
    return found
