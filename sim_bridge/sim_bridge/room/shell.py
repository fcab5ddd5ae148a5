"""What is around the furniture: floor, walls, ceiling, door, windows, light and finishes."""

from __future__ import annotations

import math

import numpy as np

from sim_bridge.room.parts import Builder, Colour, Frame, Part, hsv
from sim_bridge.room.textures import SIZE, Texture

WALL_HEIGHT = 2.5
WOODS = ((0.05, 0.14), (0.25, 0.65), (0.45, 0.95))


def finish(rng: np.random.Generator) -> tuple[Colour, str]:
    """Colour and texture of some of a room's furniture."""
    if rng.random() < 0.65:
        h, s, v = (float(rng.uniform(*r)) for r in WOODS)
        return hsv(h, s, v), "wood"
    return hsv(
        float(rng.random()), float(rng.uniform(0, 0.3)), float(rng.uniform(0.5, 0.95))
    ), "paint"


def ceiling_light(b: Builder) -> tuple[tuple[float, float, float], Colour]:
    """Position (m) and colour of a lamp under the ceiling."""
    x, y = (float(b.rng.uniform(0.7, side - 0.7)) for side in (b.width, b.depth))
    k = float(b.rng.uniform(0.3, 0.45))
    warmth = float(b.rng.uniform(0.8, 1.0))
    return (x, y, WALL_HEIGHT - 0.1), (k, k * (1 + warmth) / 2, k * warmth)


def shell(b: Builder) -> str:
    """Floor, walls, ceiling, skirting, door and windows; returns the floor's texture."""
    walls(b)
    door(b)
    for _ in range(int(b.rng.integers(1, 3))):
        window(b)
    return str(b.rng.choice(["planks", "planks", "tile", "checker", "carpet"]))


def walls(b: Builder) -> None:
    """Floor, ceiling, walls that are painted or papered, and skirting."""
    rng, w, d, h = b.rng, b.width, b.depth, WALL_HEIGHT
    wall = hsv(float(rng.random()), float(rng.uniform(0, 0.25)), float(rng.uniform(0.72, 0.97)))
    paper = "wallpaper" if b.chance(0.25) else "paint"
    skirting = hsv(0.1, 0.1, float(rng.uniform(0.4, 1.0)))
    room = Frame(0, 0)
    b.add(b.new("Floor"), "box", room, (w / 2, d / 2, -0.05), (w / 2, d / 2, 0.05), (1, 1, 1),
          "floor", solid=False)  # fmt: skip
    b.add(b.new("Ceiling"), "box", room, (w / 2, d / 2, h + 0.05), (w / 2, d / 2, 0.05),
          (0.9, 0.9, 0.88), solid=False, emission=0.25)  # fmt: skip
    owner = b.new("Wall")
    for cx, cy, hx, hy in (
        (w / 2, -0.05, w / 2 + 0.1, 0.05), (w / 2, d + 0.05, w / 2 + 0.1, 0.05),
        (-0.05, d / 2, 0.05, d / 2), (w + 0.05, d / 2, 0.05, d / 2),
    ):  # fmt: skip
        b.add(owner, "box", room, (cx, cy, h / 2), (hx, hy, h / 2), wall, paper, 1.0)
        inset_x, inset_y = (
            (0.0, 0.056 * np.sign(d / 2 - cy)) if hx > hy else (0.056 * np.sign(w / 2 - cx), 0.0)
        )
        b.add(owner, "box", room, (cx + inset_x, cy + inset_y, 0.05),
              (hx - 0.1 if hx > hy else 0.006, 0.006 if hx > hy else hy, 0.05), skirting,
              solid=False)  # fmt: skip


def door(b: Builder) -> None:
    """A door leaf before a free stretch of wall."""
    frame = b.wall_spot(0.95, 0.0, 2.05)
    if frame is None:
        return
    owner = b.new("Door")
    colour = hsv(0.08, float(b.rng.uniform(0, 0.6)), float(b.rng.uniform(0.4, 0.95)))
    b.add(
        owner,
        "box",
        frame,
        (0, 0.008, 1.01),
        (0.45, 0.008, 1.01),
        colour,
        "panel_door",
        solid=False,
    )
    b.add(
        owner, "box", frame, (0.37, 0.03, 1.0), (0.05, 0.012, 0.012), (0.75, 0.7, 0.5), solid=False
    )


def window(b: Builder) -> None:
    """A view out of the window on a free stretch of wall."""
    w, h = float(b.rng.uniform(0.4, 0.7)), float(b.rng.uniform(0.35, 0.5))
    frame = b.wall_spot(2 * w, 1.55 - h, 1.55 + h)
    if frame is None:
        return
    b.add(b.new("Window"), "box", frame, (0, 0.01, 1.55), (w, 0.01, h), (1, 1, 1), "window_view",
          solid=False, emission=0.45)  # fmt: skip


def floor_picture(b: Builder, pattern: Texture) -> Texture:
    """The floor with soft contact shadows baked in, so that furniture does not float."""
    n, scale = 640, 640 / max(b.width, b.depth)
    metres_per_repeat = 1.2
    index = (np.arange(n) / scale / metres_per_repeat * SIZE).astype(int) % SIZE
    tint = hsv(
        float(b.rng.uniform(0.03, 0.13)) if b.chance(0.7) else float(b.rng.random()),
        float(b.rng.uniform(0.05, 0.5)), float(b.rng.uniform(0.5, 1.0)),
    )  # fmt: skip
    image = pattern[index[:, None], index[None]] / 255.0 * np.asarray(tint)
    h, w = (min(n, math.ceil(side * scale)) for side in (b.depth, b.width))
    light = np.maximum(floor_light(b, (h, w), scale), 0.35)
    shaded = np.clip(image[:h, :w] * light[..., None], 0, 1)
    return (shaded[::-1] * 255).astype(np.uint8)


def floor_light(b: Builder, shape: tuple[int, int], scale: float) -> np.ndarray:
    """What share of the light furniture and walls leave on the floor.

    Args:
        b: the furnished room.
        shape: of the picture, pixels; rows along y.
        scale: pixels a metre.

    Returns:
        float64 [H, W], 0..1.
    """
    h, w = shape
    light, under_models = np.ones((h, w)), np.ones((h, w))
    for part in b.parts:
        z_low = part.centre[2] - part.half[2]
        if part.solid and z_low <= 0.5 and part.half[2] <= 1.2:
            window, shade = _shade(light.shape, part, z_low, scale)
            if part.visible:
                light[window] *= shade
            else:  # the boxes of one model lie side by side and throw one shadow
                under_models[window] = np.minimum(under_models[window], shade)
    light *= under_models
    y, x = (np.arange(h) / scale)[:, None], (np.arange(w) / scale)[None]
    edge = np.minimum(np.minimum(x, b.width - x), np.minimum(y, b.depth - y))
    light *= 1 - 0.22 * np.exp(-np.maximum(edge, 0) / 0.12)
    return light


def _shade(
    shape: tuple[int, int], part: Part, z_low: float, scale: float
) -> tuple[tuple[slice, slice], np.ndarray]:
    """How dark the floor is under and beside one part; softer and wider the higher it hangs.

    Args:
        shape: of the floor's picture.
        part: above it.
        z_low: height of its underside, metres.
        scale: pixels a metre.

    Returns:
        Rows and columns of the picture, and the share of light that is left in them.
    """
    reach, depth = 0.06 + 0.3 * z_low, 0.5 * (1 - z_low / 0.6)
    radius = math.hypot(part.half[0], part.half[1]) + 2.5 * reach
    x0, y0 = (max(0, int((part.centre[i] - radius) * scale)) for i in (0, 1))
    x1, y1 = (max(0, int((part.centre[i] + radius) * scale) + 1) for i in (0, 1))
    y1, x1 = min(y1, shape[0]), min(x1, shape[1])
    dy = (np.arange(y0, y1) / scale - part.centre[1])[:, None]
    dx = (np.arange(x0, x1) / scale - part.centre[0])[None]
    c, s = math.cos(part.yaw), math.sin(part.yaw)
    u, v = np.abs(c * dx + s * dy), np.abs(c * dy - s * dx)
    distance = np.hypot(np.maximum(u - part.half[0], 0), np.maximum(v - part.half[1], 0))
    return (slice(y0, y1), slice(x0, x1)), 1 - depth * np.exp(-((distance / reach) ** 2))
