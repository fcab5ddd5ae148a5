"""Which parameter file a name means, for ``cfnav robot`` and the launch files alike."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from cfnav_ros.process.processes import GraphError

SOURCES = Path(__file__).parents[3] / "ros_ws/src/cfnav_bringup/config"
"""In a checkout: like all sources it comes before colcon's copy, so that an edit takes effect."""


def parameter_file(
    given: str, environment: Mapping[str, str] = os.environ, sources: Path = SOURCES
) -> Path:
    """Return a parameter file by its path or by its name in ``cfnav_bringup``.

    Args:
        given: path or name.
        environment: with the prefixes of built packages.
        sources: folder that is looked into before those; it need not exist.

    Raises:
        GraphError: there is no such file.
    """
    prefixes = [p for p in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    folders = [sources, *(Path(prefix) / "share/cfnav_bringup/config" for prefix in prefixes)]
    for path in (Path(given), *(folder / given for folder in folders)):
        if path.is_file():
            return path.resolve()
    shipped = sorted({path.name for folder in folders for path in folder.glob("*.yaml")})
    known = f"one of {', '.join(shipped)}" if shipped else "a name that a built ros_ws brings"
    raise GraphError(f"--params is {given!r}, expected a file or {known}")
