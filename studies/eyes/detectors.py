"""COCO detectors beside perception networks: what ``studies.eyes.fetch --detectors`` brings.

NanoDet (its g-416, 22.9 mAP on COCO) and COCO-SSD take pictures as they were trained. How CenterNet
was trained is not told; it is given 512x512, squeezed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cfnav_core.detect.detector import OnnxDetector
from cfnav_core.detect.labels import load_labels
from cfnav_core.task.vocabulary import CATEGORIES

CATEGORY_OF = load_labels("coco").categories
"""What a class of COCO is called here, by its name."""

LEAST = 0.01
"""Scores below this are not decoded to boxes."""


def load_detector(path: Path) -> OnnxDetector:
    """A COCO detector in an ONNX file.

    Raises:
        ValueError: missing, damaged, or no detector that is known here.
    """
    try:
        return OnnxDetector(path, "coco", side=300)
    except ValueError:  # TensorFlow's have COCO's own numbers; other faults are told again
        return OnnxDetector(path, "coco_ids", side=300)


def category_scores(detector: OnnxDetector, rgb: np.ndarray) -> np.ndarray:
    """How surely each category is shown, float [C]; NaN of those that the detector does not know.

    Args:
        detector: of COCO's classes.
        rgb: uint8 [H, W, 3].
    """
    best = detector.found(rgb)[1].max(0)
    out = np.full(len(CATEGORIES), np.nan)
    for number, name in detector.labels.names.items():
        if (category := detector.labels.categories.get(name)) in CATEGORIES:
            out[CATEGORIES.index(category)] = best[number]
    return out


def overlap(box: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Intersection through union of a box with each of others, float [n]."""
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared = (high - low).clip(0).prod(1)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(1) + (box[2:] - box[:2]).prod()
    return shared / np.maximum(areas - shared, 1e-9)


def best_pairs(shared: np.ndarray, least: float) -> dict[int, int]:
    """Boxes of things, by row and column; the best pair first, each in one pair only.

    Args:
        shared: float [things, boxes], intersection through union; below ``least`` where a thing and
            a box cannot be a pair.
        least: intersection through union of a pair, above 0.
    """
    left, out = shared.copy(), dict[int, int]()
    while left.size and left.max() >= least:
        thing, box = map(int, np.unravel_index(int(left.argmax()), left.shape))
        left[thing], left[:, box], out[thing] = -1, -1, box
    return out


def paired(shared: np.ndarray, least: float) -> np.ndarray:
    """Which things have a box: bool [things], see ``best_pairs``."""
    return np.isin(np.arange(len(shared)), list(best_pairs(shared, least)))
