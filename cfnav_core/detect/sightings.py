"""Where a detector's boxes are: directions from the robot and distances, whatever the camera.

A policy that reads ``task.detections.SIGHTINGS`` needs no more of a picture than its boxes. The
robot and the rooms that such a policy learns in make them by this code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from cfnav_core.perception.boxes import Detection
from cfnav_core.perception.perception import Perceived, Percept, PerceptionError
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.pinhole import Pinhole

SIZES = Path(__file__).with_name("sizes.yaml")
"""How wide and high things are, by name; ``python -m studies.eyes.sizes`` measures it."""


@dataclass(frozen=True)
class Sighting:
    """A named thing in a direction.

    Attributes:
        name: what cfnav calls it.
        confidence: 0..1.
        azimuth, elevation: of the middle of its box, rad from straight ahead on the level, right
            and up positive.
        width, height: of its box, rad.
        distance: from the robot's middle, metres; 0 where nobody knows.
    """

    name: str
    confidence: float
    azimuth: float
    elevation: float
    width: float
    height: float
    distance: float = 0.0


class SightingEyes:
    """Stands where another policy has a perception network: its pictures were looked at before.

    Args:
        objects: names of the C rows that its policy reads.
        features: shape of what its policy does not read.

    Attributes:
        identity: the same for all.
        gives: see ``Percept``; it takes no pictures.
    """

    identity = "sightings"

    def __init__(self, objects: Sequence[str], features: tuple[int, ...]) -> None:
        self.gives = Percept(features, tuple(objects), SIGHTINGS, (0, 0), None)

    def observe(self, seen: np.ndarray | Sequence[Sighting]) -> Perceived:
        """What its policy reads of the sightings of one moment.

        Raises:
            PerceptionError: it was given a picture.
        """
        if isinstance(seen, np.ndarray):
            raise PerceptionError(
                f"found a picture {seen.shape}, expected sightings: this bundle reads what a "
                "detector says (cfnav_core.detect.sightings)"
            )
        nothing = np.zeros((1, *self.gives.features), np.float16)
        return Perceived(nothing, table(seen, self.gives.objects)[None])


Ranging = Callable[[Sighting], float]
"""How far a thing is, metres, by where it is seen; 0 when that does not tell."""


def sighted(found: Detection, camera: Pinhole, tilt: float = 0.0, depth: float = 0.0) -> Sighting:
    """The direction of a box, and how far along the floor its thing is.

    Args:
        found: its name is what cfnav calls it.
        camera: whose pixels the box is in.
        tilt: of the camera, rad, up positive.
        depth: of the thing along the camera's axis, metres; 0 where nobody knows.
    """
    left, top, right, bottom = found.box
    x0, x1 = ((edge - 0.5 - camera.cx) / camera.fx for edge in (left, right))
    y0, y1 = ((edge - 0.5 - camera.cy) / camera.fy for edge in (top, bottom))
    x, up = (x0 + x1) / 2, -(y0 + y1) / 2
    ahead, rise = math.cos(tilt) - up * math.sin(tilt), up * math.cos(tilt) + math.sin(tilt)
    return Sighting(
        found.name, found.score, math.atan2(x, ahead), math.atan2(rise, math.hypot(x, ahead)),
        math.atan(x1) - math.atan(x0), math.atan(y1) - math.atan(y0),
        depth * math.hypot(x, ahead),
    )  # fmt: skip


def table(seen: Iterable[Sighting], objects: Sequence[str]) -> np.ndarray:
    """What a policy reads: of each object the surest sighting.

    Args:
        seen: what is no object is left out.
        objects: names of the C rows.

    Returns:
        Float16 [C, 6], fields ``SIGHTINGS``; zeros where nothing is seen.

    Raises:
        ValueError: a number is not finite, or too large for what a policy reads.
    """
    out = np.zeros((len(objects), len(SIGHTINGS)), np.float16)
    rows = {name: row for row, name in enumerate(objects)}
    with np.errstate(over="ignore"):  # becomes inf, which is refused below
        for one in sorted(seen, key=lambda one: one.confidence):
            if one.name in rows:
                out[rows[one.name]] = [getattr(one, field) for field in SIGHTINGS]
    if not np.isfinite(out).all():
        raise ValueError("found a sighting with a number that is not finite, expected all to be")
    return out


def known_sizes(path: Path = SIZES) -> dict[str, tuple[float, float]]:
    """Width and height of things, metres, by name, from a file like ``sizes.yaml``."""
    said = yaml.safe_load(path.read_text())
    return {name: (float(wide), float(high)) for name, (wide, high) in said.items()}


def by_size(sizes: Mapping[str, tuple[float, float]]) -> Ranging:
    """Distance by how large a thing of a name mostly is.

    A box that is cut or half hidden is smaller than its thing, never larger: the nearer of what
    width and height say counts.
    """

    def ranging(one: Sighting) -> float:
        angles = one.width, one.height
        told = [
            size / (2 * math.tan(angle / 2))
            for size, angle in zip(sizes.get(one.name, ()), angles, strict=False)
            if 0 < angle < math.pi
        ]
        return min(told, default=0.0)

    return ranging


def by_ranges(bearings: np.ndarray, ranges: np.ndarray) -> Ranging:
    """Distance by a LiDAR: the nearest return in the directions of the box.

    What stands on a table is as far as what the LiDAR meets below it.

    Args:
        bearings: float [N], of the returns from the robot's middle, rad, left positive.
        ranges: float [N], metres from there; what is not finite is no return.
    """
    returned = np.isfinite(ranges)
    bearings, ranges = bearings[returned], ranges[returned]

    def ranging(one: Sighting) -> float:
        away = np.angle(np.exp(1j * (bearings + one.azimuth)))
        within = ranges[np.abs(away) <= one.width / 2]
        return float(within.min()) if len(within) else 0.0

    return ranging
