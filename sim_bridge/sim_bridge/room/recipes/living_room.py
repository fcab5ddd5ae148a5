"""The living room: seats around a low table, a television where the sofa looks, a place to eat."""

from __future__ import annotations

import math

from sim_bridge.room import furniture as fu
from sim_bridge.room.kit import Kit, on_wall
from sim_bridge.room.parts import Frame
from sim_bridge.room.recipes.common import (
    TABLE_TOPS,
    against,
    clutter,
    hang,
    opposite,
    rug,
    stand,
    table_with_chairs,
    tops,
)
from sim_bridge.sweet_home.table import Piece


def furnish(kit: Kit) -> None:
    """Furnish a living room."""
    b = kit.b
    sofa = kit.pick("sofa", lambda piece: piece.entry.size[0] < 0.6 * max(b.width, b.depth))
    frame = None
    if sofa is not None:
        width, depth, height = sofa.entry.size
        frame = against(b, width, depth, height, least=2.8)
    if sofa is not None and frame is not None:
        kit.add(sofa, frame)
        b.occupy_wall(frame, width, 0, height)
        if b.chance(0.7):
            kit.hang("Painting", frame.at(float(b.rng.uniform(-0.3, 0.3)), -0.01))
        _television(kit, frame)
        _around_sofa(kit, frame, sofa)
    if b.chance(0.6):
        table_with_chairs(kit, 2)
    if b.chance(0.8) and kit.stand("bookcase") is None:
        fu.bookshelf(b)
    if b.chance(0.45):
        kit.stand("sideboard")
    if b.chance(0.45):
        width, height = float(b.rng.uniform(0.7, 1.2)), float(b.rng.uniform(0.7, 0.9))
        fu.cabinet(b, width, 0.42, height, "sideboard")
    for role, p in (("fireplace", 0.12), ("piano", 0.1)):
        if b.chance(p):
            kit.stand(role)
    for _ in range(int(b.rng.integers(0, 3))):
        kit.floor("HousePlant")
    stand(kit, {"FloorLamp": 0.75, "GarbageCan": 0.35})
    tops(kit, {"Television": 0.15}, "sideboard")
    tops(kit, {"RemoteControl": 0.9, "Laptop": 0.7, "Book": 0.7, "CellPhone": 0.4, "Bowl": 0.4,
               "Mug": 0.4, "Plate": 0.2}, "low_table", "side_table", "dining_table",
         "sideboard", "tv_stand")  # fmt: skip
    tops(kit, {"Vase": 0.9, "DeskLamp": 0.5, "HousePlant": 0.5, "Painting": 0.25,
               "AlarmClock": 0.1, "Book": 0.4}, *TABLE_TOPS)  # fmt: skip
    clutter(kit, "clutter_top", 6, *TABLE_TOPS, "tv_stand")
    tops(kit, {"Pillow": 0.5}, "seat")
    tops(kit, {"Pillow": 0.25}, "seat")
    hang(kit, {"LightSwitch": 0.85, "Painting": 0.8})
    hang(kit, {"Painting": 0.4})


def _around_sofa(kit: Kit, frame: Frame, sofa: Piece) -> None:
    """A low table before it on a rug, armchairs looking at that, small tables at its ends."""
    b = kit.b
    width, depth, _ = sofa.entry.size
    table = kit.pick("low_table", lambda piece: piece.kind != "child")
    at = frame.at(0, min(depth, 1.05) + float(b.rng.uniform(0.3, 0.45)))
    if depth < 1.3 and (size := _low_table(kit, table, at)):
        middle = at.at(0, size[1] / 2)
        if b.chance(0.6):
            rug(kit, middle)
        chair = kit.pick("ArmChair")
        if chair is not None:
            _chairs(kit, chair, middle, size)
    for side in (-1, 1):
        end = kit.pick("side_table")
        if end is not None and b.chance(0.35):
            away = width / 2 + end.entry.size[0] / 2 + 0.05
            kit.beside(end, frame.at(side * away, 0.02))


def _low_table(kit: Kit, table: Piece | None, at: Frame) -> tuple[float, float] | None:
    """A low table at a place, or our own; its width and depth, metres, None where there is none."""
    if table is not None:
        return table.entry.size[:2] if kit.beside(table, at) else None
    if fu.table(kit.b, "low_table", at=at) is None:
        return None
    top = kit.b.surfaces[-1]
    return top.width, top.depth


def _chairs(kit: Kit, chair: Piece, middle: Frame, table: tuple[float, float]) -> None:
    """One or two armchairs at the ends of the low table, or one across it."""
    b, seat = kit.b, chair.entry.size[1]
    along, across = table
    ends = (math.pi / 2, along, 0.5), (-math.pi / 2, along, 0.5)
    for yaw, reach, p in (*ends, (0.0, across, 0.2)):
        if b.chance(p):
            # its back edge is the far one
            away = reach / 2 + float(b.rng.uniform(0.3, 0.5)) + seat
            kit.beside(chair, middle.at(0, 0, 0, yaw).at(0, away, 0, math.pi),
                       float(b.rng.uniform(-0.25, 0.25)))  # fmt: skip


def _television(kit: Kit, sofa: Frame) -> None:
    """A stand where the sofa looks, with a television on it or on the wall above."""
    b, stand_ = kit.b, kit.pick("tv_stand")
    if stand_ is not None and b.chance(0.6):
        width, depth, height = stand_.entry.size
        place = opposite(b, sofa, width, depth, height) or b.place(width, depth, height=height)
        if place is None:
            return
        kit.add(stand_, place)
    else:
        width, depth, height = float(b.rng.uniform(1.2, 1.7)), 0.45, float(b.rng.uniform(0.4, 0.6))
        found = opposite(b, sofa, width, depth, height)
        if found is None:
            return
        place = found
        fu.cabinet(b, width, depth, height, "tv_stand", at=place)
    flat = kit.pick("Television", on_wall)
    if height < 0.9 and flat is not None and b.chance(0.2):
        kit.hang("Television", place.at(0, -0.01))
    else:
        kit.top("Television", ("tv_stand",))
    b.occupy_wall(place, width, 0, max(height, 1.4))
