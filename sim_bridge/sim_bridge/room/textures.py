"""Procedural textures: small seamless pictures computed from a random generator.

Every function returns uint8 [N, N, 3]. Knows nothing of rooms or MuJoCo.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

SIZE = 128
Texture = np.ndarray


def noise(rng: np.random.Generator, size: int = SIZE, stretch: tuple[int, int] = (1, 1)) -> Texture:
    """Seamless value noise in 0..1, float64 [size, size]; ``stretch`` draws it out along (y, x)."""
    out, amplitude = np.zeros((size, size)), 1.0
    for octave in range(5):
        cells = 2 ** (octave + 2)
        ny, nx = max(1, cells // stretch[0]), max(1, cells // stretch[1])
        lattice = np.pad(rng.random((ny, nx)), ((0, 1), (0, 1)), mode="wrap")
        y, x = np.arange(size) * ny / size, np.arange(size) * nx / size
        yi, xi = y.astype(int), x.astype(int)
        fy, fx = (y - yi)[:, None], (x - xi)[None]
        fx = fx * fx * (3 - 2 * fx)
        top = lattice[yi][:, xi] * (1 - fx) + lattice[yi][:, xi + 1] * fx
        bottom = lattice[yi + 1][:, xi] * (1 - fx) + lattice[yi + 1][:, xi + 1] * fx
        out += amplitude * (top * (1 - fy) + bottom * fy)
        amplitude *= 0.55
    return (out - out.min()) / np.ptp(out)


def _to_bytes(value: np.ndarray, colour: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Texture:
    if value.ndim == 2:
        value = value[..., None] * np.asarray(colour)
    return (np.clip(value, 0, 1) * 255).astype(np.uint8)


def paint(rng: np.random.Generator) -> Texture:
    return _to_bytes(0.94 + 0.06 * noise(rng))


def wallpaper(rng: np.random.Generator) -> Texture:
    stripes = ((np.arange(SIZE) // int(rng.choice([8, 16]))) % 2)[None] * rng.uniform(0.05, 0.14)
    return _to_bytes(0.97 - stripes - 0.05 * noise(rng))


def wood(rng: np.random.Generator) -> Texture:
    return _to_bytes(0.62 + 0.38 * noise(rng, stretch=(1, 16)), (1.0, 0.93, 0.85))


def planks(rng: np.random.Generator) -> Texture:
    value = 0.68 + 0.32 * noise(rng, stretch=(1, 16))
    rows = int(rng.choice([4, 8]))
    height = SIZE // rows
    for row in range(rows):
        band = slice(row * height, (row + 1) * height)
        value[band] *= rng.uniform(0.82, 1.0)
        value[row * height] *= 0.6
        joint = int(rng.integers(SIZE))
        value[band, joint : joint + 1] *= 0.6
    return _to_bytes(value, (1.0, 0.95, 0.88))


def tile(rng: np.random.Generator) -> Texture:
    value = 0.93 + 0.07 * noise(rng)
    step = SIZE // int(rng.choice([2, 4]))
    value[::step] = value[1::step] = 0.62
    value[:, ::step] = value[:, 1::step] = 0.62
    return _to_bytes(value)


def checker(rng: np.random.Generator) -> Texture:
    step = SIZE // int(rng.choice([2, 4]))
    cells = (np.indices((SIZE, SIZE)) // step).sum(0) % 2
    return _to_bytes((1 - rng.uniform(0.25, 0.6) * cells) * (0.93 + 0.07 * noise(rng)))


def marble(rng: np.random.Generator) -> Texture:
    veins = np.abs(2 * noise(rng) - 1) ** 0.4
    return _to_bytes(1 - 0.4 * (1 - veins), (0.97, 0.97, 1.0))


def steel(rng: np.random.Generator) -> Texture:
    return _to_bytes(0.8 + 0.2 * noise(rng, stretch=(16, 1)), (0.96, 0.98, 1.0))


def fabric(rng: np.random.Generator) -> Texture:
    weave = 0.88 + 0.12 * ((np.indices((SIZE, SIZE)).sum(0) // 2) % 2)
    return _to_bytes(weave * (0.85 + 0.15 * noise(rng)))


def stripes(rng: np.random.Generator) -> Texture:
    period = int(rng.choice([16, 32]))
    band = (np.arange(SIZE) // (period // 2)) % 2
    return _to_bytes((1 - rng.uniform(0.2, 0.5) * band)[:, None] * (0.92 + 0.08 * noise(rng)))


def carpet(rng: np.random.Generator) -> Texture:
    return _to_bytes(0.8 + 0.1 * noise(rng) + 0.1 * rng.random((SIZE, SIZE)))


def panel_door(rng: np.random.Generator) -> Texture:
    value = np.full((SIZE, SIZE), 0.96)
    value[6:-6, 6:-6] = 0.78
    value[12:-12, 12:-12] = 0.93
    return _to_bytes(value * (0.93 + 0.07 * noise(rng, stretch=(16, 1))))


def oven(rng: np.random.Generator) -> Texture:
    value = np.full((SIZE, SIZE), 0.85)
    value[38:112, 14:-14] = 0.12
    value[6:26, 8:-8] = 0.5
    for knob in range(5):
        value[10:22, 16 + knob * 21 : 28 + knob * 21] = 0.1
    return _to_bytes(value * rng.uniform(0.75, 1.0))


def microwave(rng: np.random.Generator) -> Texture:
    value = np.full((SIZE, SIZE, 3), 0.55)
    value[16:-16, 8:88] = 0.06
    value[16:-16, 96:-6] = 0.3
    value[24:40, 99:-9] = (0.2, 0.95, 0.5)
    for row in range(3):
        for column in range(3):
            y, x = 54 + row * 16, 99 + column * 8
            value[y : y + 9, x : x + 6] = 0.8
    return _to_bytes(value)


def window_view(rng: np.random.Generator) -> Texture:
    y = np.linspace(0, 1, SIZE)[:, None]
    value = np.stack([0.55 + 0.35 * y, 0.75 + 0.2 * y, 1 + 0 * y], -1).repeat(SIZE, 1)
    skyline = (SIZE * (0.62 + 0.12 * noise(rng)[0])).astype(int)
    value[np.arange(SIZE)[:, None] > skyline[None]] = (0.36, 0.52 + 0.1 * rng.random(), 0.28)
    value[:6] = value[-6:] = value[61:67] = 0.97
    value[:, :6] = value[:, -6:] = value[:, 61:67] = 0.97
    return _to_bytes(value)


def leaf(rng: np.random.Generator) -> Texture:
    return _to_bytes(0.45 + 0.55 * noise(rng), (0.55, 1.0, 0.45))


def book_cover(rng: np.random.Generator) -> Texture:
    value = np.ones((SIZE, SIZE, 3))
    value[14:34, 20:-14] = (0.98, 0.95, 0.8)
    value[44:52, 28:-22] = (0.98, 0.95, 0.8)
    value[70:112, 34:-30] = rng.random(3)
    value[:, :8] *= 0.55
    return _to_bytes(value)


def picture(rng: np.random.Generator) -> Texture:
    """An abstract painting in a dark frame: blobs and a horizon in saturated colours."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    value = np.where((y > rng.uniform(0.4, 0.7))[..., None], rng.random(3), rng.random(3))
    for _ in range(int(rng.integers(3, 7))):
        cy, cx, ry, rx = rng.random(2).tolist() + rng.uniform(0.08, 0.3, 2).tolist()
        value = np.where(
            (((y - cy) / ry) ** 2 + ((x - cx) / rx) ** 2 < 1)[..., None], rng.random(3), value
        )
    frame = (np.minimum.reduce([y, x, 1 - y, 1 - x]) < 0.07)[..., None]
    return _to_bytes(np.where(frame, np.asarray((0.2, 0.13, 0.07)) * rng.uniform(0.5, 2.5), value))


def screen(rng: np.random.Generator) -> Texture:
    """A lit desktop: coloured background with two windows."""
    value = np.ones((SIZE, SIZE, 3)) * (0.15, 0.4, 0.8)
    value[20:90, 12:70] = 0.95
    value[26:30, 18:60] = value[38:42, 18:64] = value[50:54, 18:52] = 0.4
    value[40:108, 60:116] = (0.95, 0.9, 0.75)
    value[112:] = (0.1, 0.12, 0.2)
    return _to_bytes(value)


def television(rng: np.random.Generator) -> Texture:
    """A dark television picture: night blue with a few lights."""
    value = np.ones((SIZE, SIZE, 3)) * (0.04, 0.05, 0.09)
    value += noise(rng)[..., None] * (0.03, 0.06, 0.16)
    value[:4] = value[-4:] = value[:, :4] = value[:, -4:] = 0.02
    return _to_bytes(value)


def keyboard(rng: np.random.Generator) -> Texture:
    keys = np.indices((SIZE, SIZE)) % 12
    value = np.where((keys > 2).all(0), 0.12, 0.6)
    value[92:] = 0.6
    value[96:122, 44:84] = 0.45
    return _to_bytes(value)


def clock_face(rng: np.random.Generator) -> Texture:
    value = np.ones((SIZE, SIZE, 3)) * 0.05
    digits = np.zeros((SIZE, SIZE), bool)
    for column in (12, 38, 72, 98):
        digits[36:92, column : column + 6] = digits[36:92, column + 12 : column + 18] = True
        digits[36:42, column : column + 18] = digits[86:92, column : column + 18] = True
        if rng.random() < 0.7:
            digits[61:67, column : column + 18] = True
    digits[50:56, 61:67] = digits[72:78, 61:67] = True
    value[digits] = (1.0, 0.25, 0.1)
    return _to_bytes(value)


def slats(rng: np.random.Generator) -> Texture:
    """Venetian blinds: light slats with dark gaps."""
    row = np.arange(SIZE) % 8
    value = np.where(row < 2, 0.45, 0.85 + 0.02 * row)[:, None].repeat(SIZE, 1)
    value[:, 30:32] = value[:, 96:98] = 0.6
    return _to_bytes(value)


def mirror_glass(rng: np.random.Generator) -> Texture:
    """The look of a mirror without a second rendering: cool gradient with a diagonal gleam."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    value = np.stack([0.62 + 0.2 * (1 - y), 0.74 + 0.16 * (1 - y), 0.84 + 0.12 * (1 - y)], -1)
    value[np.abs(x + y - 0.9) < 0.08] += 0.1
    value[np.abs(x + y - 1.15) < 0.03] += 0.08
    edge = np.minimum.reduce([y, x, 1 - y, 1 - x]) < 0.05
    value[edge] = (0.3, 0.3, 0.33)
    return _to_bytes(value)


def disc(rng: np.random.Generator) -> Texture:
    """A CD in its case: rainbow ring on white."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE - 0.5
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    value = np.ones((SIZE, SIZE, 3)) * (0.1, 0.1, 0.12)
    hue = np.stack([0.75 + 0.25 * np.cos(2 * angle + k * 2.1) for k in range(3)], -1)
    value = np.where(((radius < 0.46) & (radius > 0.1))[..., None], hue, value)
    return _to_bytes(value)


def bread(rng: np.random.Generator) -> Texture:
    value = np.ones((SIZE, SIZE, 3)) * (0.85, 0.58, 0.28) * (0.8 + 0.2 * noise(rng)[..., None])
    value[:, ::26] = value[:, 1::26] = (0.97, 0.88, 0.65)
    return _to_bytes(value)


TEXTURES: dict[str, Callable[[np.random.Generator], Texture]] = {
    f.__name__: f
    for f in (
        paint, wallpaper, wood, planks, tile, checker, marble, steel, fabric, stripes, carpet,
        panel_door, oven, microwave, window_view, leaf, book_cover, picture, screen, television,
        keyboard, clock_face, slats, mirror_glass, disc, bread,
    )
}  # fmt: skip
"""Every texture by name."""
