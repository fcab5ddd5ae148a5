"""What a room is made of: coloured, possibly textured boxes, cylinders and ellipsoids.

``Builder`` collects them while furniture and objects are drawn in local frames. Knows no MuJoCo.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from sim_bridge.sweet_home.bands import Box
from sim_bridge.sweet_home.model import Model

UNSEEN = (0.5, 0.5, 0.5)
"""Colour of what no camera sees."""

Colour = tuple[float, float, float]
Shape = Literal["box", "cylinder", "ellipsoid"]


@dataclass(frozen=True)
class Frame:
    """A local frame: origin in metres in the room, yaw in radians about the vertical."""

    x: float
    y: float
    z: float = 0.0
    yaw: float = 0.0

    def at(self, x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> Frame:
        """The frame whose pose in this one is (x, y, z, yaw)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Frame(self.x + c * x - s * y, self.y + s * x + c * y, self.z + z, self.yaw + yaw)


@dataclass(frozen=True)
class Part:
    """One solid of a room.

    Attributes:
        shape: box, cylinder (axis vertical) or ellipsoid.
        centre: metres in the room.
        half: half extents, metres; a cylinder has (radius, radius, half height).
        yaw: radians about the vertical.
        colour: red, green, blue in 0..1, multiplied with the texture.
        texture: key of ``Room.textures`` or None.
        repeat: metres one texture covers, None to fit it once on every face.
        owner: index into ``Room.objects``.
        solid: whether it stops the robot and the laser.
        emission: 0..1, light of its own.
        visible: whether the camera sees it; what is touched of a model is not seen.
    """

    shape: Shape
    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw: float
    colour: Colour
    texture: str | None
    repeat: float | None
    owner: int
    solid: bool
    emission: float
    visible: bool = True


@dataclass(frozen=True)
class Placed:
    """A model of furniture where it stands.

    Attributes:
        model: what is seen of it; its boxes are parts.
        frame: of the model's own frame in the room.
        owners: for each of its meshes an index into ``Room.objects``.
    """

    model: Model
    frame: Frame
    owners: tuple[int, ...]


@dataclass
class RoomObject:
    """A thing in the room: a goal when ``name`` is a category, else furniture or structure.

    Attributes:
        name: category or plain name ("Counter", "Wall").
        footprint: x0, y0, x1, y1 of its parts, metres.
    """

    name: str
    footprint: tuple[float, float, float, float] = (math.inf, math.inf, -math.inf, -math.inf)


@dataclass(frozen=True)
class Surface:
    """A place to put things.

    Attributes:
        frame: origin at the middle of its back edge, y towards its front.
        width, depth: along x and y, metres.
        kind: what it is part of, such as "table".
        clear: height that is free above it, metres.
    """

    frame: Frame
    width: float
    depth: float
    kind: str
    clear: float = math.inf


@dataclass(frozen=True)
class Stretch:
    """A straight piece of wall.

    Attributes:
        along: 0 for a wall along x, 1 for one along y.
        at: the other coordinate of its surface, metres.
        yaw: of frames on it; their y points into the room.
        low, high: where it begins and ends, metres.
    """

    along: int
    at: float
    yaw: float
    low: float
    high: float

    def frame(self, u: float, off: float = 0.0) -> Frame:
        """The frame on the floor at u (m) along it, ``off`` metres before it."""
        at = self.at + off * self.inward
        return Frame(u, at, 0, self.yaw) if self.along == 0 else Frame(at, u, 0, self.yaw)

    @property
    def inward(self) -> float:
        """1 where the room is on the side of greater coordinates, else -1."""
        return 1.0 if self.yaw in (0.0, -math.pi / 2) else -1.0


def outer_walls(width: float, depth: float) -> list[Stretch]:
    """The four walls of a rectangular room (m)."""
    return [
        Stretch(0, 0.0, 0.0, 0.0, width), Stretch(0, depth, math.pi, 0.0, width),
        Stretch(1, 0.0, -math.pi / 2, 0.0, depth), Stretch(1, width, math.pi / 2, 0.0, depth),
    ]  # fmt: skip


def hsv(h: float, s: float, v: float) -> Colour:
    """Colour from hue, saturation and value, each clipped to its range."""
    return colorsys.hsv_to_rgb(h % 1, min(max(s, 0.0), 1.0), min(max(v, 0.0), 1.0))


def darker(colour: Colour, factor: float) -> Colour:
    """The colour with every channel multiplied by ``factor``."""
    return (colour[0] * factor, colour[1] * factor, colour[2] * factor)


@dataclass
class Builder:
    """Collects parts, objects, surfaces and the floor space already taken."""

    rng: np.random.Generator
    width: float
    depth: float
    parts: list[Part] = field(default_factory=list)
    placed: list[Placed] = field(default_factory=list)
    objects: list[RoomObject] = field(default_factory=list)
    surfaces: list[Surface] = field(default_factory=list)
    taken: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    on_surface: list[tuple[Surface, float, float, float]] = field(default_factory=list)
    walls_taken: list[tuple[int, float, float, float, float]] = field(default_factory=list)
    wood_tones: list[tuple[Colour, str]] = field(default_factory=list)
    stretches: list[Stretch] = field(default_factory=list)
    """Walls to stand and hang things at; the four of a rectangle unless given."""
    tallest: float = 0.0
    """How high what stands at walls may be that does not say so, metres."""

    def __post_init__(self) -> None:
        self.stretches = self.stretches or outer_walls(self.width, self.depth)

    def new(self, name: str) -> int:
        """Begin an object and return its index."""
        self.objects.append(RoomObject(name))
        return len(self.objects) - 1

    def add(
        self,
        owner: int,
        shape: Shape,
        frame: Frame,
        centre: tuple[float, float, float],
        half: tuple[float, float, float],
        colour: Colour,
        texture: str | None = None,
        repeat: float | None = None,
        solid: bool = True,
        emission: float = 0.0,
        visible: bool = True,
    ) -> None:
        """Add one part given in a local frame."""
        f = frame.at(*centre)
        self._cover(owner, f, half[:2])
        self.parts.append(
            Part(
                shape, (f.x, f.y, f.z), half, frame.yaw, colour, texture, repeat, owner, solid,
                emission, visible,
            )
        )  # fmt: skip

    def _cover(self, owner: int, frame: Frame, half: tuple[float, float]) -> None:
        """Let the footprint of an object reach as far as a rectangle around a frame."""
        c, s = abs(math.cos(frame.yaw)), abs(math.sin(frame.yaw))
        ex, ey = c * half[0] + s * half[1], s * half[0] + c * half[1]
        x0, y0, x1, y1 = self.objects[owner].footprint
        self.objects[owner].footprint = (
            min(x0, frame.x - ex), min(y0, frame.y - ey),
            max(x1, frame.x + ex), max(y1, frame.y + ey),
        )  # fmt: skip

    def put(self, owner: int, placed: Placed, boxes: Iterable[Box]) -> None:
        """Add a model, and the boxes in its frame that are touched of it."""
        self.placed.append(placed)
        for box in boxes:
            self.add(owner, "box", placed.frame, box.centre, box.half, UNSEEN, visible=False)
        for mesh, its in zip(placed.model.meshes, placed.owners, strict=True):
            low, high = mesh.vertices.min(0).astype(float), mesh.vertices.max(0).astype(float)
            middle, half = (low + high) / 2, (high - low) / 2
            self._cover(its, placed.frame.at(middle[0], middle[1]), (half[0], half[1]))

    def tone(self) -> tuple[Colour, str]:
        """One of the room's few furniture finishes (colour, texture)."""
        return self.wood_tones[int(self.rng.integers(len(self.wood_tones)))]

    def chance(self, p: float) -> bool:
        """True with probability p."""
        return bool(self.rng.random() < p)

    def place(
        self, width: float, depth: float, wall: bool = True, gap: float = 0.0,
        height: float | None = None,
    ) -> Frame | None:  # fmt: skip
        """Find floor space of width x depth, against a wall (its back edge) or free-standing.

        Args:
            width: along the wall, metres.
            depth: away from it, metres.
            wall: against a wall or free-standing.
            gap: free margin to other furniture, metres.
            height: of what comes there, which covers nothing on the wall, metres; ``tallest`` when
                None.

        Returns:
            Frame at the middle of the back edge, y pointing away from it, or None when full.
        """
        high = self.tallest if height is None else height
        for _ in range(60):
            frame = self._wall_frame(width) if wall else self._free_frame(width, depth)
            if frame is None or (wall and high and not self.uncovered(frame, width, high)):
                continue
            if self.take(frame, width, depth, gap):
                return frame
        return None

    def uncovered(self, frame: Frame, width: float, height: float) -> bool:
        """Whether nothing is on the wall behind what would stand at a frame (m)."""
        return self._wall_free(*self._wall_of(frame), width - 0.1, 0.1, height)

    def take(self, frame: Frame, width: float, depth: float, gap: float = 0.0) -> bool:
        """Take the floor before a frame at the middle of a back edge; False where it is taken."""
        centre = frame.at(0, depth / 2)
        c, s = abs(math.cos(frame.yaw)), abs(math.sin(frame.yaw))
        hx, hy = c * width / 2 + s * depth / 2, s * width / 2 + c * depth / 2
        if not self._free(centre.x, centre.y, hx, hy, gap):
            return False
        self.taken.append((centre.x, centre.y, hx, hy, gap))
        return True

    def _wall_frame(self, width: float) -> Frame | None:
        wall = self.stretches[int(self.rng.integers(len(self.stretches)))]
        if wall.high - wall.low < width + 0.04:
            return None
        margin = width / 2 + 0.01
        u = float(self.rng.uniform(wall.low + margin, wall.high - margin))
        if self.rng.random() < 0.4:
            u = wall.low + margin if self.rng.random() < 0.5 else wall.high - margin
        return wall.frame(u, 0.01)

    def _free_frame(self, width: float, depth: float) -> Frame | None:
        yaw = float(self.rng.integers(4)) * math.pi / 2
        reach = max(width, depth) / 2 + 0.7
        if self.width < 2 * reach or self.depth < 2 * reach:
            x, y = self.width / 2, self.depth / 2
        else:
            x = float(self.rng.uniform(reach, self.width - reach))
            y = float(self.rng.uniform(reach, self.depth - reach))
        return Frame(x, y, 0, yaw).at(0, -depth / 2)

    def _free(self, x: float, y: float, hx: float, hy: float, gap: float) -> bool:
        if x - hx < 0 or y - hy < 0 or x + hx > self.width or y + hy > self.depth:
            return False
        return all(
            abs(x - tx) >= hx + thx + max(gap, tgap) or abs(y - ty) >= hy + thy + max(gap, tgap)
            for tx, ty, thx, thy, tgap in self.taken
        )

    def wall_spot(self, width: float, low: float, high: float) -> Frame | None:
        """A free stretch of wall between two heights; frame at its middle on the floor."""
        for _ in range(40):
            k = int(self.rng.integers(len(self.stretches)))
            wall = self.stretches[k]
            if wall.high - wall.low < width + 0.3:
                continue
            # in this order: rooms hold to the last bit
            first, last = wall.low + width / 2 + 0.1, wall.high - width / 2 - 0.1
            u = float(self.rng.uniform(first, last))
            if self._wall_free(k, u, width, low, high):
                self.walls_taken.append((k, u, width, low, high))
                return wall.frame(u)
        return None

    def take_wall(self, frame: Frame, width: float, low: float, high: float) -> bool:
        """Take a stretch of wall between two heights behind a frame; False where it is taken."""
        k, u = self._wall_of(frame)
        if not self._wall_free(k, u, width, low, high):
            return False
        self.walls_taken.append((k, u, width, low, high))
        return True

    def _wall_free(self, k: int, u: float, width: float, low: float, high: float) -> bool:
        return all(
            kk != k or abs(u - uu) > (width + ww) / 2 + 0.05 or high < lo or low > hi
            for kk, uu, ww, lo, hi in self.walls_taken
        )

    def _wall_of(self, frame: Frame) -> tuple[int, float]:
        """Which stretch of wall is behind a frame, and where along it."""
        away = []
        for wall in self.stretches:
            u, at = (frame.x, frame.y) if wall.along == 0 else (frame.y, frame.x)
            turned = abs(math.remainder(frame.yaw - wall.yaw, math.tau)) > 0.8
            outside = max(wall.low - u, u - wall.high, 0.0)
            away.append((turned, outside > 0.05, abs(at - wall.at)))
        k = away.index(min(away))
        return k, frame.x if self.stretches[k].along == 0 else frame.y

    def occupy_wall(self, frame: Frame, width: float, low: float, high: float) -> None:
        """Mark a stretch of wall behind furniture as taken, so nothing hangs inside it."""
        k, u = self._wall_of(frame)
        self.walls_taken.append((k, u, width, low, high))
