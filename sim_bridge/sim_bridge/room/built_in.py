"""Rooms of boxes, cylinders and ellipsoids of our own: a short recipe for each type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim_bridge.room import fixtures as fx
from sim_bridge.room import furniture as fu
from sim_bridge.room import objects as ob
from sim_bridge.room.parts import Builder, Colour
from sim_bridge.room.shell import ceiling_light, floor_picture, shell
from sim_bridge.room.textures import TEXTURES, Texture


@dataclass(frozen=True)
class Look:
    """How the surfaces of a room look.

    Attributes:
        textures: uint8 [N, M, 3] by name.
        lights: position (m) and colour of each lamp.
        ambient: 0..1, strength of the undirected light.
    """

    textures: dict[str, Texture]
    lights: tuple[tuple[tuple[float, float, float], Colour], ...]
    ambient: float


def make(b: Builder, room_type: str) -> Look:
    """Build and furnish a room."""
    floor = shell(b)
    furnish(b, room_type)
    textures = {name: make(b.rng) for name, make in TEXTURES.items() if name != "picture"}
    textures |= {f"picture{i}": TEXTURES["picture"](b.rng) for i in range(3)}
    textures["floor"] = floor_picture(b, textures[floor])
    lights = tuple(ceiling_light(b) for _ in range(2))
    return Look(textures, lights, float(b.rng.uniform(0.5, 0.7)))


def furnish(b: Builder, room_type: str) -> None:
    """Put the furniture of a type of room, its goals and its clutter into a shell."""
    RECIPES[room_type](b)
    for _ in range(int(b.rng.integers(1, 4))):
        fu.crate(b)
    if b.chance(0.4) and room_type != "kitchen":
        fu.rug(b)


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


RECIPES: dict[str, Callable[[Builder], None]] = {
    "kitchen": _kitchen, "living_room": _living_room, "bedroom": _bedroom, "bathroom": _bathroom,
}  # fmt: skip
