"""How kinds of detectors take a picture and say what they found: a row of ``HEADS`` each.

A file is told by its inputs and outputs, where those leave no doubt (``recognise``); otherwise its
user names the head. All boxes come out as left, top, right, bottom in 0..1 of the input.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfnav_core.detect.pictures import Input

Found = tuple[np.ndarray, np.ndarray]
"""Boxes float [n, 4] in 0..1 of the input, and scores float [n, classes]."""

Decode = Callable[[Sequence[np.ndarray], tuple[int, int], int], Found]
"""From outputs without their batch, the input's height and width, and the number of classes."""


@dataclass(frozen=True)
class Head:
    """A kind of detector.

    Attributes:
        title: for those who choose.
        given: what it takes.
        decode: what it says.
        overlaps: several of its boxes may be of one thing; the weaker are dropped.
    """

    title: str
    given: Input
    decode: Decode
    overlaps: bool = True


def _corners(middle: np.ndarray) -> np.ndarray:
    """Boxes of x, y, width, height, float [n, 4], by their ends."""
    half = middle[:, 2:4] / 2
    return np.concatenate([middle[:, :2] - half, middle[:, :2] + half], 1)


def _pixels(size: tuple[int, int]) -> np.ndarray:
    """Width, height, width, height."""
    return np.tile(size[::-1], 2).astype(np.float32)


def _single(classes: np.ndarray, scores: np.ndarray, count: int) -> np.ndarray:
    """Scores of all classes, float [n, count], where a detector names one each.

    Raises:
        ValueError: a class that the labels lack; one sentence.
    """
    numbers = classes.astype(int)
    if strange := sorted({int(n) for n in numbers[scores > 0] if not 0 <= n < count}):
        raise ValueError(
            f"found the class {strange[0]}, expected 0 to {count - 1}: choose the labels that this "
            "detector learnt."
        )
    out = np.zeros((len(numbers), count), np.float32)
    out[np.arange(len(numbers)), numbers.clip(0, count - 1)] = scores
    return out


def _yolov5(outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
    (rows,) = outputs
    return _corners(rows) / _pixels(size), rows[:, 5:] * rows[:, 4:5]


def _yolov8(outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
    rows = outputs[0].T
    return _corners(rows) / _pixels(size), rows[:, 4:]


def _rows_of_six(outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
    """Left, top, right, bottom in pixels, score, class."""
    (rows,) = outputs
    return rows[:, :4] / _pixels(size), _single(rows[:, 5], rows[:, 4], count)


def _yolox(outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
    """Offsets and logarithms of sizes in cells of three scales."""
    (rows,) = outputs
    cells, sides = [], []
    for side in (8, 16, 32):
        y, x = np.mgrid[: size[0] // side, : size[1] // side]
        cells.append(np.stack([x.ravel(), y.ravel()], 1))
        sides.append(np.full((x.size, 1), side))
    stride = np.concatenate(sides)
    middle = (rows[:, :2] + np.concatenate(cells)) * stride
    boxes = _corners(np.concatenate([middle, np.exp(rows[:, 2:4]) * stride], 1))
    return boxes / _pixels(size), rows[:, 5:] * rows[:, 4:5]


def _rtdetr(outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
    """Labels, boxes and scores of the picture's size, or rows of middle, size and class scores."""
    if len(outputs) == 1:
        (rows,) = outputs
        return _corners(rows), rows[:, 4:]
    labels, boxes, scores = outputs
    return boxes / _pixels(size), _single(labels, scores, count)


@dataclass(frozen=True)
class NanoDet:
    """How one of the two generations lays its cells.

    Attributes:
        strides: sides of the cells of each scale, pixels.
        bins: how many a distance may have.
        middle: of a cell, from its upper left corner, in cells.
    """

    strides: tuple[int, ...]
    bins: tuple[int, ...]
    middle: float

    def cells(self, size: tuple[int, int]) -> list[tuple[int, int]]:
        """Rows and columns of each scale over an input of a height and width, pixels.

        The last may end beyond it.
        """
        return [(-(-size[0] // side), -(-size[1] // side)) for side in self.strides]

    def fits(self, rows: int | str | None, columns: int, size: tuple[int, int], count: int) -> bool:
        """Whether joined rows, whose number the file may leave open, can be its own."""
        own = sum(high * wide for high, wide in self.cells(size))
        return columns in [count + 4 * bins for bins in self.bins] and (
            rows == own or not isinstance(rows, int)
        )

    def boxes(self, logits: np.ndarray, scale: int, size: tuple[int, int]) -> np.ndarray:
        """Boxes of one scale around their cells, float [n, 4] in 0..1 of the input.

        Args:
            logits: float [n, 4 * bins]: a distribution over distances to each side, in cells, whose
                mean is the distance.
            scale: which.
            size: height and width of the input, pixels.
        """
        bins = logits.reshape(len(logits), 4, -1)
        weight = np.exp(bins - bins.max(-1, keepdims=True))
        away = (weight * np.arange(bins.shape[2])).sum(-1) / weight.sum(-1)
        rows, columns = self.cells(size)[scale]
        y, x = np.mgrid[:rows, :columns]
        middle = np.stack([x.ravel(), y.ravel()], 1) + self.middle
        ends = np.concatenate([middle - away[:, :2], middle + away[:, 2:]], 1)
        return ends * self.strides[scale] / _pixels(size)

    def decode(self, outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
        """Scores, then distances: the scales apart, all scores first, or joined in one."""
        if len(outputs) > 1:
            half = len(outputs) // 2
            scores, logits = outputs[:half], outputs[half:]
        else:
            (rows,) = outputs
            if not self.fits(rows.shape[0], rows.shape[1], size, count):
                raise ValueError(
                    f"found {rows.shape[0]} rows of {rows.shape[1]} numbers, expected "
                    f"{sum(high * wide for high, wide in self.cells(size))} of "
                    f"{' or '.join(str(count + 4 * bins) for bins in self.bins)}: choose the "
                    "labels that this detector learnt"
                )
            ends = np.cumsum([high * wide for high, wide in self.cells(size)])[:-1]
            parts = np.split(rows, ends)
            scores, logits = [p[:, :count] for p in parts], [p[:, count:] for p in parts]
        boxes = [self.boxes(part, scale, size) for scale, part in enumerate(logits)]
        return np.concatenate(boxes), np.concatenate(scores)


NANODETS = {
    "nanodet": NanoDet((8, 16, 32), (8, 11), 0.5),
    "nanodet_plus": NanoDet((8, 16, 32, 64), (8,), 0.0),
}
"""By the names of their heads. Source: nanodet_head.py, gfl_head.py, nanodet_plus_head.py and the
configurations of https://github.com/RangiLyu/nanodet; the plus learnt from squeezed pictures."""


def _ssd(outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
    """Top, left, bottom, right in 0..1, classes and scores, as TensorFlow's detectors say them."""
    boxes, classes, scores = outputs[:3]
    return boxes[:, [1, 0, 3, 2]], _single(classes, scores, count)


def _raw_ssd(outputs: Sequence[np.ndarray], size: tuple[int, int], count: int) -> Found:
    """The same before its weaker boxes are dropped: scores of classes from 1 on, and boxes."""
    scores, boxes = outputs
    none = np.zeros((len(scores), 1), scores.dtype)
    return boxes[:, 0][:, [1, 0, 3, 2]], np.concatenate([none, scores], 1)


_UNIT = (255, 255, 255)
_YOLO = Input("middle", 114, deviation=_UNIT)
_NANODET_PLUS = Input(
    blue_first=True, mean=(103.53, 116.28, 123.675), deviation=(57.375, 57.12, 58.395)
)

HEADS = {
    "yolov5": Head("YOLO v5, v6 and v7: rows of box, objectness and class scores", _YOLO, _yolov5),
    "yolov8": Head("YOLO v8, v9, 11 and 12: columns of box and class scores", _YOLO, _yolov8),
    "yolov10": Head("YOLO v10 and 26: rows of box, score, class", _YOLO, _rows_of_six, False),
    "yolox": Head("YOLOX as its ONNX export leaves it", Input("corner", 114, True), _yolox),
    "rtdetr": Head("RT-DETR, its own export or Ultralytics's", Input(deviation=_UNIT), _rtdetr,
                   overlaps=False),
    "nanodet": Head("NanoDet -m, -g and -t", replace(_NANODET_PLUS, fit="middle"),
                    NANODETS["nanodet"].decode),
    "nanodet_plus": Head("NanoDet-Plus", _NANODET_PLUS, NANODETS["nanodet_plus"].decode),
    "ssd": Head("TensorFlow's detectors with their own selection", Input(), _ssd, overlaps=False),
    "raw_ssd": Head("the same without it", Input(), _raw_ssd),
    "centernet": Head("CenterNet: rows of box, score, class", Input(), _rows_of_six),
}  # fmt: skip
"""By name."""
