"""An object detector in an ONNX file: a picture in, named boxes out.

What kind it is, is told by its inputs and outputs; how many classes it has and what they are called
is said by the file itself (Ultralytics writes it there) or by a map of labels.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cfnav_core.detect.heads import HEADS, NANODETS
from cfnav_core.detect.labels import LabelMap, load_labels
from cfnav_core.perception.boxes import Box, Detection
from cfnav_core.perception.onnx_session import open_session

LEAST = 0.3
"""Score of what is told, unless asked otherwise."""

OVERLAP = 0.5
"""Intersection through union above which the weaker of two boxes of a class is dropped."""

MOST = 500
"""Boxes that are looked at, the best, as many as a robot takes of a message: more are noise."""

ROUNDED = 1e-3
"""Scores reach beyond 1 by no more than float16 rounds."""

Shape = tuple[Any, ...]

_NAMED = (
    ("ssd", ("detection_boxes", "detection_classes", "detection_scores")),
    ("raw_ssd", ("Postprocessor/Slice", "Postprocessor/ExpandDims_1")),
    ("rtdetr", ("labels", "boxes", "scores")),
    ("centernet", ("tower_0/detections",)),
    ("nanodet", ("Identity", "Identity_1", "Identity_2", "Identity_3", "Identity_4", "Identity_5")),
)
"""Outputs by whose names a head is told, in the order in which it reads them."""


class OnnxDetector:
    """A detector.

    Args:
        path: the ONNX file.
        labels: the name of a shipped map or a file of one; empty: what the file says itself.
        head: one of ``HEADS``; empty: told by inputs and outputs.
        side: of its input, pixels, where the file leaves that open.
        threads: of ONNX Runtime.

    Attributes:
        labels: what its classes are called.
        head: its name in ``HEADS``.
        size: height and width of its input, pixels.

    Raises:
        ValueError: missing, damaged, or not told what it is; one sentence.
    """

    def __init__(
        self, path: Path, labels: str | Path = "", head: str = "", side: int = 0, threads: int = 1
    ) -> None:
        if head and head not in HEADS:
            raise ValueError(f"found the head {head!r}, expected one of {', '.join(HEADS)}")
        try:
            self._session = open_session(path, threads)
        except ValueError as error:
            raise ValueError(f"found no usable detector at {path} ({error})") from error
        said = self._session.get_modelmeta().custom_metadata_map
        self.labels = load_labels(labels) if labels else _own_labels(path, said)
        outputs = {o.name: tuple(o.shape) for o in self._session.get_outputs()}
        self._given, *others = self._session.get_inputs()
        self._asks_size = next((other.name for other in others), "")
        self._planes, self.size = _layout(path, tuple(self._given.shape), side)
        told, names = recognise(outputs, self.labels.count, said, self.size)
        self.head, self._outputs = head or told, names if head in ("", told) else []
        if self.head not in HEADS:
            raise ValueError(
                f"found outputs {outputs} in {path}, which could be {told or 'anything'}; say "
                f"which head it has, one of {', '.join(HEADS)}, and the labels that it learnt"
            )
        try:
            self.found(np.zeros((*self.size, 3), np.uint8))
        except (IndexError, ValueError) as error:
            raise ValueError(
                f"found outputs {outputs} in {path}, which cannot be read as {self.head} ({error})"
            ) from error

    def __call__(self, rgb: np.ndarray, least: float = LEAST) -> list[Detection]:
        """What a picture shows, best first, by the names of the labels.

        Boxes without area in the picture are left out.

        Args:
            rgb: uint8 [H, W, 3].
            least: score.

        Raises:
            ValueError: it says a class that the labels lack, scores that are none, or places that
                are no numbers: a picture of which that is said is not one without things.
        """
        boxes, scores = self.found(rgb)
        if not np.all(scores <= 1 + ROUNDED):  # nan is not, either
            raise ValueError(
                f"found a score of {scores.max():g} in what the detector says, expected at most 1: "
                f"is {self.head} its head, and are its numbers whole?"
            )
        if not np.isfinite(boxes[scores.max(1, initial=0) >= least]).all():
            raise ValueError(
                "found a box that the detector is sure of at no numbers, expected 0..1"
            )
        boxes = boxes.clip(0, 1)
        whole = (boxes[:, 2:] > boxes[:, :2]).all(1, keepdims=True)
        at, classes = np.nonzero(whole & (scores >= least))
        sure = scores[at, classes].clip(0, 1)
        best = np.argsort(-sure, kind="stable")[:MOST]
        at, classes, sure = at[best], classes[best], sure[best]
        ends = boxes[at] * np.tile(rgb.shape[1::-1], 2)
        if HEADS[self.head].overlaps and len(at):
            corner = np.concatenate([ends[:, :2], ends[:, 2:] - ends[:, :2]], 1)
            kept = cv2.dnn.NMSBoxesBatched(
                corner.tolist(), sure.tolist(), classes.tolist(), least, OVERLAP
            )
            ends, sure, classes = ends[kept], sure[kept], classes[kept]
        found = [
            Detection(self.labels.name(str(number)), float(score), _box(box))
            for box, score, number in zip(ends, sure, classes, strict=True)
        ]
        return sorted(found, key=lambda one: -one.score)

    def found(self, rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All boxes before any choice, float [n, 4] in 0..1 of the picture, and scores [n, C].

        Args:
            rgb: uint8 [H, W, 3].
        """
        head = HEADS[self.head]
        fitted, (left, top, width, height) = head.given.of(rgb, self.size)
        given = {self._given.name: self._values(fitted)}
        if self._asks_size:
            given[self._asks_size] = np.array([self.size[::-1]], np.int64)
        outputs = self._session.run(self._outputs or None, given)
        boxes, scores = head.decode([part[0] for part in outputs], self.size, self.labels.count)
        if scores.shape[1] != self.labels.count:
            raise ValueError(
                f"found scores of {scores.shape[1]} classes, expected {self.labels.count}: choose "
                "the labels that this detector learnt"
            )
        return (boxes - [left, top, left, top]) / [width, height, width, height], scores

    def _values(self, fitted: np.ndarray) -> np.ndarray:
        values = HEADS[self.head].given.values(fitted)
        if self._planes:
            values = values.transpose(2, 0, 1)
        kind = {"tensor(uint8)": np.uint8, "tensor(float16)": np.float16}
        return np.ascontiguousarray(values[None], kind.get(self._given.type, np.float32))


def recognise(
    outputs: Mapping[str, Shape], classes: int, said: Mapping[str, str], size: tuple[int, int]
) -> tuple[str, list[str]]:
    """Tell a head by its outputs.

    Args:
        outputs: shapes by name.
        classes: that the detector has.
        said: what the file says of itself.
        size: height and width of its input, pixels.

    Returns:
        Its name, or several with "or" between them, or none; and the outputs that it reads, in
        order, none for all.
    """
    plain = {name.removesuffix(":0"): name for name in outputs}
    for head, names in _NAMED:
        if set(names) <= plain.keys():
            return head, [plain[name] for name in names]
    shapes = [*outputs.values()]
    if len(shapes) != 1 or len(shapes[0]) != 3:
        return "", []
    _, rows, columns = shapes[0]
    fits = {
        "yolov8": rows == 4 + classes,
        "yolov10": columns == 6,
        "rtdetr": columns == 4 + classes,
        "yolov5": columns == 5 + classes,
        "yolox": columns == 5 + classes and "stride" not in said,  # Ultralytics's exports say it
        **{name: of.fits(rows, columns, size, classes) for name, of in NANODETS.items()},
    }
    return " or ".join(head for head, fit in fits.items() if fit), []


def _own_labels(path: Path, said: Mapping[str, str]) -> LabelMap:
    """What the file says its classes are called.

    Raises:
        ValueError: it does not; one sentence.
    """
    try:
        names = ast.literal_eval(said["names"])
        names = dict(enumerate(names)) if isinstance(names, list | tuple) else dict(names)
        return LabelMap({int(number): str(name) for number, name in names.items()}).completed
    except (KeyError, ValueError, TypeError, SyntaxError):
        raise ValueError(
            f"found no names of classes in {path}; say which labels it learnt"
        ) from None


def _layout(path: Path, shape: Shape, side: int) -> tuple[bool, tuple[int, int]]:
    """Whether channels come first, and height and width.

    Raises:
        ValueError: it takes no pictures, or any size; one sentence.
    """
    if len(shape) != 4 or 3 not in (shape[1], shape[3]):
        raise ValueError(
            f"found the input {list(shape)} in {path}, expected pictures of 3 channels"
        )
    planes = shape[1] == 3
    high, wide = shape[2:] if planes else shape[1:3]
    if not isinstance(high, int) or not isinstance(wide, int):
        if not side:
            raise ValueError(f"found an input of any size in {path}; say which side it has, pixels")
        high = wide = side
    return planes, (high, wide)


def _box(ends: Sequence[float]) -> Box:
    left, top, right, bottom = map(float, ends)
    return left, top, right, bottom
