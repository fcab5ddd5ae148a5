"""Walls, floor and ceiling of a room with their light baked in, for rooms with models of furniture.

MuJoCo lights a surface at its corners only, so what a lamp, a window and a dark corner do to a wall
is painted on it. A room may be L-shaped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np

from sim_bridge.room import materials as ma
from sim_bridge.room.parts import Builder, Colour, Frame, Stretch, hsv, outer_walls
from sim_bridge.room.shell import WALL_HEIGHT, floor_light

SPACING_M = 0.1
"""Of the points at which light is worked out."""
REFLECTED = 0.9
"""Light from everywhere, beside what comes straight from lamps and windows."""
CONTRAST = 0.55
COARSER = 3
"""Of the picture of shadows on the floor."""

FLOORS = {
    "kitchen": (ma.tiles, ma.tiles, ma.planks),
    "living_room": (ma.planks, ma.planks, ma.planks, ma.carpet, ma.tiles),
    "bedroom": (ma.planks, ma.planks, ma.carpet),
    "bathroom": (ma.tiles,),
}

Vector = tuple[float, float, float]
Light = tuple[tuple[float, float, float], Colour]


@dataclass(frozen=True)
class Pane:
    """A window as a source of light: its wall's frame below it, bottom, width, height, metres."""

    frame: Frame
    low: float
    width: float
    height: float


@dataclass
class Surroundings:
    """What is around the furniture of a room.

    Attributes:
        b: what it is part of.
        room_type: one of ``cfnav_core.task.vocabulary.ROOM_TYPES``.
        wall: colour of its walls.
        daylight: how bright it is outside, 0..1.
        emission: what walls send back of the light that is around, 0..1.
        panes: its windows. lamps: positions of its lamps, metres, and their colours.
    """

    b: Builder
    room_type: str
    wall: Colour = (1.0, 1.0, 1.0)
    daylight: float = 1.0
    emission: float = 0.3
    panes: list[Pane] = field(default_factory=list)
    lamps: list[Light] = field(default_factory=list)

    def build(self) -> None:
        """Add the solid walls, and what is seen of them, of floor and ceiling."""
        b, rng = self.b, self.b.rng
        self.wall, self.daylight = wall_colour(rng), float(rng.uniform(0.3, 1.0))
        self.emission = float(rng.uniform(0.1, 0.22))
        w, d, h = b.width, b.depth, WALL_HEIGHT
        room, corner = Frame(0, 0), self._corner() if b.chance(0.35) else None
        b.add(b.new("Floor"), "box", room, (w / 2, d / 2, -0.05), (w / 2, d / 2, 0.05), (1, 1, 1),
              "floor", solid=False)  # fmt: skip
        b.add(b.new("Ceiling"), "box", room, (w / 2, d / 2, h + 0.05), (w / 2, d / 2, 0.05),
              (1, 1, 1), "ceiling", solid=False, emission=self.emission + 0.12)  # fmt: skip
        owner = b.new("Wall")
        solids = [
            (w / 2, -0.05, w / 2 + 0.1, 0.05), (w / 2, d + 0.05, w / 2 + 0.1, 0.05),
            (-0.05, d / 2, 0.05, d / 2), (w + 0.05, d / 2, 0.05, d / 2),
        ]  # fmt: skip
        for x, y, hx, hy in [*solids, *([corner] if corner else [])]:
            b.add(owner, "box", room, (x, y, h / 2), (hx, hy, h / 2), self.wall, visible=False)
        skirting = hsv(0.1, float(rng.uniform(0, 0.3)), float(rng.uniform(0.5, 1.0)))
        for k, wall in enumerate(b.stretches):
            middle, half = (wall.low + wall.high) / 2, (wall.high - wall.low) / 2
            b.add(owner, "box", wall.frame(middle, -0.005), (0, 0, h / 2), (half, 0.005, h / 2),
                  (1, 1, 1), f"wall{k}", solid=False, emission=self.emission)  # fmt: skip
            b.add(owner, "box", wall.frame(middle, 0.006), (0, 0, 0.04), (half, 0.006, 0.04),
                  skirting, solid=False)  # fmt: skip

    def _corner(self) -> tuple[float, float, float, float]:
        """Cut a corner off, which makes the room L-shaped; its middle and half sizes, metres."""
        b = self.b
        w, d = (float(b.rng.uniform(0.6, 0.35 * side)) for side in (b.width, b.depth))
        left, front = b.chance(0.5), b.chance(0.5)
        x0, x1 = (0.0, w) if left else (b.width - w, b.width)
        y0, y1 = (0.0, d) if front else (b.depth - d, b.depth)
        south, north, west, east = outer_walls(b.width, b.depth)
        along_x = (x1, b.width) if left else (0.0, x0)
        along_y = (y1, b.depth) if front else (0.0, y0)
        if front:
            south = Stretch(0, 0.0, 0.0, *along_x)
        else:
            north = Stretch(0, b.depth, math.pi, *along_x)
        if left:
            west = Stretch(1, 0.0, -math.pi / 2, *along_y)
        else:
            east = Stretch(1, b.width, math.pi / 2, *along_y)
        b.stretches = [
            south, north, west, east,
            Stretch(0, y1 if front else y0, 0.0 if front else math.pi, x0, x1),
            Stretch(1, x1 if left else x0, -math.pi / 2 if left else math.pi / 2, y0, y1),
        ]  # fmt: skip
        middle = (x0 + x1) / 2, (y0 + y1) / 2
        b.taken.append((*middle, w / 2, d / 2, 0.0))
        return (*middle, w / 2, d / 2)

    def pictures(self) -> dict[str, np.ndarray]:
        """Pictures of floor, ceiling and walls as they are lit: uint8 [H, W, 3] by name."""
        b, rng = self.b, self.b.rng
        kinds = FLOORS[self.room_type]
        floor = kinds[int(rng.integers(len(kinds)))](rng, b.width, b.depth)
        h, w = floor.shape[:2]
        below = self._light(Frame(0, 0), (b.width, 0, 0), (0, b.depth, 0), (0, 0, 1))
        around = [self._wall_light(wall) for wall in b.stretches]
        mean = np.concatenate([a.reshape(-1, 3) for a in (below, *around)]).mean()
        small = floor_light(b, (h // COARSER, w // COARSER), ma.PER_METRE / COARSER)
        lit = np.maximum(cv2.resize(small, (w, h), interpolation=cv2.INTER_LINEAR), 0.3)[..., None]
        out = {"floor": (_shaded(floor, below / mean) * lit)[::-1]}
        out |= {
            f"wall{k}": (_shaded(picture, light / mean) * _corners(picture))[::-1, ::-1]
            for k, (picture, light) in enumerate(zip(self._walls(), around, strict=True))
        }
        white = hsv(0.12, 0.02, float(rng.uniform(0.9, 1)))
        ceiling = ma.paint(rng, b.width / 4, b.depth / 4, white)
        above = self._light(Frame(0, 0, WALL_HEIGHT), (b.width, 0, 0), (0, b.depth, 0), (0, 0, -1))
        out["ceiling"] = (_shaded(ceiling, above / mean + 0.2) * _corners(ceiling, 4))[::-1]
        return {k: (v.clip(0, 1) * 255).astype(np.uint8).copy() for k, v in out.items()}

    def _walls(self) -> list[ma.Surface]:
        """One picture a stretch of wall, rows from the floor upwards, columns along its frame."""
        rng, b = self.b.rng, self.b
        tiled = {"bathroom": 0.85, "kitchen": 0.1}.get(self.room_type, 0.0)
        height = float(rng.choice([1.2, 1.5, 2.0, WALL_HEIGHT])) if b.chance(tiled) else 0.0
        papered, seed = not tiled and b.chance(0.25), int(rng.integers(2**31))
        accent = int(rng.integers(len(b.stretches))) if b.chance(0.25) else -1
        other = wall_colour(rng)
        found = []
        for k, wall in enumerate(b.stretches):
            same = np.random.default_rng(seed)
            colour = other if k == accent else self.wall
            length = wall.high - wall.low
            made = (ma.paper if papered else ma.paint)(same, length, WALL_HEIGHT, colour)
            if height:
                rows = round(height * ma.PER_METRE)
                made = made.copy()
                design = np.random.default_rng(seed + 1)
                made[:rows] = ma.tiles(design, length, WALL_HEIGHT, wall=True)[:rows]
            found.append(made)
        return found

    def _wall_light(self, wall: Stretch) -> np.ndarray:
        frame = wall.frame(wall.low if _ascends(wall) else wall.high)
        length = wall.high - wall.low
        c, s = math.cos(wall.yaw), math.sin(wall.yaw)
        return self._light(frame, (c * length, s * length, 0), (0, 0, WALL_HEIGHT), (-s, c, 0))

    def _light(self, start: Frame, right: Vector, up: Vector, normal: Vector) -> np.ndarray:
        """Light on a rectangle, float32 [rows along up, columns along right, 3]."""
        n, m = (max(2, round(float(np.linalg.norm(side)) / SPACING_M)) for side in (up, right))
        v, u = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(m) + 0.5) / m, indexing="ij")
        at = np.array([start.x, start.y, start.z]) + u[..., None] * right + v[..., None] * up
        out = np.full((n, m, 3), REFLECTED)
        for place, colour in self.lamps:
            out += _from(at, np.array(normal), np.array(place), None, 2.2) * np.array(colour)
        sky = np.array([0.92, 0.96, 1.0]) * self.daylight
        for pane in self.panes:
            outward = pane.frame.at(0, 1)
            facing = np.array([outward.x - pane.frame.x, outward.y - pane.frame.y, 0])
            for x in (-0.3, 0.3):
                for z in (0.25, 0.75):
                    spot = pane.frame.at(x * pane.width, 0.05)
                    source = np.array([spot.x, spot.y, pane.low + z * pane.height])
                    power = 1.4 * pane.width * pane.height
                    out += _from(at, np.array(normal), source, facing, power) * sky
        return out.astype(np.float32)

    def lights(self) -> tuple[Light, ...]:
        """Lights for the furniture: the lamps, and one before each of up to two windows."""
        found = list(self.lamps)
        for pane in self.panes[:2]:
            spot = pane.frame.at(0, 0.3)
            k = 0.45 * self.daylight
            found.append(((spot.x, spot.y, pane.low + 0.7 * pane.height), (0.95 * k, 0.97 * k, k)))
        return tuple(found)


def _ascends(wall: Stretch) -> bool:
    """Whether x of frames on a wall runs towards its greater coordinates."""
    return wall.yaw in (0.0, math.pi / 2)


def wall_colour(rng: np.random.Generator) -> Colour:
    """White mostly, cream, grey or a light colour, seldom a strong one."""
    kind = rng.random()
    if kind < 0.4:
        return hsv(0.12, float(rng.uniform(0, 0.07)), float(rng.uniform(0.9, 0.99)))
    if kind < 0.6:
        return hsv(float(rng.uniform(0.07, 0.14)), float(rng.uniform(0.08, 0.25)), 0.93)
    if kind < 0.72:
        return hsv(0.6, float(rng.uniform(0, 0.05)), float(rng.uniform(0.7, 0.88)))
    if kind < 0.92:
        return hsv(float(rng.random()), float(rng.uniform(0.06, 0.2)), float(rng.uniform(0.8, 0.9)))
    return hsv(float(rng.random()), float(rng.uniform(0.25, 0.5)), float(rng.uniform(0.5, 0.8)))


def _from(
    at: np.ndarray, normal: np.ndarray, place: np.ndarray, facing: np.ndarray | None, power: float
) -> np.ndarray:
    """What a source at a place sends to points with a normal, float64 [H, W, 1]."""
    way = place - at
    square = (way**2).sum(-1, keepdims=True) + 0.25
    length = np.sqrt(square)
    received = np.maximum((way * normal).sum(-1, keepdims=True) / length, 0)
    sent = 1.0 if facing is None else np.maximum(-(way * facing).sum(-1, keepdims=True) / length, 0)
    return power * received * sent / square


def _shaded(picture: np.ndarray, light: np.ndarray) -> np.ndarray:
    """A picture under light whose mean is about 1."""
    shape = picture.shape[1], picture.shape[0]
    smooth = np.asarray(cv2.resize(light.astype(np.float32), shape, interpolation=cv2.INTER_LINEAR))
    return picture * (1 + CONTRAST * (smooth - 1)).clip(0.55, 1.3)


def _corners(picture: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """How dark a surface is near its edges, float [H, W, 1]."""
    h, w = picture.shape[:2]
    y, x = (np.arange(n) * scale / ma.PER_METRE for n in (h, w))
    edges = [np.minimum(a, a[-1] - a) for a in (y, x)]
    rows, columns = (1 - 0.16 * np.exp(-a / 0.16) for a in edges)
    return (rows[:, None] * columns[None])[..., None]
