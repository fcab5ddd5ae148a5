"""Rooms as another camera sees them by another light than perception was trained with.

Stands for the change of domain between training and a real room (the paper's Section V-E). Strength
1 is a warm, dim evening through a plain lens; the magnitudes are ours, chosen once by what still
looks like the same room to people. Perception was trained on pictures whose colours were mixed
at random (``cfnav_core.perception.augment``); blur, vignette and a cast this strong it never met.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from PIL import Image, ImageFilter

CAST = (1.25, 0.95, 0.55)
"""Gain of red, green, blue under a lamp of about 2700 K with the white balance of daylight."""

EXPOSURE = 0.7
"""Gain of all."""

GAMMA = 1.3
"""Of the tone curve: shadows close."""

BLUR = 0.004
"""Standard deviation of the lens's blur, share of the picture's width."""

VIGNETTE = 0.45
"""Share of the light that the corners lose."""


def shifted(rgb: np.ndarray, strength: float) -> np.ndarray:
    """The same view by another light through another lens.

    Args:
        rgb: uint8 [H, W, 3].
        strength: 0 changes nothing, 1 is the evening described above; linear between them.

    Returns:
        uint8 [H, W, 3].
    """
    if strength == 0:
        return rgb
    tones = _tones(strength)
    toned = np.stack([tones[c].take(rgb[..., c]) for c in range(3)], axis=2)
    lit = np.rint(toned * _vignette(*rgb.shape[:2], strength)).astype(np.uint8)
    blur = ImageFilter.GaussianBlur(strength * BLUR * rgb.shape[1])
    # Pillow: recorded results are of its blur, from which OpenCV's differs.
    return np.asarray(Image.fromarray(lit).filter(blur))


@lru_cache
def _tones(strength: float) -> np.ndarray:
    """float32 [3, 256]: what becomes of each level of each channel."""
    gains = 1 + strength * (np.array(CAST) * EXPOSURE - 1)
    levels = np.minimum(np.linspace(0, 1, 256) * gains[:, None], 1)
    return (255 * levels ** (1 + strength * (GAMMA - 1))).astype(np.float32)


@lru_cache
def _vignette(height: int, width: int, strength: float) -> np.ndarray:
    """float32 [H, W, 1]: share of the light that arrives."""
    y, x = (np.linspace(-1, 1, n, dtype=np.float32) for n in (height, width))
    return (1 - strength * VIGNETTE * (y[:, None] ** 2 + x**2) / 2)[..., None]
