"""Floors and walls as a whole surface shows them: planks, tiles, carpet, paint, paper, in metres.

Unlike ``textures`` nothing repeats: each plank and tile has a tone of its own. Every function
returns float32 [H, W, 3] in 0..1 for a surface of a size, ``PER_METRE`` pixels a metre.
"""

from __future__ import annotations

import cv2
import numpy as np

from sim_bridge.room.parts import hsv

PER_METRE = 110
Surface = np.ndarray


def _pixels(width: float, height: float) -> tuple[int, int]:
    return max(round(height * PER_METRE), 8), max(round(width * PER_METRE), 8)


def clouds(rng: np.random.Generator, shape: tuple[int, int], cells: tuple[int, int]) -> np.ndarray:
    """Smooth noise, float32 [H, W] about 0 with a deviation of some 0.3; so many cells each way."""
    small = rng.random((max(cells[0], 2), max(cells[1], 2))).astype(np.float32) - 0.5
    return np.asarray(cv2.resize(small, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC))


def _boards(
    rng: np.random.Generator, shape: tuple[int, int], rise: float, length: float, shift: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Which board each pixel belongs to, int [H, W], and whether it is in a joint, bool [H, W]."""
    y, x = (np.arange(n) / PER_METRE for n in shape)
    row = (y / rise).astype(int)
    starts = rng.random(row[-1] + 1) if shift else np.zeros(row[-1] + 1)
    along = x[None] / length + starts[row][:, None]
    column = along.astype(int)
    joint = max(0.004, 0.9 / PER_METRE)
    seam = (y % rise < joint)[:, None] | (along % 1 * length < joint)
    return row[:, None] * (int(along.max()) + 2) + column, seam


def planks(rng: np.random.Generator, width: float, height: float) -> Surface:
    """Boards of wood or laminate, 9 to 20 cm wide."""
    shape = _pixels(width, height)
    rise, length = float(rng.uniform(0.09, 0.2)), float(rng.uniform(0.9, 1.9))
    board, seam = _boards(rng, shape, rise, length, True)
    tones = 1 + rng.uniform(0.04, 0.14) * rng.standard_normal(board.max() + 1)
    grain = clouds(rng, shape, (round(height * 90), round(width * 3)))
    grain += 0.5 * clouds(rng, shape, (round(height * 25), round(width * 1.5)))
    value = tones[board] * (1 + rng.uniform(0.1, 0.3) * grain)
    value[seam] *= rng.uniform(0.55, 0.8)
    # oak, beech, walnut, grey, whitewashed
    h, s, v = ((0.085, 0.42, 0.72), (0.075, 0.38, 0.82), (0.06, 0.5, 0.45), (0.08, 0.12, 0.62),
               (0.09, 0.14, 0.85), (0.055, 0.6, 0.55))[int(rng.integers(6))]  # fmt: skip
    wood = hsv(h, s * float(rng.uniform(0.8, 1.2)), v * float(rng.uniform(0.85, 1.1)))
    return _coloured(value, wood)


def tiles(rng: np.random.Generator, width: float, height: float, wall: bool = False) -> Surface:
    """Tiles of 20 to 45 cm with grout, on walls also smaller and oblong ones."""
    shape = _pixels(width, height)
    side = float(rng.choice([0.2, 0.3, 0.33, 0.4, 0.45] if not wall else [0.1, 0.15, 0.2, 0.25]))
    long = side * float(rng.choice([1, 1, 2] if not wall else [1, 2, 3]))
    # what all walls of a room share is drawn first
    colour, grey, shift, checked = _tile_colour(rng), rng.uniform(0.45, 0.85), *rng.random(2)
    spread, cloudy, dark = (
        float(rng.uniform(*r)) for r in ((0.005, 0.05), (0.02, 0.12), (0.35, 0.8))
    )
    tile, seam = _boards(rng, shape, side, long, long > side and bool(shift < 0.4))
    tones = 1 + spread * rng.standard_normal(tile.max() + 1)
    value = tones[tile] * (1 + cloudy * clouds(rng, shape, (9, 9)))
    out = _coloured(value, colour)
    if not wall and long == side and checked < 0.2:
        row, column = ((np.arange(n) / PER_METRE / side).astype(int) for n in shape)
        other = (row[:, None] + column[None]) % 2
        out[other == 1] *= dark
    out[seam] = out[seam] * 0.4 + 0.6 * grey
    return out


def _tile_colour(rng: np.random.Generator) -> tuple[float, float, float]:
    """White, beige, grey, terracotta or slate; seldom a colour."""
    kind = rng.random()
    if kind < 0.35:
        return hsv(0.12, float(rng.uniform(0, 0.06)), float(rng.uniform(0.85, 0.95)))
    if kind < 0.6:
        return hsv(float(rng.uniform(0.07, 0.12)), float(rng.uniform(0.12, 0.3)), 0.82)
    if kind < 0.82:
        return hsv(0.6, float(rng.uniform(0, 0.06)), float(rng.uniform(0.4, 0.75)))
    if kind < 0.92:
        return hsv(0.045, 0.5, float(rng.uniform(0.55, 0.7)))
    return hsv(float(rng.uniform(0.3, 0.65)), float(rng.uniform(0.1, 0.3)), 0.75)


def carpet(rng: np.random.Generator, width: float, height: float) -> Surface:
    """Wall-to-wall carpet, or linoleum, of a quiet colour."""
    shape = _pixels(width, height)
    speck = rng.uniform(0.02, 0.1) * rng.standard_normal(shape)
    value = 1 + speck + 0.06 * clouds(rng, shape, (12, 12))
    return _coloured(value, hsv(
        float(rng.choice([0.08, 0.1, 0.6, 0.02, 0.3])), float(rng.uniform(0.03, 0.25)),
        float(rng.uniform(0.4, 0.75)),
    ))  # fmt: skip


def paint(
    rng: np.random.Generator, width: float, height: float, colour: tuple[float, float, float]
) -> Surface:
    """A painted wall: nearly even."""
    shape = _pixels(width, height)
    return _coloured(1 + 0.015 * clouds(rng, shape, (round(height * 2), round(width * 2))), colour)


def paper(
    rng: np.random.Generator, width: float, height: float, colour: tuple[float, float, float]
) -> Surface:
    """Wallpaper: stripes, or a small pattern in rows."""
    shape = _pixels(width, height)
    y, x = (np.arange(n) / PER_METRE for n in shape)
    period = float(rng.uniform(0.08, 0.3))
    if rng.random() < 0.5:
        mark = np.broadcast_to((x % period < period * rng.uniform(0.3, 0.7))[None], shape)
    else:
        row = (y / period).astype(int)
        u = (x[None] / period + 0.5 * (row % 2)[:, None]) % 1 - 0.5
        v = ((y / period) % 1 - 0.5)[:, None]
        mark = np.abs(u) ** 1.2 + np.abs(v) ** 1.2 < rng.uniform(0.05, 0.25)
    return _coloured(np.where(mark, 1 - rng.uniform(0.03, 0.12), 1.0), colour)


def _coloured(value: np.ndarray, colour: tuple[float, float, float]) -> Surface:
    return (value[..., None] * np.asarray(colour)).clip(0, 1).astype(np.float32)


def outdoors(rng: np.random.Generator, size: int = 192) -> np.ndarray:
    """What a window shows, out of focus and brighter than the room: uint8 [N, N, 3]."""
    y = np.linspace(0, 1, size)[:, None, None]
    sky = np.asarray(hsv(0.58, float(rng.uniform(0.0, 0.3)), 1.0)) * (0.9 + 0.1 * y)
    out = np.broadcast_to(sky, (size, size, 3)).copy()
    horizon = rng.uniform(0.35, 0.8) + 0.15 * clouds(rng, (1, size), (2, 7))[0]
    far = y[..., 0] > horizon[None]
    if rng.random() < 0.5:  # houses
        blocks = np.repeat(rng.uniform(0.15, 0.6, 8), size // 8)
        far |= y[..., 0] > np.resize(blocks, size)[None]
    ground = np.asarray(hsv(float(rng.uniform(0.08, 0.35)), float(rng.uniform(0.05, 0.4)),
                            float(rng.uniform(0.5, 0.85))))  # fmt: skip
    out[far] = (ground * (1 + 0.5 * clouds(rng, (size, size), (14, 14)))[..., None])[far]
    out = np.asarray(cv2.GaussianBlur(out.astype(np.float32), (0, 0), float(rng.uniform(1.5, 4))))
    return ((0.25 + 0.75 * out).clip(0, 1) * 255).astype(np.uint8)


def art(rng: np.random.Generator, size: int = 192) -> np.ndarray:
    """A framed picture: a landscape, a photograph in grey, or fields of colour; often in a mount.

    uint8 [N, N, 3].
    """
    palette = [np.asarray(hsv(float(rng.random()), float(rng.uniform(0.1, 0.7)),
                              float(rng.uniform(0.25, 0.95)))) for _ in range(4)]  # fmt: skip
    y, x = np.mgrid[0:size, 0:size] / size
    kind = int(rng.integers(3))
    if kind == 0:
        out = palette[0] * (0.6 + 0.4 * y[..., None])
        for k, low in enumerate((0.45, 0.6, 0.75)):
            hill = low + 0.2 * clouds(rng, (1, size), (2, 4 + 3 * k))[0]
            out = np.where((y > hill[None])[..., None], palette[k + 1] * (1.1 - 0.25 * k), out)
    elif kind == 1:
        scene = clouds(rng, (size, size), (4, 4)) + 0.7 * clouds(rng, (size, size), (12, 12))
        out = (0.5 + 0.6 * scene)[..., None] * np.asarray(hsv(0.1, 0.1, 1.0))
    else:
        out = np.broadcast_to(palette[0], (size, size, 3))
        for k in range(1, 4):
            a, b, c = rng.uniform(-1, 1, 3)
            out = np.where((a * (x - 0.5) + b * (y - 0.5) > 0.3 * c)[..., None], palette[k], out)
    out = out * (1 + 0.15 * clouds(rng, (size, size), (40, 40)))[..., None]
    edge = np.minimum.reduce([y, x, 1 - y, 1 - x])[..., None]
    if rng.random() < 0.6:
        out = np.where(edge < rng.uniform(0.1, 0.22), 0.93, out)
    frames = ((0.08, 0.08, 0.08), (0.92, 0.92, 0.9), (0.45, 0.3, 0.18), (0.65, 0.52, 0.3))
    out = np.where(edge < rng.uniform(0.02, 0.06), frames[int(rng.integers(4))], out)
    return (out.clip(0, 1) * 255).astype(np.uint8)
