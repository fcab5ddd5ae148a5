"""A page of pictures with what was found in each: hits green, misses orange, false alarms red.

Where a network has boxes, those of what is shown are blue beside the hand-drawn ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from cfnav_core.perception.boxes import Box
from cfnav_core.perception.pictures import Colour, draw_box

TILE = 240
"""Side of a picture on the page, pixels."""

LINE, LINES = 15, 7
"""Height of a line of text, and how many of them a picture has below it."""

GREEN, ORANGE, RED, BLUE, BLACK = (0, 140, 0), (255, 120, 0), (220, 0, 0), (0, 90, 255), (0, 0, 0)

Words = Sequence[tuple[str, Colour]]


def words(
    names: Sequence[str], scores: np.ndarray, labels: np.ndarray, threshold: float
) -> list[tuple[str, Colour]]:
    """What to write below a picture: what is shown, found or not, then what is not and was found.

    Args:
        names: of the C categories.
        scores: float [C], NaN of categories that are not known.
        labels: int8 [C], see ``pictures.Crop``.
        threshold: at which a score counts.
    """
    order = np.argsort(-np.nan_to_num(scores), kind="stable")
    out = []
    for c in order:
        if labels[c] == 1:
            told = "not asked" if np.isnan(scores[c]) else f"{scores[c]:.2f}"
            out.append((f"{names[c]} {told}", GREEN if scores[c] >= threshold else ORANGE))
    wrong = [c for c in order if labels[c] == 0 and scores[c] >= threshold]
    return out + [(f"{names[c]} {scores[c]:.2f}", RED) for c in wrong]


def tile(
    rgb: np.ndarray, boxes: Sequence[tuple[Box, Colour]], title: str, below: Words
) -> np.ndarray:
    """One picture with boxes and words below, uint8 [H, TILE, 3]."""
    scale = TILE / max(rgb.shape[:2])
    size = (round(rgb.shape[1] * scale), round(rgb.shape[0] * scale))
    page = np.full((TILE + (LINES + 1) * LINE, TILE, 3), 255, np.uint8)
    small = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA))
    for (x0, y0, x1, y1), colour in boxes:
        draw_box(small, (x0 * scale, y0 * scale, x1 * scale, y1 * scale), colour)
    page[: size[1], : size[0]] = small
    for row, (text, colour) in enumerate([(title, BLACK), *below[:LINES]]):
        at = (2, TILE + row * LINE + 11)
        cv2.putText(page, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.38, colour, 1, cv2.LINE_AA)
    return page


def draw(tiles: Sequence[np.ndarray], path: Path, across: int = 6, quality: int = 80) -> None:
    """Lay tiles of one size out on a page and write it.

    Raises:
        OSError: the file cannot be written.
    """
    blank = np.full_like(tiles[0], 255)
    filled = [*tiles, *[blank] * (-len(tiles) % across)]
    rows = [np.hstack(filled[k : k + across]) for k in range(0, len(filled), across)]
    path.parent.mkdir(parents=True, exist_ok=True)
    page = np.vstack(rows)[..., ::-1]
    done, content = cv2.imencode(path.suffix, page, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise OSError(f"found no way to write a picture as {path.suffix}; name a .jpg or .png")
    path.write_bytes(content.tobytes())
