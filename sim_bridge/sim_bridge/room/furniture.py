"""Furniture: each function finds its place in the room, draws itself and offers its surfaces.

All lengths in metres. Sizes are ranges seen in homes; every piece draws its own at random.
"""

from __future__ import annotations

import math

from sim_bridge.room.parts import Builder, Frame, Surface, darker, hsv

DARK = (0.12, 0.12, 0.13)
METAL = (0.72, 0.74, 0.77)
BED_M = 2.0
"""Length of a bed."""


def _legs(b: Builder, owner: int, frame: Frame, w: float, d: float, h: float, r: float) -> None:
    colour, _ = b.tone()
    for x in (-w / 2 + r, w / 2 - r):
        for y in (r, d - r):
            b.add(owner, "box", frame, (x, y, h / 2), (r, r, h / 2), darker(colour, 0.8), "wood", 1)


def drawer(b: Builder, owner: int, frame: Frame, z: float) -> None:
    """An open drawer: overhangs the floor where the LiDAR's plane sees nothing."""
    reach = float(b.rng.uniform(0.15, 0.3))
    colour, _ = b.tone()
    b.add(owner, "box", frame, (0, reach / 2, z), (0.18, reach / 2, 0.015), darker(colour, 0.9))
    b.add(owner, "box", frame, (0, reach, z + 0.06), (0.2, 0.012, 0.075), colour, "panel_door")
    for x in (-0.18, 0.18):
        b.add(owner, "box", frame, (x, reach / 2, z + 0.04), (0.01, reach / 2, 0.045),
              darker(colour, 0.8))  # fmt: skip


def table(
    b: Builder, kind: str = "table", chairs: int = 0, wall: bool = False, at: Frame | None = None
) -> Frame | None:
    """Table, low table or desk; its top overhangs what the LiDAR sees, its legs.

    It stands at a given place, unless that is taken, or finds one.
    """
    rng = b.rng
    if kind == "low_table":
        w, d, h = rng.uniform(0.8, 1.2), rng.uniform(0.5, 0.65), rng.uniform(0.38, 0.46)
    elif kind == "desk":
        w, d, h = rng.uniform(1.0, 1.4), rng.uniform(0.55, 0.7), rng.uniform(0.71, 0.76)
    else:
        w, d, h = rng.uniform(0.9, 1.5), rng.uniform(0.65, 0.85), rng.uniform(0.71, 0.76)
    w, d, h = float(w), float(d), float(h)
    if at is None:
        frame = b.place(w, d, wall, 0.0 if wall else 0.5)
    else:
        frame = at if b.take(at, w, d) else None
    if frame is None:
        return None
    owner, (colour, texture) = b.new("Table"), b.tone()
    b.add(owner, "box", frame, (0, d / 2, h - 0.018), (w / 2, d / 2, 0.018), colour, texture, 0.8)
    _legs(b, owner, frame, w, d, h - 0.036, 0.028)
    b.surfaces.append(Surface(frame.at(0, 0, h), w, d, kind))
    if wall:
        b.occupy_wall(frame, w, 0, h + 0.35)
    for k in range(chairs):
        x = (k % 2 - 0.5) * w * 0.5 if chairs > 1 else 0.0
        front = k < 2
        chair(b, frame.at(x, d + 0.1 if front else -0.1, 0, 0 if front else math.pi))
    return frame


def chair(b: Builder, frame: Frame) -> None:
    """A dining chair at a frame whose y axis points to its back; skipped outside the room."""
    if not (0.3 < frame.x < b.width - 0.3 and 0.3 < frame.y < b.depth - 0.3):
        return
    owner, frame = b.new("Chair"), frame.at(0, 0, 0, float(b.rng.uniform(-0.25, 0.25)))
    seat = hsv(float(b.rng.random()), float(b.rng.uniform(0.25, 0.65)),
               float(b.rng.uniform(0.3, 0.75)))  # fmt: skip
    b.add(owner, "box", frame, (0, 0, 0.44), (0.2, 0.2, 0.022), seat, "fabric", 0.4)
    b.add(owner, "box", frame, (0, 0.19, 0.72), (0.2, 0.016, 0.2), seat, "fabric", 0.4)
    colour, _ = b.tone()
    for x in (-0.175, 0.175):
        b.add(owner, "box", frame, (x, 0.185, 0.26), (0.02, 0.02, 0.26), colour)
        b.add(owner, "box", frame, (x, -0.175, 0.21), (0.02, 0.02, 0.21), colour)


def stool(b: Builder) -> None:
    """A round three-legged stool."""
    frame = b.place(0.36, 0.36, wall=False, gap=0.35)
    if frame is None:
        return
    owner, (colour, _) = b.new("Stool"), b.tone()
    b.add(owner, "cylinder", frame, (0, 0.18, 0.6), (0.17, 0.17, 0.02), colour, "wood", 0.5)
    for k in range(3):
        x, y = 0.12 * math.cos(2.1 * k), 0.18 + 0.12 * math.sin(2.1 * k)
        b.add(owner, "cylinder", frame, (x, y, 0.29), (0.018, 0.018, 0.29), darker(colour, 0.8))


def bookshelf(b: Builder) -> None:
    """Open shelves with rows of plain box files; a few boards stay free for objects."""
    rng = b.rng
    w, d = float(rng.uniform(0.7, 1.1)), float(rng.uniform(0.28, 0.36))
    h, rows = float(rng.uniform(1.3, 1.9)), 4
    frame = b.place(w, d)
    if frame is None:
        return
    owner, (colour, texture) = b.new("Shelf"), b.tone()
    for x in (-w / 2 + 0.015, w / 2 - 0.015):
        b.add(owner, "box", frame, (x, d / 2, h / 2), (0.015, d / 2, h / 2), colour, texture, 1)
    b.add(owner, "box", frame, (0, 0.008, h / 2), (w / 2, 0.008, h / 2), darker(colour, 0.85))
    free = int(rng.integers(1, 3))
    for row in range(rows + 1):
        z = 0.03 + row * (h - 0.05) / rows
        b.add(owner, "box", frame, (0, d / 2, z), (w / 2, d / 2, 0.014), colour, texture, 1)
        if row == free:
            b.surfaces.append(Surface(frame.at(0, 0, z + 0.014), w - 0.08, d, "shelf"))
        elif row < rows and row != 0:
            _files(b, owner, frame, w, d, z + 0.014)
    b.occupy_wall(frame, w, 0, h)


def _files(b: Builder, owner: int, frame: Frame, w: float, d: float, z: float) -> None:
    x = -w / 2 + 0.06
    while x < w / 2 - 0.1:
        t, h = float(b.rng.uniform(0.03, 0.07)), float(b.rng.uniform(0.09, 0.13))
        if b.chance(0.55):
            grey = hsv(float(b.rng.random()), 0.12, float(b.rng.uniform(0.3, 0.8)))
            b.add(owner, "box", frame, (x + t, d / 2 - 0.02, z + h), (t, d / 2 - 0.05, h), grey)
        x += 2 * t + 0.01


def sofa(b: Builder, name: str = "Sofa") -> Frame | None:
    """A sofa, or with ``name="ArmChair"`` a seat for one, which is a goal."""
    single = name == "ArmChair"
    w = float(b.rng.uniform(0.85, 1.0) if single else b.rng.uniform(1.5, 2.0))
    d = float(b.rng.uniform(0.78, 0.88))
    frame = b.place(w, d, wall=not single or b.chance(0.6), gap=0.2 if single else 0.0)
    if frame is None:
        return None
    owner = b.new(name)
    if single:
        c, texture = (
            hsv(float(b.rng.uniform(-0.04, 0.12)), 0.75, float(b.rng.uniform(0.6, 0.9))),
            "stripes",
        )
    else:
        c, texture = hsv(float(b.rng.uniform(0.45, 0.75)), float(b.rng.uniform(0.05, 0.4)),
                         float(b.rng.uniform(0.3, 0.75))), "fabric"  # fmt: skip
    b.add(owner, "box", frame, (0, d / 2, 0.14), (w / 2, d / 2, 0.12), darker(c, 0.8), texture, 0.5)
    cushions = 1 if single else 2
    inner = w - 0.36
    for i in range(cushions):
        x = -inner / 2 + (i + 0.5) * inner / cushions
        half = inner / cushions / 2 - 0.008
        b.add(
            owner,
            "box",
            frame,
            (x, d / 2 + 0.09, 0.33),
            (half, d / 2 - 0.11, 0.075),
            c,
            texture,
            0.5,
        )
        b.add(owner, "box", frame, (x, 0.26, 0.58), (half, 0.07, 0.2), c, texture, 0.5)
    b.add(owner, "box", frame, (0, 0.1, 0.5), (w / 2, 0.1, 0.3), darker(c, 0.9), texture, 0.5)
    for x in (-w / 2 + 0.09, w / 2 - 0.09):
        b.add(owner, "box", frame, (x, d / 2, 0.36), (0.09, d / 2, 0.24), c, texture, 0.5)
    b.surfaces.append(Surface(frame.at(0, 0.25, 0.405), inner, d - 0.25, "seat"))
    b.occupy_wall(frame, w, 0, 0.85)
    return frame


def bed(b: Builder) -> Frame | None:
    """A double bed with its head to the wall."""
    rng = b.rng
    w, d = float(rng.uniform(1.2, 1.6)), BED_M
    frame = b.place(w, d)
    if frame is None:
        return None
    owner, (colour, texture) = b.new("Bed"), b.tone()
    cover = hsv(float(rng.random()), float(rng.uniform(0.1, 0.6)), float(rng.uniform(0.35, 0.9)))
    b.add(owner, "box", frame, (0, d / 2, 0.17), (w / 2, d / 2, 0.13), colour, texture, 1)
    b.add(
        owner, "box", frame, (0, d / 2, 0.39), (w / 2 - 0.02, d / 2 - 0.03, 0.1), (0.9, 0.9, 0.88)
    )
    b.add(
        owner,
        "box",
        frame,
        (0, d * 0.64, 0.41),
        (w / 2 + 0.005, d * 0.35, 0.1),
        cover,
        "fabric",
        0.6,
    )
    b.add(owner, "box", frame, (0, 0.03, 0.52), (w / 2, 0.03, 0.45), colour, texture, 1)
    b.surfaces.append(Surface(frame.at(0, 0.06, 0.49), w, 0.5, "bed_head"))
    b.surfaces.append(Surface(frame.at(0, 0.75, 0.51), w, 1.1, "bed"))
    b.occupy_wall(frame, w, 0, 1.0)
    return frame


def cabinet(
    b: Builder, width: float, depth: float, height: float, kind: str, drawers: int = 2,
    at: Frame | None = None,
) -> Frame | None:  # fmt: skip
    """Dresser, night stand, television stand, side cabinet: a box with drawer fronts.

    It stands at a place that was taken for it, or finds one.
    """
    frame = at or b.place(width, depth)
    if frame is None:
        return None
    owner, (colour, texture) = b.new("Cabinet"), b.tone()
    b.add(owner, "box", frame, (0, depth / 2 - 0.01, height / 2 + 0.03),
          (width / 2, depth / 2 - 0.01, height / 2 - 0.03), colour, texture, 1)  # fmt: skip
    columns = max(1, round(width / 0.55))
    for row in range(drawers):
        for column in range(columns):
            x = -width / 2 + (column + 0.5) * width / columns
            z = 0.07 + (row + 0.5) * (height - 0.11) / drawers
            front = (width / columns / 2 - 0.012, 0.009, (height - 0.11) / drawers / 2 - 0.012)
            b.add(owner, "box", frame, (x, depth, z), front, darker(colour, 1.08), texture, 1)
            b.add(
                owner, "box", frame, (x, depth + 0.015, z), (0.035, 0.008, 0.008), DARK, solid=False
            )
    if height > 0.6 and b.chance(0.3):
        drawer(b, owner, frame.at(0, depth), height - 0.25)
    b.surfaces.append(Surface(frame.at(0, 0, height), width, depth, kind))
    b.occupy_wall(frame, width, 0, height + 0.4)
    return frame


def wardrobe(b: Builder) -> None:
    """A tall wardrobe with two doors."""
    w, h = float(b.rng.uniform(0.9, 1.3)), float(b.rng.uniform(1.8, 2.1))
    frame = b.place(w, 0.58)
    if frame is None:
        return
    owner, (colour, _) = b.new("Wardrobe"), b.tone()
    for x in (-w / 4, w / 4):
        b.add(
            owner,
            "box",
            frame,
            (x, 0.29, h / 2),
            (w / 4 - 0.004, 0.29, h / 2),
            colour,
            "panel_door",
        )
        b.add(owner, "box", frame, (x * 0.15, 0.59, 1.0), (0.01, 0.01, 0.08), METAL, solid=False)
    b.occupy_wall(frame, w, 0, h)


def crate(b: Builder) -> None:
    """Clutter on the floor: a cardboard box or a round pouffe."""
    size = float(b.rng.uniform(0.14, 0.22))
    frame = b.place(2 * size + 0.05, 2 * size + 0.05, wall=b.chance(0.6), gap=0.0)
    if frame is None:
        return
    h = float(b.rng.uniform(0.13, 0.22))
    if b.chance(0.6):
        owner, c = b.new("Box"), hsv(0.085, 0.45, float(b.rng.uniform(0.55, 0.8)))
        b.add(owner, "box", frame, (0, size, h), (size, size * 0.85, h), c, "paint", 0.5)
        b.add(owner, "box", frame, (0, size, 2 * h + 0.001), (size, 0.03, 0.002), (0.85, 0.8, 0.65))
    else:
        owner = b.new("Pouffe")
        c = hsv(
            float(b.rng.random()), float(b.rng.uniform(0.1, 0.5)), float(b.rng.uniform(0.3, 0.8))
        )
        b.add(owner, "cylinder", frame, (0, size, h), (size, size, h), c, "fabric", 0.4)


def rug(b: Builder) -> None:
    """A flat rug: seen, never touched."""
    w, d = float(b.rng.uniform(1.2, 2.2)), float(b.rng.uniform(0.9, 1.5))
    w, d = min(w, b.width - 0.6), min(d, b.depth - 0.6)
    x = float(b.rng.uniform(w / 2, b.width - w / 2))
    y = float(b.rng.uniform(d / 2, b.depth - d / 2))
    c = hsv(
        float(b.rng.random()), float(b.rng.uniform(0.1, 0.55)), float(b.rng.uniform(0.35, 0.85))
    )
    owner = b.new("Rug")
    b.add(
        owner,
        "box",
        Frame(x, y),
        (0, 0, 0.003),
        (w / 2, d / 2, 0.003),
        darker(c, 0.7),
        "fabric",
        0.5,
        solid=False,
    )
    b.add(
        owner,
        "box",
        Frame(x, y),
        (0, 0, 0.005),
        (w / 2 - 0.08, d / 2 - 0.08, 0.003),
        c,
        "carpet",
        0.7,
        solid=False,
    )
