"""Events of a bag as something that can be compared."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
from cfnav_ros.bags.events import Event
from cfnav_ros.bags.reading import Bag
from cfnav_ros.bags.roles import assign


def plain(event: Event) -> tuple:
    """An event as something that can be compared and hashed."""
    values = [type(event).__name__]
    for field in fields(event):
        value = getattr(event, field.name)
        if field.name == "decode":
            value = value().tobytes()
        elif isinstance(value, np.ndarray):
            value = (value.shape, value.tobytes())
        elif field.name == "scan":
            value = (value.ranges.tobytes(), value.angle_min, value.frame, value.scan_time)
        values.append(value)
    return tuple(values)


def read(path: Path) -> tuple[list[tuple], list[str]]:
    """All events of a bag, and what is said about it."""
    with Bag(path) as bag:
        events = [plain(event) for event in bag.events(assign(bag.topics))]
        return events, list(bag.notes)
