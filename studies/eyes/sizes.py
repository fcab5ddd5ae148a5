"""How wide and high things look at their distance: ``python -m studies.eyes.sizes``.

Writes ``cfnav_core/detect/sizes.yaml``, by which the distance of a box is guessed where nothing
measures it. Of each name the median over things that are seen nearly whole, from any side; the
distance is that to the nearest point of a thing's footprint, as success has it.
"""

from __future__ import annotations

import math
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.command import command_line, run_options
from cfnav_core.detect.sightings import SIZES, sighted
from cfnav_core.files.provenance import commit
from cfnav_core.files.whole import write_file
from cfnav_core.perception.boxes import Detection
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.pinhole import Pinhole
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.eyes.rooms import things_of_rooms

WHOLE = 0.9
"""Share of a thing's box from which on it is seen whole."""

ENOUGH = 10
"""Things of a name that give it a size."""

PERCEPTION_ROOMS = tuple(
    f"{furniture}{kind}:1000-1009" for furniture in ("", "sweet_home.") for kind in ROOM_TYPES
)
"""Rooms in which nothing is trained but perception, and nothing tested."""


@dataclass(frozen=True)
class SizeOptions:
    """Measure how large things look."""

    rooms: tuple[str, ...] = PERCEPTION_ROOMS
    """TYPE:SEED or TYPE:FIRST-LAST."""
    views: int = 60
    """Random views a room and camera."""
    cameras: tuple[str, ...] = ("stock_wide", "mast")
    """By which they are seen, as for cfnav rooms make."""
    out: Path = SIZES
    """The file."""


def sizes(
    rooms: Sequence[str], views: int, cameras: Sequence[CameraSetUp]
) -> dict[str, tuple[float, float]]:
    """Width and height by name, metres.

    Raises:
        ValueError: rooms that do not exist here.
    """
    found: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for camera in cameras:
        for view in things_of_rooms(rooms, views, camera):
            for thing in view.things:
                if thing.share < WHOLE or not thing.distance:
                    continue
                one = sighted(Detection(thing.name, 1.0, thing.box), Pinhole.of(camera))
                spans = (2 * thing.distance * math.tan(a / 2) for a in (one.width, one.height))
                found[thing.name].append(tuple(spans))  # type: ignore[arg-type]
    enough = {name: spans for name, spans in sorted(found.items()) if len(spans) >= ENOUGH}
    return {name: tuple(np.median(spans, 0).round(2).tolist()) for name, spans in enough.items()}


def main(options: SizeOptions) -> None:
    """Measure and write.

    Raises:
        ValueError: rooms or cameras that there are not.
    """
    cameras = [CameraSetUp.read(name) for name in options.cameras]
    made = sizes(options.rooms, options.views, cameras)
    head = f"# Width and height of things, metres: {command_line()}, commit {commit()}\n"
    lines = [f"{name}: [{wide}, {high}]\n" for name, (wide, high) in made.items()]
    write_file(options.out, (head + "".join(lines)).encode())
    print(f"{options.out}: {len(made)} names")


if __name__ == "__main__":
    sys.exit(run_options("sizes", SizeOptions, main))
