"""Picture features and detections of a published scene, state by state, in one form."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.published.boxes import box_rows, read_boxes
from cfnav_core.published.keys import Key
from cfnav_core.published.state_file import StateFile
from cfnav_core.scenes.layouts import DETECTOR_OBJECTS
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.vocabulary import DATA1_TARGETS

MAP_CHANNELS, MAP_SIDE = (512, 2048), 7
"""ResNet18 and CLIP RN50."""

TABLE_WIDTH, DETR_WIDTH = 517, 264
"""Of a detector table: 512 of appearance, x1 y1 x2 y2 in pixels, confidence; and of DETR's."""

_ROWS = {
    len(DATA1_TARGETS): list(range(len(DATA1_TARGETS))),
    len(DETECTOR_OBJECTS): [DETECTOR_OBJECTS.index(name) for name in DATA1_TARGETS],
}


@dataclass(frozen=True)
class ArrayFile:
    """One file of numbers for every state.

    Attributes:
        path: the file.
        known: keys that have numbers.
        bad: names in the file that are no usable keys, with why.
        row: float16 numbers of a state; SceneError says what is wrong with them.
        look: the same check of their shape without reading them.
    """

    path: Path
    known: Collection[Key]
    bad: Mapping[str, str]
    row: Callable[[Key], np.ndarray]
    look: Callable[[Key], object]


@contextmanager
def open_features(path: Path) -> Iterator[ArrayFile]:
    """Picture features, float16 [512 or 2048, 7, 7] a state.

    Raises:
        SceneError: the file cannot be read.
    """
    with closing(StateFile(path)) as file:
        yield ArrayFile(
            path, file.names.keys(), file.bad,
            row=lambda key: _half((full := file.read(key)).reshape(map_shape(full.shape))),
            look=lambda key: map_shape(file.shape(key)),
        )  # fmt: skip


@contextmanager
def open_detections(path: Path, objects: tuple[str, ...]) -> Iterator[ArrayFile]:
    """Detections, float16 [C, D] a state: detector tables (.hdf5) or true boxes (.json).

    Raises:
        SceneError: the file cannot be read.
    """
    if path.suffix == ".json":
        boxes, bad = read_boxes(path)

        def boxes_of(key: Key) -> np.ndarray:
            return _half(box_rows(boxes[key], objects))

        yield ArrayFile(path, boxes.keys(), bad, boxes_of, boxes_of)
        return
    with closing(StateFile(path)) as file:
        yield ArrayFile(
            path, file.names.keys(), file.bad,
            row=lambda key: _half((full := file.read(key))[table_rows(full.shape)]),
            look=lambda key: table_rows(file.shape(key)),
        )  # fmt: skip


def map_shape(shape: tuple[int, ...]) -> tuple[int, int, int]:
    """(channels, 7, 7) of a feature map with or without a leading axis of one.

    Raises:
        SceneError: it is no ResNet18 or CLIP map.
    """
    inner = shape[1:] if shape[:1] == (1,) else shape
    if len(inner) != 3 or inner[0] not in MAP_CHANNELS or inner[1:] != (MAP_SIDE, MAP_SIDE):
        raise SceneError(
            f"found features of shape {shape}, expected (512, 7, 7) of ResNet18 or (2048, 7, 7) "
            "of CLIP RN50, with or without a leading 1"
        )
    return inner[0], MAP_SIDE, MAP_SIDE


def table_rows(shape: tuple[int, ...]) -> list[int]:
    """Rows of a detector table that are the 22 targets of Offline Data 1, in their order.

    Raises:
        SceneError: it is no table of 22 or 60 rows.
    """
    if len(shape) == 2 and shape[1] == DETR_WIDTH:
        raise SceneError(
            f"found DETR detections with rows of {DETR_WIDTH}, which are not read here; take the "
            "detector tables det_feature_22_cates.hdf5"
        )
    if len(shape) != 2 or shape[0] not in _ROWS or shape[1] != TABLE_WIDTH:
        raise SceneError(f"found detections of shape {shape}, expected (22, 517) or (60, 517)")
    return _ROWS[shape[0]]


def _half(numbers: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        half = numbers.astype(np.float16)
    if not np.isfinite(half).all():
        raise SceneError(
            "found numbers that are not finite (or above 65504), expected finite ones; download "
            "the file again"
        )
    return half
