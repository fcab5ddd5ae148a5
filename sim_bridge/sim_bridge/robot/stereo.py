"""What a stereo camera measures of true depth: an OAK-D at 400P, extended disparity. Pure numpy.

Depth comes from matching a pixel of the left picture with one of the right: their disparity is
focal length times baseline over depth. So errors grow with the square of depth; nothing comes from
too near, from plain surfaces and from what only one of the two sees.

Sources: docs.luxonis.com, "StereoDepth" and "Configuring Stereo Depth" (75 mm between the cameras
of all OAK-D, 72 x 49 degrees, disparities to 190, left-right check, eighths of a pixel).
depthai_ros_driver, ``stereo_param_handler.cpp``: subpixel with 3 bits and the left-right check are
its defaults, extended disparity is not.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from cfnav_core.task.camera import CameraSetUp

BASELINE_M = 0.075
NATIVE_COLUMNS = 640
"""Of the pictures that are matched; the mock's have half as many, every second one."""
FOV_DEG = (72.0, 48.8)
SIZE = (320, 200)
FOCAL_PX = NATIVE_COLUMNS / 2 / math.tan(math.radians(FOV_DEG[0]) / 2)
MOST_DISPARITY = 190
"""Pixels: nothing nearer than 0.17 m is measured."""
SUBPIXEL = 1 / 8
FURTHEST_M = 10.0
PATCH = 7
"""Native pixels that are matched together (a census of 7x9 there): errors are alike within them."""


def set_up_of(camera: CameraSetUp, down_deg: float = 0.0) -> CameraSetUp:
    """The stereo camera where a camera sits: it tilts with that, or is fixed and looks down."""
    horizons = (-math.radians(down_deg),) if down_deg else camera.horizons
    return CameraSetUp(camera.x, camera.z, FOV_DEG, SIZE, horizons)


def measured(
    depth: np.ndarray,
    rgb: np.ndarray,
    disparity_error: float,
    mismatches: float,
    plain: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Depth as the camera measures it.

    Args:
        depth: float32 [H, W], true, metres along the axis.
        rgb: uint8 [H, W, 3], what the left camera sees.
        disparity_error: native pixels, one sigma.
        mismatches: share of patches that are matched with anything.
        plain: grey levels, one sigma; a patch that varies no more has nothing to be matched by.
        rng: draws both.

    Returns:
        uint16 [H, W], millimetres, 0 where nothing was measured.
    """
    scale = NATIVE_COLUMNS / depth.shape[1]
    true = FOCAL_PX * BASELINE_M / np.maximum(depth, 1e-3)
    seen = (true <= MOST_DISPARITY) & (depth <= FURTHEST_M)
    patch = max(1, round(PATCH / scale))
    seen &= _in_both(true / scale)
    if plain:
        seen &= _variation(rgb, patch) > plain
    disparity = true
    if disparity_error or mismatches:
        rows, columns = (-(-side // patch) for side in depth.shape)
        error = rng.standard_normal((rows, columns), np.float32) * np.float32(disparity_error)
        wrong = rng.random((rows, columns), np.float32) < mismatches
        anything = rng.uniform(1, MOST_DISPARITY, (rows, columns)).astype(np.float32)

        def spread(values: np.ndarray) -> np.ndarray:
            grown = values.repeat(patch, 0).repeat(patch, 1)
            return grown[: depth.shape[0], : depth.shape[1]]

        # errors of neighbours go into each other: patches overlap
        smooth = cv2.blur(spread(error), (patch, patch)) * np.float32(1.5)
        disparity = np.where(spread(wrong), spread(anything), true + smooth)
    disparity = np.round(disparity / SUBPIXEL) * SUBPIXEL
    far = disparity < FOCAL_PX * BASELINE_M / FURTHEST_M
    metres = FOCAL_PX * BASELINE_M / np.maximum(disparity, 1e-3)
    return np.where(seen & ~far, np.rint(metres * 1000), 0).astype(np.uint16)


def _variation(rgb: np.ndarray, patch: int) -> np.ndarray:
    """Standard deviation of the grey levels around each pixel: float32 [H, W]."""
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
    mean = cv2.blur(grey, (patch, patch))
    square = cv2.blur(grey * grey, (patch, patch))
    return np.sqrt(np.maximum(square - mean * mean, 0.0))


def _in_both(disparity: np.ndarray) -> np.ndarray:
    """What the right camera sees too: bool [H, W], of disparities in pixels of this picture.

    A pixel at column u stands at u less its disparity there. What stands left of something nearer
    is hidden if a pixel further right comes to the same place or further left.
    """
    there = np.arange(disparity.shape[1]) - disparity
    right_of = np.minimum.accumulate(there[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(disparity.shape, bool)
    hidden[:, :-1] = there[:, :-1] >= right_of[:, 1:]
    return ~hidden & (there >= 0)
