"""The bedroom: a bed with night stands, a wardrobe, drawers, a desk with its chair."""

from __future__ import annotations

import math

from sim_bridge.room import furniture as fu
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Builder, Frame, Surface
from sim_bridge.room.recipes.common import (
    against,
    clutter,
    hang,
    rug,
    stand,
    tops,
)


def furnish(kit: Kit) -> None:
    """Furnish a bedroom."""
    b = kit.b
    bare = _bed(kit)
    if b.chance(0.8) and kit.stand("wardrobe") is None:
        fu.wardrobe(b)
    _dresser(kit)
    if b.chance(0.75):
        desk(kit)
    if b.chance(0.3):
        kit.stand("ArmChair", gap=0.1)
    if b.chance(0.35) and kit.stand("bookcase") is None:
        fu.bookshelf(b)
    if bare:
        tops(kit, {"Pillow": 0.9}, "bed_head")
        tops(kit, {"Pillow": 0.5}, "bed_head")
    tops(kit, {"DeskLamp": 0.7, "AlarmClock": 0.8}, "night_stand", "dresser")
    tops(kit, {"Laptop": 0.8, "DeskLamp": 0.4}, "desk", "dresser")
    tops(kit, {"CD": 0.7, "Book": 0.8, "CellPhone": 0.7, "Mug": 0.3, "RemoteControl": 0.2,
               "Vase": 0.3, "Painting": 0.3, "HousePlant": 0.25},
         "night_stand", "dresser", "desk", "shelf")  # fmt: skip
    tops(kit, {"Television": 0.25}, "dresser")
    tops(kit, {"Towel": 0.1}, "bed")
    clutter(kit, "clutter_top", 5, "night_stand", "dresser", "desk", "shelf", "bed")
    stand(kit, {"GarbageCan": 0.6, "HousePlant": 0.4, "FloorLamp": 0.35})
    hang(kit, {"LightSwitch": 0.85, "Painting": 0.5, "Mirror": 0.25})


def _bed(kit: Kit) -> bool:
    """The bed with what is around it; whether it has no pillows yet."""
    b = kit.b
    bed = kit.pick("bed_double" if b.chance(0.65) else "bed_single", lambda p: p.kind != "bunk")
    if bed is None:
        frame = fu.bed(b)
        width, depth = (b.surfaces[-1].width, fu.BED_M) if frame else (0.0, 0.0)
    else:
        width, depth, height = bed.entry.size
        frame = against(b, width, depth, height, least=width + 0.8)
    if frame is None:
        return False
    if bed is not None:
        kit.add(bed, frame)
        b.occupy_wall(frame, width, 0, max(height, 1.0))
    if b.chance(0.5):
        kit.hang("Painting", frame.at(0, -0.01))
    design, own = kit.pick("night_stand"), b.chance(0.5)
    for side in (-1, 1):
        if not b.chance(0.75):
            continue
        if own or design is None:
            _own_night_stand(b, frame, side * width / 2)
        else:
            away = width / 2 + design.entry.size[0] / 2 + 0.06
            kit.beside(design, frame.at(side * away, 0.02))
    if b.chance(0.6):
        end = int(b.rng.integers(-1, 2))
        at = frame.at(end * (width / 2 + 0.35), depth * 0.6 if end else depth + 0.25)
        rug(kit, at, large=end == 0)
    if b.chance(0.12):
        bench = kit.pick("bench")
        kit.beside(bench, frame.at(0, depth + 0.05))
    return bed is None or not bed.goals


def _dresser(kit: Kit) -> None:
    b = kit.b
    if b.chance(0.5) and kit.choices("dresser"):
        found = kit.stand("dresser")
        frame = found[1] if found else None
    else:
        width, height = float(b.rng.uniform(0.9, 1.4)), float(b.rng.uniform(0.75, 0.95))
        frame = fu.cabinet(b, width, 0.5, height, "dresser")
    if frame is not None and b.chance(0.4):
        kit.hang("Mirror", frame.at(0, -0.01))


def _own_night_stand(b: Builder, bed: Frame, edge: float) -> None:
    """One of our own night stands at a side of the bed, ``edge`` metres from its middle."""
    w, d, h = (float(b.rng.uniform(*r)) for r in ((0.4, 0.5), (0.38, 0.42), (0.45, 0.6)))
    frame = bed.at(math.copysign(abs(edge) + w / 2 + 0.06, edge), 0.02)
    if not b.take(frame, w, d):
        return
    owner, (colour, texture) = b.new("Cabinet"), b.tone()
    b.add(owner, "box", frame, (0, d / 2, h / 2), (w / 2, d / 2, h / 2), colour, texture, 1)
    for z in (0.3 * h, 0.72 * h):
        b.add(owner, "box", frame, (0, d, z), (w / 2 - 0.02, 0.008, 0.19 * h), colour, texture, 1)
        b.add(owner, "box", frame, (0, d + 0.012, z), (0.04, 0.008, 0.006), fu.METAL, solid=False)
    b.surfaces.append(Surface(frame.at(0, 0, h), w, d, "night_stand"))


def desk(kit: Kit) -> None:
    """A desk at the wall and the chair before it, looking at it."""
    b = kit.b
    piece = kit.pick("desk", lambda piece: piece.entry.size[1] < 0.9)
    chair = kit.pick("Chair", lambda piece: piece.entry.size[2] > 0.7)
    if piece is None or chair is None:
        return
    width, depth, height = piece.entry.size
    seat = chair.entry.size[1]
    frame = b.place(width, depth + seat, height=height)
    if frame is None:
        return
    kit.add(piece, frame)
    b.occupy_wall(frame, width, 0, height + 0.35)
    before = depth + seat - float(b.rng.uniform(0, 0.25))  # partly under it
    back = frame.at(float(b.rng.uniform(-0.15, 0.15)) * width, before, 0, math.pi)
    kit.add(chair, back, float(b.rng.uniform(-0.3, 0.3)))
    if b.chance(0.35):
        kit.hang("Painting", frame.at(0, -0.01))
