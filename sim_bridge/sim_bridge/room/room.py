"""A seeded furnished room: four types, each a short recipe over furniture and goal objects.

``generate_room(type, seed)`` is a pure function of its arguments. Knows no MuJoCo.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cfnav_core.task.rooms import parse_room
from cfnav_core.task.vocabulary import CATEGORY_ID
from sim_bridge.room import fixtures as fx
from sim_bridge.room import furniture as fu
from sim_bridge.room import objects as ob
from sim_bridge.room.parts import Builder, Colour, Frame, Part, RoomObject, hsv
from sim_bridge.room.textures import SIZE, TEXTURES, Texture

ROOMS_VERSION = 1
"""Rises when a seed's room, its grid or its pictures come out otherwise; a test holds it."""

WALL_HEIGHT = 2.5
WOODS = ((0.05, 0.14), (0.25, 0.65), (0.45, 0.95))


@dataclass(frozen=True)
class Room:
    """A furnished room.

    Attributes:
        room_type: one of ``cfnav_core.task.vocabulary.ROOM_TYPES``.
        seed: what it was drawn from.
        width, depth: inner size along x and y, metres.
        parts: everything solid or visible.
        objects: what the parts belong to; goals carry a category's name.
        textures: uint8 [N, N, 3] by name.
        ambient: 0..1, strength of the undirected light.
        lights: position (m) and colour of each lamp.
    """

    room_type: str
    seed: int
    width: float
    depth: float
    parts: tuple[Part, ...]
    objects: tuple[RoomObject, ...]
    textures: dict[str, Texture]
    ambient: float
    lights: tuple[tuple[tuple[float, float, float], Colour], ...]

    @property
    def name(self) -> str:
        """``type:seed``, as given on command lines."""
        return f"{self.room_type}:{self.seed}"

    @property
    def goals(self) -> tuple[str, ...]:
        """Categories present in the room, alphabetical."""
        return tuple(sorted({o.name for o in self.objects if o.name in CATEGORY_ID}))


def generate_room(room_type: str, seed: int) -> Room:
    """Draw a room.

    Args:
        room_type: kitchen, living_room, bedroom or bathroom.
        seed: 0 or more. By convention 0-19 train (18 and 19 validate), 20-29 test, 1000 and up
            train perception.

    Raises:
        ValueError: unknown type or negative seed.
    """
    if room_type not in RECIPES or seed < 0:
        parse_room(f"{room_type}:{seed}")
    rng = np.random.default_rng([zlib.crc32(room_type.encode()), seed])
    (wl, wh), (dl, dh), recipe = RECIPES[room_type]
    b = Builder(rng, float(rng.uniform(wl, wh)), float(rng.uniform(dl, dh)))
    b.wood_tones = [_finish(rng) for _ in range(3)]
    floor = _shell(b)
    recipe(b)
    for _ in range(int(rng.integers(1, 4))):
        fu.crate(b)
    if b.chance(0.4) and room_type != "kitchen":
        fu.rug(b)
    textures = {name: make(rng) for name, make in TEXTURES.items() if name != "picture"}
    textures |= {f"picture{i}": TEXTURES["picture"](rng) for i in range(3)}
    textures["floor"] = _floor_picture(b, textures[floor])
    lights = tuple(_light(b) for _ in range(2))
    return Room(
        room_type, seed, b.width, b.depth, tuple(b.parts), tuple(b.objects), textures,
        float(rng.uniform(0.5, 0.7)), lights,
    )  # fmt: skip


def _finish(rng: np.random.Generator) -> tuple[Colour, str]:
    if rng.random() < 0.65:
        h, s, v = (float(rng.uniform(*r)) for r in WOODS)
        return hsv(h, s, v), "wood"
    return hsv(
        float(rng.random()), float(rng.uniform(0, 0.3)), float(rng.uniform(0.5, 0.95))
    ), "paint"


def _light(b: Builder) -> tuple[tuple[float, float, float], Colour]:
    x, y = (float(b.rng.uniform(0.7, side - 0.7)) for side in (b.width, b.depth))
    k = float(b.rng.uniform(0.3, 0.45))
    warmth = float(b.rng.uniform(0.8, 1.0))
    return (x, y, WALL_HEIGHT - 0.1), (k, k * (1 + warmth) / 2, k * warmth)


def _shell(b: Builder) -> str:
    """Floor, walls, ceiling, skirting, door and windows; returns the floor's texture."""
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
    _door(b)
    for _ in range(int(rng.integers(1, 3))):
        _window(b)
    return str(rng.choice(["planks", "planks", "tile", "checker", "carpet"]))


def _door(b: Builder) -> None:
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


def _window(b: Builder) -> None:
    w, h = float(b.rng.uniform(0.4, 0.7)), float(b.rng.uniform(0.35, 0.5))
    frame = b.wall_spot(2 * w, 1.55 - h, 1.55 + h)
    if frame is None:
        return
    b.add(b.new("Window"), "box", frame, (0, 0.01, 1.55), (w, 0.01, h), (1, 1, 1), "window_view",
          solid=False, emission=0.45)  # fmt: skip


def _floor_picture(b: Builder, pattern: Texture) -> Texture:
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
    light = np.ones((h, w))
    for part in b.parts:
        z_low = part.centre[2] - part.half[2]
        if part.solid and z_low <= 0.5 and part.half[2] <= 1.2:
            _shade(light, part, z_low, scale)
    y, x = (np.arange(h) / scale)[:, None], (np.arange(w) / scale)[None]
    edge = np.minimum(np.minimum(x, b.width - x), np.minimum(y, b.depth - y))
    light *= 1 - 0.22 * np.exp(-np.maximum(edge, 0) / 0.12)
    shaded = np.clip(image[:h, :w] * np.maximum(light, 0.35)[..., None], 0, 1)
    return (shaded[::-1] * 255).astype(np.uint8)


def _shade(light: np.ndarray, part: Part, z_low: float, scale: float) -> None:
    """Darken the floor under and beside one part; softer and wider the higher it hangs."""
    reach, depth = 0.06 + 0.3 * z_low, 0.5 * (1 - z_low / 0.6)
    radius = math.hypot(part.half[0], part.half[1]) + 2.5 * reach
    x0, y0 = (max(0, int((part.centre[i] - radius) * scale)) for i in (0, 1))
    x1, y1 = (max(0, int((part.centre[i] + radius) * scale) + 1) for i in (0, 1))
    window = light[y0:y1, x0:x1]
    dy = ((np.arange(window.shape[0]) + y0) / scale - part.centre[1])[:, None]
    dx = ((np.arange(window.shape[1]) + x0) / scale - part.centre[0])[None]
    c, s = math.cos(part.yaw), math.sin(part.yaw)
    u, v = np.abs(c * dx + s * dy), np.abs(c * dy - s * dx)
    distance = np.hypot(np.maximum(u - part.half[0], 0), np.maximum(v - part.half[1], 0))
    window *= 1 - depth * np.exp(-((distance / reach) ** 2))


def _draw(b: Builder, act: Callable[..., bool], chances: dict[str, float], *kinds: str) -> None:
    for category, p in chances.items():
        if b.chance(p):
            act(b, category, kinds) if kinds else act(b, category)


def _kitchen(b: Builder) -> None:
    for width in b.rng.uniform(1.1, 2.1, int(b.rng.integers(2, 4))):
        frame = fx.counter(b, float(width))
        if frame is not None and b.chance(0.5):
            fx.upper_cabinet(b, frame, float(width))
    fx.fridge(b)
    fx.stove(b)
    fu.table(b, chairs=int(b.rng.integers(1, 5)))
    if b.chance(0.35):
        fu.stool(b)
    if b.chance(0.3):
        fu.bookshelf(b)
    ob.put(b, "Sink", ("counter",))
    _draw(b, ob.put, {"Pan": 0.85, "Pot": 0.85, "Kettle": 0.5}, "stove")
    _draw(
        b,
        ob.put,
        {"Microwave": 0.85, "CoffeeMachine": 0.9, "Toaster": 0.9, "Kettle": 0.35},
        "counter",
    )
    _draw(b, ob.put, {"Bread": 0.9, "Mug": 0.9, "Apple": 0.9, "Spatula": 0.85, "Bowl": 0.7,
                      "Plate": 0.7, "CellPhone": 0.2, "Book": 0.2, "Vase": 0.15},
          "counter", "table")  # fmt: skip
    _draw(b, ob.put, {"Laptop": 0.2, "HousePlant": 0.25, "Mug": 0.2, "Bowl": 0.2}, "table")
    _draw(b, ob.stand, {"GarbageCan": 0.85, "HousePlant": 0.2})
    _draw(b, ob.hang, {"LightSwitch": 0.9, "Painting": 0.25, "Blinds": 0.2})


def _living_room(b: Builder) -> None:
    fu.sofa(b)
    fu.sofa(b, "ArmChair")
    if fu.cabinet(
        b, float(b.rng.uniform(1.2, 1.7)), 0.45, float(b.rng.uniform(0.45, 0.6)), "tv_stand"
    ):
        ob.put(b, "Television", ("tv_stand",))
    fu.table(b, "low_table")
    if b.chance(0.5):
        fu.table(b, chairs=int(b.rng.integers(1, 4)))
    if b.chance(0.7):
        fu.bookshelf(b)
    if b.chance(0.6):
        fu.cabinet(b, float(b.rng.uniform(0.7, 1.2)), 0.42, float(b.rng.uniform(0.7, 0.9)), "side")
    fu.cabinet(b, float(b.rng.uniform(0.42, 0.55)), 0.42, 0.55, "side")
    tops = ("low_table", "table", "side", "tv_stand")
    _draw(b, ob.put, {"RemoteControl": 0.9, "Laptop": 0.85, "Vase": 0.9, "Book": 0.6,
                      "CellPhone": 0.3, "Bowl": 0.3, "Plate": 0.2, "Mug": 0.2}, *tops)  # fmt: skip
    _draw(b, ob.put, {"DeskLamp": 0.4, "HousePlant": 0.2, "AlarmClock": 0.15}, "side")
    _draw(b, ob.put, {"Pillow": 0.7}, "seat")
    _draw(b, ob.stand, {"FloorLamp": 0.75, "HousePlant": 0.75, "GarbageCan": 0.5})
    _draw(b, ob.hang, {"Painting": 0.95, "LightSwitch": 0.8, "Blinds": 0.3})


def _bedroom(b: Builder) -> None:
    fu.bed(b)
    for _ in range(int(b.rng.integers(1, 3))):
        fu.cabinet(b, float(b.rng.uniform(0.45, 0.55)), 0.42, 0.55, "night_stand")
    fu.cabinet(b, float(b.rng.uniform(0.9, 1.4)), 0.5, float(b.rng.uniform(0.75, 0.95)), "dresser")
    fu.table(b, "desk", chairs=1, wall=True)
    if b.chance(0.5):
        fu.wardrobe(b)
    if b.chance(0.4):
        fu.bookshelf(b)
    tops = ("night_stand", "dresser", "desk")
    _draw(b, ob.put, {"Pillow": 0.95}, "bed_head")
    _draw(b, ob.put, {"Pillow": 0.4}, "bed_head")
    _draw(b, ob.put, {"Laptop": 0.8}, "desk", "dresser")
    _draw(b, ob.put, {"AlarmClock": 0.95, "DeskLamp": 0.9, "CD": 0.9, "Book": 0.8, "CellPhone": 0.7,
                      "Mug": 0.2, "RemoteControl": 0.15, "Vase": 0.15}, *tops)  # fmt: skip
    _draw(b, ob.put, {"Television": 0.25}, "dresser")
    _draw(b, ob.stand, {"GarbageCan": 0.75, "HousePlant": 0.4, "FloorLamp": 0.25})
    _draw(b, ob.hang, {"Blinds": 0.95, "LightSwitch": 0.85, "Painting": 0.4, "Mirror": 0.3})


def _bathroom(b: Builder) -> None:
    fx.counter(b, float(b.rng.uniform(0.9, 1.4)), 0.52)
    ob.put(b, "Sink", ("counter",))
    fx.toilet(b)
    if b.chance(0.7):
        fx.bathtub(b)
    fu.cabinet(b, float(b.rng.uniform(0.4, 0.7)), 0.38, float(b.rng.uniform(0.6, 0.9)), "side")
    if b.chance(0.5):
        fu.cabinet(b, 0.45, 0.38, 0.5, "side")
    if b.chance(0.3):
        fu.stool(b)
    tops = ("counter", "side")
    _draw(
        b,
        ob.put,
        {"SoapBar": 0.95, "SprayBottle": 0.9, "ToiletPaper": 0.95, "HousePlant": 0.2, "Vase": 0.1},
        *tops,
    )
    _draw(b, ob.put, {"SprayBottle": 0.25, "SoapBar": 0.2}, *tops)
    _draw(b, ob.stand, {"GarbageCan": 0.85, "HousePlant": 0.15})
    _draw(b, ob.hang, {"Mirror": 0.95, "Towel": 0.95, "LightSwitch": 0.75, "Painting": 0.1})


Recipe = tuple[tuple[float, float], tuple[float, float], Callable[[Builder], None]]
RECIPES: dict[str, Recipe] = {
    "kitchen": ((3.8, 5.4), (3.4, 4.8), _kitchen),
    "living_room": ((4.4, 5.8), (3.8, 5.2), _living_room),
    "bedroom": ((3.9, 5.2), (3.5, 4.8), _bedroom),
    "bathroom": ((3.0, 4.2), (2.8, 3.8), _bathroom),
}
"""Range of width, range of depth (m) and recipe of each room type."""
