"""Picture files: read them, cut them to a network's shape, draw boxes into them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from cfnav_core.files.whole import write_file
from cfnav_core.perception.boxes import Box, Detection

Colour = tuple[int, int, int]
"""Red, green, blue, 0..255."""

MARK: Colour = (230, 0, 90)


def read_rgb(path: Path) -> np.ndarray:
    """A picture file as uint8 [H, W, 3]; what is transparent becomes white.

    Raises:
        OSError: missing or damaged.
    """
    try:
        with Image.open(path) as image:
            if image.mode not in {"RGBA", "LA", "P"}:
                return np.asarray(image.convert("RGB"))
            white = Image.new("RGBA", image.size, "white")
            return np.asarray(Image.alpha_composite(white, image.convert("RGBA")).convert("RGB"))
    except OSError as error:
        raise OSError(
            f"found no readable picture at {path} ({error}); name a PNG or JPEG"
        ) from error


def window(width: int, height: int, aspect: float) -> tuple[int, int, int, int]:
    """The largest centred cut of an aspect (width through height): left, top, right, bottom."""
    wide, high = min(width, round(height * aspect)), min(height, round(width / aspect))
    left, top = (width - wide) // 2, (height - high) // 2
    return left, top, left + wide, top + high


def draw_box(rgb: np.ndarray, box: Box, colour: Colour, text: str = "") -> None:
    """Draw a box into a picture, uint8 [H, W, 3], its text within its upper edge."""
    left, top, right, bottom = (round(end) for end in box)
    if text:
        at = (left + 2, top + 11)
        for shade, thick in (((255, 255, 255), 3), (colour, 1)):
            cv2.putText(rgb, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.38, shade, thick, cv2.LINE_AA)
    cv2.rectangle(rgb, (left, top), (right - 1, bottom - 1), colour, 1)


def draw_detections(rgb: np.ndarray, found: Sequence[Detection]) -> np.ndarray:
    """A picture with its detections drawn in, uint8 [H, W, 3]; the best on top."""
    out = rgb.copy()
    for one in reversed(found):
        draw_box(out, one.box, MARK, f"{one.name} {one.score:.2f}")
    return out


def write_png(path: Path, rgb: np.ndarray) -> None:
    """Write a picture, uint8 [H, W, 3].

    Raises:
        WriteError: the disk is full or refuses.
    """
    done, content = cv2.imencode(".png", rgb[..., ::-1])
    assert done
    write_file(path, content.tobytes())
