"""COCO detectors in ONNX files, decoded by numpy: what ``studies.eyes.fetch --detectors`` brings.

Each takes a picture as it was trained: NanoDet (its g-416, 22.9 mAP on COCO) at its aspect within
416x416 and black around it, in BGR with ImageNet's means; COCO-SSD squeezed to 300x300. How
CenterNet was trained is not told; it is given 512x512, squeezed. ``Detector.scores`` says how
surely each of cfnav's categories is shown; those that COCO does not know have no score.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from onnxruntime import InferenceSession
from PIL import Image

from cfnav_core.perception.boxes import Box, Detection
from cfnav_core.perception.onnx_session import open_session
from cfnav_core.task.vocabulary import CATEGORIES

COCO = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat",
    "traffic_light", "fire_hydrant", "stop_sign", "parking_meter", "bench", "bird", "cat", "dog",
    "horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe", "backpack", "umbrella",
    "handbag", "tie", "suitcase", "frisbee", "skis", "snowboard", "sports_ball", "kite",
    "baseball_bat", "baseball_glove", "skateboard", "surfboard", "tennis_racket", "bottle",
    "wine_glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich",
    "orange", "broccoli", "carrot", "hot_dog", "pizza", "donut", "cake", "chair", "couch",
    "potted_plant", "bed", "dining_table", "toilet", "tv", "laptop", "mouse", "remote",
    "keyboard", "cell_phone", "microwave", "oven", "toaster", "sink", "refrigerator", "book",
    "clock", "vase", "scissors", "teddy_bear", "hair_drier", "toothbrush",
)  # fmt: skip
"""COCO's 80 classes in order."""

_SKIPPED = {12, 26, 29, 30, 45, 66, 68, 69, 71, 83}
COCO_IDS = [number for number in range(1, 91) if number not in _SKIPPED]
"""COCO's own numbers of these classes."""

CATEGORY_OF = {
    "apple": "Apple", "bowl": "Bowl", "book": "Book", "cell_phone": "CellPhone", "chair": "Chair",
    "clock": "AlarmClock", "cup": "Mug", "laptop": "Laptop", "microwave": "Microwave",
    "potted_plant": "HousePlant", "refrigerator": "Fridge", "remote": "RemoteControl",
    "sink": "Sink", "toaster": "Toaster", "tv": "Television", "vase": "Vase",
}  # fmt: skip
"""What a class of COCO is called here; a couch or a bed is no goal, an oven no stove burner."""

LEAST = 0.01
"""Scores below this are not decoded to boxes."""

OVERLAP = 0.5
"""Intersection through union above which the weaker of two boxes of a class is dropped."""


Run = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From a picture uint8 [H, W, 3] to boxes float [n, 4] in 0..1 and scores float [n, 80]."""


class Detector:
    """A COCO detector in an ONNX file, told by its inputs and outputs.

    Args:
        path: the ONNX file.
        threads: of ONNX Runtime.

    Raises:
        ValueError: missing, damaged, or no detector that is known here.
    """

    def __init__(self, path: Path, threads: int = 1) -> None:
        session = open_session(path, threads)
        given = session.get_inputs()[0].name
        if given not in DECODERS:
            raise ValueError(
                f"found an ONNX file with the input {given} at {path}, expected a detector of "
                "python -m studies.eyes.fetch --detectors"
            )
        self.name = path.stem
        self._run = DECODERS[given](session)

    def __call__(self, rgb: np.ndarray, least: float = LEAST) -> list[Detection]:
        """Detections above a score by COCO's names, best first.

        Args:
            rgb: uint8 [H, W, 3].
            least: score.
        """
        boxes, scores = self._run(rgb)
        boxes = boxes.clip(0, 1) * np.tile(rgb.shape[1::-1], 2)
        found = [
            Detection(COCO[c], float(scores[k, c]), _box(boxes[k]))
            for c in np.flatnonzero(scores.max(0) > least)
            for k in kept(boxes, scores[:, c], least)
        ]
        return sorted(found, key=lambda one: -one.score)

    def scores(self, rgb: np.ndarray) -> np.ndarray:
        """How surely each category is shown, float [C]; NaN of those that COCO does not know."""
        best = self._run(rgb)[1].max(0)
        out = np.full(len(CATEGORIES), np.nan)
        for name, category in CATEGORY_OF.items():
            out[CATEGORIES.index(category)] = best[COCO.index(name)]
        return out


def _box(ends: np.ndarray) -> Box:
    left, top, right, bottom = map(float, ends)
    return left, top, right, bottom


def kept(boxes: np.ndarray, scores: np.ndarray, least: float) -> list[int]:
    """Indices of the boxes of one class that no better one covers, best first."""
    order = np.flatnonzero(scores > least)
    order = order[np.argsort(-scores[order], kind="stable")]
    left: list[int] = []
    while len(order):
        best, order = int(order[0]), order[1:]
        left.append(best)
        order = order[overlap(boxes[best], boxes[order]) < OVERLAP]
    return left


def overlap(box: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Intersection through union of a box with each of others, float [n]."""
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared = (high - low).clip(0).prod(1)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(1) + (box[2:] - box[:2]).prod()
    return shared / np.maximum(areas - shared, 1e-9)


def paired(shared: np.ndarray, least: float) -> np.ndarray:
    """Which things have a box: bool [things]; the best pair first, each in one pair only.

    Args:
        shared: float [things, boxes], intersection through union; below ``least`` where a thing and
            a box cannot be a pair.
        least: intersection through union of a pair, above 0.
    """
    left, out = shared.copy(), np.zeros(len(shared), bool)
    while left.size and left.max() >= least:
        thing, box = np.unravel_index(int(left.argmax()), left.shape)
        left[thing], left[:, box], out[thing] = -1, -1, True
    return out


def squeezed(rgb: np.ndarray, side: int) -> np.ndarray:
    """A picture resized to a square whatever its shape, uint8 [side, side, 3]."""
    return np.asarray(Image.fromarray(rgb).resize((side, side), Image.Resampling.BILINEAR))


NANODET_SIDE, NANODET_BINS = 416, 11
BGR_MEAN = np.array([103.53, 116.28, 123.675], np.float32)
BGR_DEVIATION = np.array([57.375, 57.12, 58.395], np.float32)


def letterboxed(rgb: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """A picture at its aspect in the middle of a black square.

    Returns:
        uint8 [side, side, 3], and where the picture lies there: left, top, width, height in 0..1.
    """
    size = np.array(rgb.shape[1::-1])
    wide, high = np.maximum(1, np.round(size * side / size.max()).astype(int))
    left, top = (side - wide) // 2, (side - high) // 2
    out = np.zeros((side, side, 3), np.uint8)
    scaled = Image.fromarray(rgb).resize((wide, high), Image.Resampling.BILINEAR)
    out[top : top + high, left : left + wide] = np.asarray(scaled)
    return out, np.array([left, top, wide, high]) / side


def nanodet_input(square: np.ndarray) -> np.ndarray:
    """What NanoDet takes of a square picture uint8 [side, side, 3], float32 [1, 3, side, side]."""
    bgr = square[..., ::-1].astype(np.float32)
    return np.ascontiguousarray(((bgr - BGR_MEAN) / BGR_DEVIATION).transpose(2, 0, 1)[None])


def _nanodet(session: InferenceSession) -> Run:
    names = ["Identity:0", *(f"Identity_{k}:0" for k in range(1, 6))]

    def run(rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        square, (left, top, wide, high) = letterboxed(rgb, NANODET_SIDE)
        out = session.run(names, {"input_1:0": nanodet_input(square)})
        boxes, scores = nanodet_boxes([part[0] for part in out])
        return (boxes - [left, top, left, top]) / [wide, high, wide, high], scores

    return run


def nanodet_boxes(out: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Boxes in 0..1 and scores of three scales: class scores, then distances to the four sides.

    A distance is the mean of a distribution over bins, in cells.
    """
    boxes, scores = [], []
    for score, logits in zip(out[:3], out[3:], strict=True):
        cells = round(len(score) ** 0.5)
        bins = logits.reshape(len(score), 4, NANODET_BINS)
        weight = np.exp(bins - bins.max(-1, keepdims=True))
        away = (weight * np.arange(NANODET_BINS)).sum(-1) / weight.sum(-1)
        y, x = np.divmod(np.arange(len(score)), cells)
        centre = np.stack([x, y], 1) + 0.5
        boxes.append(np.concatenate([centre - away[:, :2], centre + away[:, 2:]], 1) / cells)
        scores.append(score)
    return np.concatenate(boxes), np.concatenate(scores)


def _centernet(session: InferenceSession) -> Run:
    def run(rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        given = squeezed(rgb, 512)[None].astype(np.float32)
        rows = session.run(["tower_0/detections:0"], {"tower_0/images:0": given})[0][0]
        scores = np.zeros((len(rows), len(COCO)), np.float32)
        scores[np.arange(len(rows)), rows[:, 5].astype(int)] = rows[:, 4]
        return rows[:, :4] / 512, scores

    return run


def _coco_ssd(session: InferenceSession) -> Run:
    def run(rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        names = ["Postprocessor/Slice:0", "Postprocessor/ExpandDims_1:0"]
        scores, boxes = session.run(names, {"image_tensor:0": squeezed(rgb, 300)[None]})
        return boxes[0, :, 0][:, [1, 0, 3, 2]], scores[0][:, np.array(COCO_IDS) - 1]

    return run


DECODERS: Mapping[str, Callable[[InferenceSession], Run]] = {
    "input_1:0": _nanodet,
    "tower_0/images:0": _centernet,
    "image_tensor:0": _coco_ssd,
}
"""How a file is run, by the name of its input."""
