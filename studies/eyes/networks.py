"""What is judged on pictures: perception networks and COCO detectors, by one interface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

from cfnav_core.detect.detector import OnnxDetector
from cfnav_core.files.provenance import sha256
from cfnav_core.perception.boxes import LEAST, Detection
from cfnav_core.perception.perception import OnnxPerception
from cfnav_core.policy.bundle import shipped_perception
from cfnav_core.task.detections import confidence_column
from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.detectors import CATEGORY_OF, category_scores, load_detector

Scores = Callable[[np.ndarray], np.ndarray]
"""From uint8 [H, W, 3] to how surely each category is shown, float [C], NaN where unknown."""

Boxes = Callable[[np.ndarray], list[Detection]]
"""From uint8 [H, W, 3] to what is found where, by the names of ``CATEGORIES``."""


def _enlarged(rgb: np.ndarray, network: OnnxPerception) -> np.ndarray:
    """A picture that is no smaller than what a network takes."""
    high, wide = network.gives.size
    if rgb.shape[0] >= high and rgb.shape[1] >= wide:
        return rgb
    return np.asarray(Image.fromarray(rgb).resize((wide, high), Image.Resampling.BILINEAR))


def perception_boxes(network: OnnxPerception) -> Boxes:
    """What a perception finds where."""

    def boxes(rgb: np.ndarray) -> list[Detection]:
        large = _enlarged(rgb, network)
        down, across = (a / b for a, b in zip(rgb.shape[:2], large.shape[:2], strict=True))
        return [
            Detection(name, score, (x0 * across, y0 * down, x1 * across, y1 * down))
            for name, score, (x0, y0, x1, y1) in map(astuple, network.boxes(large))
            if name in CATEGORIES
        ]

    return boxes


def detector_boxes(detector: OnnxDetector) -> Boxes:
    """What a COCO detector finds where, of what cfnav knows too."""
    return lambda rgb: [
        replace(one, name=CATEGORY_OF[one.name])
        for one in detector(rgb, LEAST)
        if one.name in CATEGORY_OF
    ]


def perception_scores(network: OnnxPerception) -> Scores:
    """How surely a perception sees each of ``CATEGORIES``."""
    gives = network.gives
    column = confidence_column(gives.fields)

    def scores(rgb: np.ndarray) -> np.ndarray:
        table = network.observe(_enlarged(rgb, network)).detections[0]
        out = np.full(len(CATEGORIES), np.nan)
        for row, name in zip(table, gives.objects, strict=True):
            if name in CATEGORIES:
                out[CATEGORIES.index(name)] = row[column]
        return out

    return scores


@dataclass(frozen=True)
class Network:
    """Something to judge.

    Attributes:
        name: for tables and files.
        sha256: of its file.
        scores: of a picture.
        boxes: of a picture, None when it has none.
    """

    name: str
    sha256: str
    scores: Scores
    boxes: Boxes | None


def networks(perceptions: Sequence[Path], detectors: Sequence[Path]) -> tuple[list[Network], float]:
    """What is to be judged, and the aspect that pictures are cut to.

    Args:
        perceptions: ONNX files of perception networks; the shipped bundle's when empty.
        detectors: ONNX files of COCO detectors.

    Raises:
        ValueError: a file cannot be used, or perceptions of several aspects.
    """
    found, aspects = [], set()
    for path in perceptions or (shipped_perception(),):
        perception = OnnxPerception(path)
        if not perception.gives.objects:
            raise ValueError(f"found a perception that detects nothing at {path}, expected objects")
        aspects.add(perception.gives.size[1] / perception.gives.size[0])
        alike = sum(path.stem == other.stem for other in perceptions) > 1
        name = f"{path.parent.name}/{path.stem}" if alike else path.stem
        name = name if perceptions else "shipped perception"
        boxes = None if perception.no_boxes else perception_boxes(perception)
        found.append(Network(name, sha256(path), perception_scores(perception), boxes))
    if len(aspects) > 1:
        raise ValueError(
            f"found perceptions of the aspects {sorted(aspects)}, expected one; judge each shape "
            "in a run of its own"
        )
    for path in detectors:
        detector = load_detector(path)
        scores, boxes = partial(category_scores, detector), detector_boxes(detector)
        found.append(Network(path.stem, sha256(path), scores, boxes))
    names = [network.name for network in found]
    if len({*names}) < len(names):
        raise ValueError(f"found networks named {', '.join(names)}, expected names of their own")
    return found, aspects.pop()
