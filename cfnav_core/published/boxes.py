"""True boxes of Offline Data 2 (``objects_bb.json``) as four numbers a class."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cfnav_core.published.graph import Keys, read_json
from cfnav_core.published.keys import Key
from cfnav_core.scenes.scene import SceneError

PICTURE_SIDE = 300
"""Pixels that boxes are counted in."""

NUMBERS = 4
"""Of a class: seen or not, mean x, mean y, area of the hull of its boxes, each 0..1."""

Boxes = dict[str, list[float]]
"""Class to x1, y1, x2, y2 of each visible instance, one after the other, pixels."""


def read_boxes(path: Path) -> tuple[dict[Key, Boxes], dict[str, str]]:
    """Read the boxes of every state.

    Returns:
        The boxes, and unusable state keys with their sentences.

    Raises:
        SceneError: the file is not of that form.
    """
    data, keys = read_json(path), Keys()
    if not isinstance(data, Mapping) or not all(isinstance(v, Mapping) for v in data.values()):
        raise SceneError(f"found {path} without a table of classes for each state; unpack it again")
    # sorted, -0.00 comes before 0.00, which wins where a file has both
    read = {text: keys.read(text) for text in sorted(data)}
    return {key: dict(data[text]) for text, key in read.items() if key is not None}, keys.bad


def box_rows(boxes: Boxes, objects: tuple[str, ...]) -> np.ndarray:
    """float32 [C, 4] of one state: seen, mean of all x, mean of all y, area of the hull.

    Classes that are no ``objects`` are left out. Source: context vector of MJOLNIR (Pal et al.).

    Raises:
        SceneError: the numbers of a class are not in fours.
    """
    out = np.zeros((len(objects), NUMBERS), np.float32)
    for row, name in enumerate(objects):
        if not (numbers := boxes.get(name)):
            continue
        try:
            corners = np.asarray(numbers, np.float64).reshape(-1, 4) / PICTURE_SIDE
        except (ValueError, TypeError) as error:
            raise SceneError(f"found boxes of {name} that are not four numbers each") from error
        low, high = corners[:, :2].min(0), corners[:, 2:].max(0)
        out[row] = 1.0, *corners.reshape(-1, 2).mean(0), abs(np.prod(high - low))
    return out
