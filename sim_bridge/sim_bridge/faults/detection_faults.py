"""What can be wrong with a Detection2DArray; each function changes one in place.

The rows that use them are in ``faults.FAULTS``. Knows no ROS: messages are taken as they come.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from typing import Any

FLOOD = 2000
"""Boxes of a detector whose least score is zero."""

LARGER = 4.0
"""By which another picture is larger than the one that the boxes should be in."""


def other_labels(message: Any) -> None:
    """Numbers that the labels lack, as a detector says them that learnt others."""
    for one in message.detections:
        one.results[0].hypothesis.class_id = "9999"


def nan(message: Any) -> None:
    """Boxes that lie nowhere."""
    for one in message.detections:
        one.bbox.center.position.x = math.nan


def flood(message: Any) -> None:
    """One box again and again."""
    message.detections = [deepcopy(one) for one in message.detections[:1] for _ in range(FLOOD)]


def other_size(message: Any) -> None:
    """Boxes in pixels of a larger picture."""
    for one in message.detections:
        one.bbox.center.position.x *= LARGER
        one.bbox.center.position.y *= LARGER
        one.bbox.size_x *= LARGER
        one.bbox.size_y *= LARGER


SHAPES: dict[str, Callable[[Any], None]] = {
    "detections_other_labels": other_labels,
    "detections_nan": nan,
    "detections_flood": flood,
    "detections_other_size": other_size,
}
