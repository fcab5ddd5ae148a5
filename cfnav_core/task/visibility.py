"""When a goal counts as visible, and which goals a room offers: one rule for all cameras.

Data set, mock robot and reports share it.
"""

from __future__ import annotations

import math

import numpy as np

from cfnav_core.task.camera import MAST, CameraSetUp

VISIBLE_DISTANCE_M = 1.5
"""Largest horizontal distance from robot to object, metres (Section III of the paper)."""

VISIBLE_PIXELS = 40
"""Fewest pixels of the object in the mast's picture, of 300x300 at 90 degrees."""

MIN_GOAL_STATES = 4
"""A goal that is visible in fewer states of a room is not asked for there; ours."""


def least_pixels(camera: CameraSetUp) -> float:
    """Fewest pixels of a visible object in a camera's picture.

    Those that show as much of a plane ahead as ``VISIBLE_PIXELS`` from the mast: 18 cm^2 of one 1 m
    away. A share of the picture would let a narrow camera see what nobody can recognise.
    """

    def focal_area(of: CameraSetUp) -> float:
        return math.prod(np.multiply(of.focal_share, of.size).tolist())

    return VISIBLE_PIXELS * focal_area(camera) / focal_area(MAST)


def visible(
    pixels: np.ndarray | int, distance_m: np.ndarray | float, camera: CameraSetUp = MAST
) -> np.ndarray:
    """Tell whether objects are visible.

    Args:
        pixels: int, any shape, pixels of each object in the picture's segmentation mask.
        distance_m: float, same shape, horizontal distance from the robot's middle to the nearest
            point of the object's footprint, metres.
        camera: that took the picture.

    Returns:
        bool, same shape.

    Source: Section III ("appears in the agent's current RGB image and within 1.5 m"); the pixel
    threshold is ours, the paper names none.
    """
    enough = np.asarray(pixels) >= least_pixels(camera)
    return enough & (np.asarray(distance_m) <= VISIBLE_DISTANCE_M)
