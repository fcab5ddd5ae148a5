"""Named detections with boxes, out of the built-in network's maps of where a category is shown.

A map has the probability that a cell of the picture shows the category. Cells above ``least`` that
touch, also at corners, are one detection; its score is the best of them. Its box holds what is
joined to that best cell above ``SHARE`` of the score, and ends where the probability between two
cells falls to it. ``python -m studies.eyes.boxes`` measures other rules.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from cfnav_core.perception.sight import CELL
from cfnav_core.task.detections import DETECTED_ABOVE

SHARE = 0.7
"""Of the 0.3 to 0.9 that were tried it gives the boxes that fit best."""

LEAST = DETECTED_ABOVE["score"]

Box = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels; right and bottom are where the next pixel begins."""

_TOUCHING = np.ones((3, 3), bool)


@dataclass(frozen=True)
class Detection:
    """One thing in a picture.

    Attributes:
        name: of its category.
        score: 0..1.
        box: in pixels of the picture.
    """

    name: str
    score: float
    box: Box


def decode(
    shown: np.ndarray, names: Sequence[str], taken: tuple[int, int], size: tuple[int, int],
    least: float = LEAST, share: float = SHARE, between_cells: bool = True,
) -> list[Detection]:  # fmt: skip
    """Detections in a picture, best first.

    Args:
        shown: float [C, *Q], probabilities 0..1; cells of ``CELL`` pixels of what the network
            takes, centred on it.
        names: of the C categories.
        taken: height and width of what the network takes, pixels.
        size: width and height of the picture that was scaled to it, pixels.
        least: score.
        share: of the score that belongs to the box.
        between_cells: edges lie between cells; else at the edges of cells.
    """
    found = []
    for name, cells in zip(names, shown, strict=True):
        things, count = label(cells >= least, _TOUCHING)
        for thing in range(1, count + 1):
            best = int(np.where(things == thing, cells, -1).argmax())
            score = float(cells.flat[best])
            joined, _ = label(cells >= share * score, _TOUCHING)
            inside = joined == joined.flat[best]
            left, right = _ends(cells, inside, share * score, between_cells)
            top, bottom = _ends(cells.T, inside.T, share * score, between_cells)
            x0, x1 = _pixels(left, right, cells.shape[1], taken[1], size[0])
            y0, y1 = _pixels(top, bottom, cells.shape[0], taken[0], size[1])
            found.append(Detection(name, score, (x0, y0, x1, y1)))
    return sorted(found, key=lambda one: -one.score)


def _ends(
    cells: np.ndarray, inside: np.ndarray, level: float, between: bool
) -> tuple[float, float]:
    """First and last column of what is inside, in cells."""
    columns = np.flatnonzero(inside.any(0))
    first, last = int(columns[0]), int(columns[-1])

    def reach(edge: int, beyond: int) -> float:
        """How far it goes on from the middle of its outermost cells, 0..1."""
        here = inside[:, edge]
        within, without = cells[here, edge], cells[here, beyond]
        return float(((within - level) / (within - without)).max()) if between else 0.5

    # what reaches the outermost cells is taken to be cut off by the picture
    left = first + 0.5 - reach(first, first - 1) if first else 0.0
    right = last + 0.5 + reach(last, last + 1) if last + 1 < cells.shape[1] else last + 1.0
    return left, right


def _pixels(low: float, high: float, cells: int, taken: int, size: int) -> tuple[float, float]:
    """Ends in cells as pixels of the picture, along one axis."""
    spare = (cells * CELL - taken) / 2
    first, last = ((end * CELL - spare) * size / taken for end in (low, high))
    return max(first, 0.0), min(last, float(size))
