"""What the models read: the columns of a detection table, and tables of knowledge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from cfnav_core.models.base import Knowledge

PICTURE_PX = 300
"""Side of the published pictures, pixels; their boxes are in pixels."""


class Rows(NamedTuple):
    """A detection table read, float32.

    Attributes:
        appearance: [B, C, A].
        info: [B, C, I].
        confidence: [B, C], 0..1.
        detected: [B, C], 0 or 1.
        context: [B, C, K] in 0..1, zeros for an object that is not there. First comes whether it
            is there, then centre x and y (right and down positive) and the share of the picture
            that its box covers.
    """

    appearance: Tensor
    info: Tensor
    confidence: Tensor
    detected: Tensor
    context: Tensor


@dataclass(frozen=True)
class Columns:
    """How the rows of one kind of detection table are read.

    Attributes:
        appearance: columns that describe how the object looks; the whole row where there is no
            such description.
        info: columns with box and confidence.
        confidence: the column with the detector's confidence, 0..1.
        threshold: the object counts as detected above this confidence.
        context: rows [..., D] -> [..., K], see ``Rows``.
        found: the context, K numbers, of an object that fills the middle of the picture.
    """

    appearance: slice
    info: slice
    confidence: int
    threshold: float
    context: Callable[[Tensor], Tensor]
    found: tuple[float, ...]

    @property
    def widths(self) -> tuple[int, int, int]:
        """A, I and K."""
        a, i = (part.stop - part.start for part in (self.appearance, self.info))
        return a, i, len(self.found)

    def read(self, detections: Tensor) -> Rows:
        """Split a detection table, float32 [B, C, D]."""
        confidence = detections[:, :, self.confidence]
        detected = (confidence > self.threshold).to(detections.dtype)
        return Rows(
            detections[:, :, self.appearance], detections[:, :, self.info], confidence, detected,
            self.context(detections),
        )  # fmt: skip


def _built_in_context(rows: Tensor) -> Tensor:
    score, x, y, size, near = rows.unbind(-1)
    return torch.stack([score, (x + score) / 2, (y + score) / 2, size * size, near], -1)


def _pixel_context(rows: Tensor) -> Tensor:
    x1, y1, x2, y2, confidence = rows[..., 512:].unbind(-1)
    there = (confidence > 0).to(rows.dtype)
    area = (x2 - x1).abs() * (y2 - y1).abs() / PICTURE_PX**2
    x, y = (x1 + x2) / 2 / PICTURE_PX, (y1 + y2) / 2 / PICTURE_PX
    return torch.stack([there, x, y, area], -1)


def _stored_context(rows: Tensor) -> Tensor:
    return rows


MIDDLE = (1.0, 0.5, 0.5, 0.25)

COLUMNS = {
    # the built-in perception: score, x * score, y * score, sqrt of the seen share, near
    5: Columns(slice(0, 5), slice(0, 5), 0, 0.5, _built_in_context, (*MIDDLE, 1.0)),
    # Offline Data 1: 512 of appearance, x1, y1, x2, y2 in pixels, confidence
    517: Columns(slice(0, 512), slice(512, 517), 516, 0.0, _pixel_context, MIDDLE),
    # Offline Data 2: visible, mean x, mean y, area of the hull, all in 0..1
    4: Columns(slice(0, 4), slice(0, 4), 0, 0.0, _stored_context, MIDDLE),
}
"""Width D of the detection table to its meaning."""


def columns_of(width: int) -> Columns:
    """How a table of this width is read.

    Raises:
        ValueError: no known table has this width.
    """
    if width not in COLUMNS:
        raise ValueError(
            f"found detections of {width} numbers an object, expected one of {sorted(COLUMNS)}; "
            "add a row to COLUMNS in cfnav_core/models/reading.py that says what they mean"
        )
    return COLUMNS[width]


def table(knowledge: Knowledge, name: str, *shape: int | None) -> Tensor:
    """One table of knowledge, float32, checked against a shape (None fits any length).

    Raises:
        ValueError: it is missing or of another shape.
    """
    (found,) = knowledge.need(name)
    fits = found.ndim == len(shape) and all(
        n in (None, m) for n, m in zip(shape, found.shape, strict=True)
    )
    if not fits:
        expected = ", ".join("any" if n is None else str(n) for n in shape)
        raise ValueError(
            f"found {name} of shape {tuple(found.shape)}, expected ({expected}); make them with "
            "cfnav data knowledge from scenes with the same objects"
        )
    return found


def similarities(words: Tensor) -> Tensor:
    """Cosine similarity of every object's word vector [C, W] with every other's, [C, C]."""
    unit = torch.nn.functional.normalize(words, dim=1)
    return unit @ unit.T
