"""Pages of labelled tiles, and their files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from cfnav_core.perception.pictures import write_png


def on_pages(tiles: Iterable[np.ndarray], columns: int, rows: int) -> Iterator[np.ndarray]:
    """Lay tiles of one size out on pages.

    Args:
        tiles: uint8 [H, W, 3], in order.
        columns, rows: of a page.

    Yields:
        Pages, uint8 [rows * H, columns * W, 3]; the last with as many rows as it needs.
    """
    left = iter(tiles)
    while some := list(islice(left, columns * rows)):
        height, width = some[0].shape[:2]
        needed = math.ceil(len(some) / columns)
        page = np.full((needed * height, columns * width, 3), 255, np.uint8)
        for k, tile in enumerate(some):
            y, x = k // columns * height, k % columns * width
            page[y : y + height, x : x + width] = tile
        yield page


def labelled(tile: np.ndarray, *lines: str) -> np.ndarray:
    """The same with lines written below, black on a light strip."""
    out = np.ascontiguousarray(tile)
    top = out.shape[0] - 13 * len(lines) - 4
    out[top:] = (0.35 * out[top:] + 0.65 * 255).astype(np.uint8)
    for line, text in enumerate(lines):
        at = (4, top + 12 + 13 * line)
        cv2.putText(out, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.36, (0, 0, 0), 1, cv2.LINE_AA)
    return out


def write_pages(pages: Iterable[np.ndarray], folder: Path) -> int:
    """Write pages as ``page_001.png`` and so on, without those of before; returns how many.

    Raises:
        OSError: a file cannot be written.
    """
    count = 0
    for count, page in enumerate(pages, 1):
        write_png(folder / f"page_{count:03}.png", page)
    for old in folder.glob("page_*.png"):
        number = old.stem.removeprefix("page_")
        if number.isdecimal() and int(number) > count:
            old.unlink()
    return count
