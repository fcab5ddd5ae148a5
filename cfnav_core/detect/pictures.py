"""How a picture is given to a detector: fitted into its input, and where it then lies there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

FITS = ("squeezed", "middle", "corner")
"""Resized whatever its shape; or at its aspect, in the middle or in the corner at the top left."""


@dataclass(frozen=True)
class Input:
    """What a kind of detector takes of a picture.

    Attributes:
        fit: one of ``FITS``.
        around: grey level of what the picture does not fill.
        blue_first: its channels are blue, green, red.
        mean, deviation: of each channel, in its order; (value - mean) / deviation is taken.
    """

    fit: str = "squeezed"
    around: int = 0
    blue_first: bool = False
    mean: Sequence[float] = (0, 0, 0)
    deviation: Sequence[float] = (1, 1, 1)

    def of(self, rgb: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Fit a picture.

        Args:
            rgb: uint8 [H, W, 3].
            size: height and width of the input, pixels.

        Returns:
            uint8 [*size, 3] in RGB, and where the picture lies there: left, top, width, height in
            0..1.
        """
        full = np.array(size[::-1])
        if self.fit == "squeezed":
            return _resized(rgb, full), np.array([0.0, 0.0, 1.0, 1.0])
        own = np.array(rgb.shape[1::-1])
        inner = np.maximum(1, np.round(own * (full / own).min()).astype(int))
        left, top = (full - inner) // 2 if self.fit == "middle" else (0, 0)
        out = np.full((*size, 3), self.around, np.uint8)
        out[top : top + inner[1], left : left + inner[0]] = _resized(rgb, inner)
        return out, np.concatenate([(left, top) / full, inner / full])

    def values(self, fitted: np.ndarray) -> np.ndarray:
        """A fitted picture as numbers, float32 [H, W, 3] in the detector's order of channels."""
        ordered = (fitted[..., ::-1] if self.blue_first else fitted).astype(np.float32)
        mean, deviation = (np.array(v, np.float32) for v in (self.mean, self.deviation))
        return np.asarray((ordered - mean) / deviation)


def _resized(rgb: np.ndarray, size: np.ndarray) -> np.ndarray:
    # Pillow: its bilinear averages when a picture gets smaller, as OpenCV's does not
    to = (int(size[0]), int(size[1]))
    return np.asarray(Image.fromarray(rgb).resize(to, Image.Resampling.BILINEAR))
