"""What the models read: the columns of a detection table, and tables of knowledge."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from cfnav_core.models.base import Knowledge
from cfnav_core.task.detections import DETECTED_ABOVE, SIGHTINGS, Fields, columns, width
from cfnav_core.task.visibility import VISIBLE_DISTANCE_M

PICTURE_PX = 300
"""Side of the published pictures, pixels; their boxes are in pixels."""

VIEW_RAD = math.pi / 2
"""Angles of sightings are shares of such a view, which is that of the mast."""


class Rows(NamedTuple):
    """A detection table read, float32.

    Attributes:
        appearance: [B, C, A].
        info: [B, C, I].
        confidence: [B, C], 0..1.
        detected: [B, C], 0 or 1.
        context: [B, C, K], mostly in 0..1, zeros for an object that is not there. First comes
            whether it is there, then centre x and y (right and down positive) and the share of the
            picture that its box covers; of sightings the roots of its width and height instead,
            then how close it is and whether that is known.
    """

    appearance: Tensor
    info: Tensor
    confidence: Tensor
    detected: Tensor
    context: Tensor


@dataclass(frozen=True)
class Context:
    """How what a detector says of an object becomes the K numbers of ``Rows.context``.

    Attributes:
        needs: fields that it is made of.
        made: columns [...] of these fields -> [..., K].
        found: the context of an object that fills the middle of the picture.
    """

    needs: tuple[str, ...]
    made: Callable[..., Tensor]
    found: tuple[float, ...]


def _of_scores(score: Tensor, x: Tensor, y: Tensor, size: Tensor, near: Tensor) -> Tensor:
    return torch.stack([score, (x + score) / 2, (y + score) / 2, size * size, near], -1)


def _of_boxes(x1: Tensor, y1: Tensor, x2: Tensor, y2: Tensor, confidence: Tensor) -> Tensor:
    there = (confidence > 0).to(x1.dtype)
    area = (x2 - x1).abs() * (y2 - y1).abs() / PICTURE_PX**2
    x, y = (x1 + x2) / 2 / PICTURE_PX, (y1 + y2) / 2 / PICTURE_PX
    return torch.stack([there, x, y, area], -1)


def _of_sightings(
    confidence: Tensor, azimuth: Tensor, elevation: Tensor, width: Tensor, height: Tensor,
    distance: Tensor,
) -> Tensor:  # fmt: skip
    there = (confidence > 0).to(azimuth.dtype)
    known = (distance > 0).to(azimuth.dtype)
    x, y = (0.5 + azimuth / VIEW_RAD) * there, (0.5 - elevation / VIEW_RAD) * there
    # the root, as a thing of 5 degrees and one of 10 must differ as much as large ones do
    wide, high = (width / VIEW_RAD).sqrt(), (height / VIEW_RAD).sqrt()
    closeness = torch.exp(-distance / VISIBLE_DISTANCE_M) * known
    return torch.stack([confidence, x, y, wide, high, closeness, known], -1)


def _as_they_are(*columns: Tensor) -> Tensor:
    return torch.stack(columns, -1)


MIDDLE = (1.0, 0.5, 0.5, 0.25)

CONTEXTS = (
    Context(("score", "score_x", "score_y", "size", "near"), _of_scores, (*MIDDLE, 1.0)),
    Context(SIGHTINGS, _of_sightings, (1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 1.0)),
    Context(("x1", "y1", "x2", "y2", "confidence"), _of_boxes, MIDDLE),
    Context(("visible", "x", "y", "area"), _as_they_are, MIDDLE),
)
"""Fields that a context can be made of; a new kind of detector is a row here."""


@dataclass(frozen=True)
class Columns:
    """How the rows of a detection table are read, by the names of its fields.

    Attributes:
        appearance: columns that describe how the object looks; the whole row where there is no
            such description.
        info: columns with all else.
        confidence: the column with the detector's confidence, 0..1.
        threshold: the object counts as detected above this confidence.
        context: what it is made of, see ``Rows``.
        columns: those of the context.
    """

    appearance: slice
    info: slice
    confidence: int
    threshold: float
    context: Context
    columns: tuple[int, ...]

    @property
    def widths(self) -> tuple[int, int, int]:
        """A, I and K."""
        a, i = (part.stop - part.start for part in (self.appearance, self.info))
        return a, i, len(self.context.found)

    def read(self, detections: Tensor) -> Rows:
        """Split a detection table, float32 [B, C, D]."""
        confidence = detections[:, :, self.confidence]
        detected = (confidence > self.threshold).to(detections.dtype)
        return Rows(
            detections[:, :, self.appearance], detections[:, :, self.info], confidence, detected,
            self.context.made(*(detections[:, :, at] for at in self.columns)),
        )  # fmt: skip


def columns_of(fields: Fields) -> Columns:
    """How a table of these fields is read.

    Raises:
        ValueError: they do not say how surely and where an object is seen.
    """
    at, whole = columns(fields), slice(0, width(fields))
    sure = next((name for name in DETECTED_ABOVE if name in at), None)
    context = next((row for row in CONTEXTS if at.keys() >= set(row.needs)), None)
    if sure is None or context is None:
        kinds = "; ".join(", ".join(row.needs) for row in CONTEXTS)
        raise ValueError(
            f"found detections with the fields {', '.join(fields) or 'none'}, expected one of "
            f"these sets: {kinds}; or add a row to CONTEXTS in cfnav_core/models/parts/reading.py"
        )
    looks = at.get("appearance")
    info = slice(looks.stop, whole.stop) if looks else whole
    of_context = tuple(at[name].start for name in context.needs)
    return Columns(looks or whole, info, at[sure].start, DETECTED_ABOVE[sure], context, of_context)


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
