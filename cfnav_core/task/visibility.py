"""When a goal counts as visible, and which goals a room offers: one rule for all cameras.

Data set, mock robot and reports share it.
"""

from __future__ import annotations

import numpy as np

VISIBLE_DISTANCE_M = 1.5
"""Largest horizontal distance from robot to object, metres (Section III of the paper)."""

VISIBLE_PIXELS = 40
"""Fewest pixels of the object in a 300x300 picture; scaled with the picture's area elsewhere."""

MIN_GOAL_STATES = 4
"""A goal that is visible in fewer states of a room is not asked for there; ours."""


def visible(
    pixels: np.ndarray | int, distance_m: np.ndarray | float, picture_pixels: int = 300 * 300
) -> np.ndarray:
    """Tell whether objects are visible.

    Args:
        pixels: int, any shape, pixels of each object in the picture's segmentation mask.
        distance_m: float, same shape, horizontal distance from the robot's middle to the nearest
            point of the object's footprint, metres.
        picture_pixels: number of pixels of the picture.

    Returns:
        bool, same shape.

    Source: Section III ("appears in the agent's current RGB image and within 1.5 m"); the pixel
    threshold is ours, the paper names none.
    """
    enough = np.asarray(pixels) * (300 * 300) >= VISIBLE_PIXELS * picture_pixels
    return enough & (np.asarray(distance_m) <= VISIBLE_DISTANCE_M)
