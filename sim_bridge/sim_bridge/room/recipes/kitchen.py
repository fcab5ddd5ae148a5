"""The kitchen: units under worktops along one or two walls, a fridge, a table with chairs.

Units are models of one of two designs, or our own with a front and a worktop of their own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

from sim_bridge.room import fixtures as fx
from sim_bridge.room import objects as ob
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Colour, Frame, Surface, hsv
from sim_bridge.room.recipes.common import (
    against,
    clutter,
    hang,
    opposite,
    stand,
    table_with_chairs,
    tops,
)
from sim_bridge.sweet_home.table import Piece

STYLES = ("oak", "shaker")
DEPTH, HEIGHT, UNIT = 0.6, 0.88, 0.6
"""Of our own units, metres."""
FEWEST_UNITS = 2
CLEAR_M = 0.5
"""Free floor before a row."""
UPPER_M = 1.42
"""Where cupboards on the wall begin."""
WORKTOPS = ("kitchen_base", "counter")
"""Kinds of surfaces; those of units become one for each run of them."""


def furnish(kit: Kit) -> None:
    """Furnish a kitchen."""
    b = kit.b
    style = str(b.rng.choice(["oak", "shaker", "own", "own"]))
    row = _Row.drawn(kit, style if kit.choices("kitchen_base") else "own")
    first = _row(kit, row, sink=True, hob=True, at=None)
    if b.chance(0.45) and first is not None:
        _row(kit, row, sink=False, hob=False, at=first)
    if b.chance(0.3):
        fx.fridge(b)
    else:
        kit.stand("Fridge", clear=0.4)
    if b.chance(0.8):
        table_with_chairs(kit, 2, lambda piece: piece.entry.size[0] < 1.7)
    for role, p in {"washing_machine": 0.2, "bar_stool": 0.15, "sideboard": 0.1}.items():
        if b.chance(p):
            kit.stand(role)
    _things(kit)
    stand(kit, {"GarbageCan": 0.85, "HousePlant": 0.25})
    hang(kit, {"LightSwitch": 0.9, "Painting": 0.3, "Towel": 0.15})


def _things(kit: Kit) -> None:
    tops(kit, {"Pan": 0.8, "Pot": 0.8, "Kettle": 0.4}, "stove")
    tops(kit, {"Microwave": 0.85, "CoffeeMachine": 0.85, "Toaster": 0.85, "Kettle": 0.5,
               "Pot": 0.3, "Pan": 0.15}, *WORKTOPS)  # fmt: skip
    tops(kit, {"Bread": 0.85, "Mug": 0.9, "Apple": 0.9, "Spatula": 0.8, "Bowl": 0.8, "Plate": 0.8,
               "CellPhone": 0.2, "Book": 0.2, "Vase": 0.2, "SprayBottle": 0.1},
         *WORKTOPS, "dining_table")  # fmt: skip
    tops(kit, {"Laptop": 0.2, "HousePlant": 0.35, "Mug": 0.4, "Bowl": 0.3, "Plate": 0.3},
         *WORKTOPS, "dining_table", "sideboard")  # fmt: skip
    clutter(kit, "clutter_kitchen", 7, *WORKTOPS, "dining_table")


@dataclass(frozen=True)
class _Row:
    """How the units of a row look: a design of models, or colours of our own."""

    style: str
    front: Colour
    top: Colour
    top_texture: str
    handles: Colour

    @classmethod
    def drawn(cls, kit: Kit, style: str) -> _Row:
        """Drawn from the room's generator."""
        rng = kit.b.rng
        fronts = (
            hsv(0.1, 0.03, 0.95), hsv(0.12, 0.12, 0.9), hsv(0.6, 0.04, 0.6), hsv(0.6, 0.1, 0.3),
            hsv(0.08, 0.45, 0.7), hsv(0.45, 0.2, 0.6), hsv(0.6, 0.35, 0.45),
        )  # fmt: skip
        stones = ((0.9, 0.9, 0.88), (0.25, 0.25, 0.27), (0.6, 0.58, 0.55), (0.85, 0.62, 0.4))
        k = int(rng.integers(len(stones)))
        handles = ((0.75, 0.76, 0.78), (0.1, 0.1, 0.1), (0.7, 0.6, 0.35))[int(rng.integers(3))]
        return cls(style, fronts[int(rng.integers(len(fronts)))], stones[k],
                   "wood" if k == 3 else "marble", handles)  # fmt: skip


def _row(kit: Kit, row: _Row, sink: bool, hob: bool, at: Frame | None) -> Frame | None:
    """Units side by side along a wall, or along the wall that faces ``at``; its middle, or None."""
    b = kit.b
    units = _units(kit, row, sink, hob)
    frame = _place(kit, units, at)
    while frame is None and len(units) > FEWEST_UNITS:
        bases = [unit for unit in units if unit[2] == "base"]
        units.remove(bases[-1] if bases else units[-1])
        frame = _place(kit, units, at)
    if frame is None:
        return None
    total = sum(width for width, _, _ in units)
    b.occupy_wall(frame, total, 0, UPPER_M - 0.01)
    x, wall, before = -total / 2, b.new("Wall"), list(b.surfaces)
    for width, piece, what in units:
        place = frame.at(x + width / 2, 0)
        half = (_splash_top(kit, place, width) - HEIGHT + 0.02) / 2
        b.add(wall, "box", place, (0, -0.006, HEIGHT - 0.02 + half), (width / 2, 0.004, half),
              (1, 1, 1), "splash", 0.9, solid=False)  # fmt: skip
        if piece is not None:
            kit.add(piece, place)
        else:
            _own_unit(kit, row, place, width, what)
        if what == "hob":
            _hob(kit, place, HEIGHT if piece is None else _top(piece))
        x += width
    own_tops = [top for top in b.surfaces[len(before) :] if top.kind not in WORKTOPS]
    b.surfaces = [*before, *own_tops, *_worktops(frame, units)]
    if b.chance(0.75):
        _uppers(kit, row, frame, units)
        b.occupy_wall(frame, total, UPPER_M, 2.3)
    return frame


def _worktops(frame: Frame, units: list[Unit]) -> Iterator[Surface]:
    """One for each run of base units."""
    x = -sum(width for width, _, _ in units) / 2
    for what, run in groupby(units, lambda unit: unit[2]):
        some = list(run)
        length = sum(width for width, _, _ in some)
        if what == "base":
            tops = [HEIGHT if piece is None else _top(piece) for _, piece, _ in some]
            depths = [DEPTH if piece is None else piece.entry.size[1] for _, piece, _ in some]
            at = frame.at(x + length / 2, 0, max(tops))
            yield Surface(at, length, min(depths), "counter")
        x += length


def _splash_top(kit: Kit, frame: Frame, width: float) -> float:
    """How high the tiles behind a unit reach, metres: to the cupboards, or to a window."""
    top = UPPER_M + 0.02
    for pane in kit.around.panes:
        apart = math.hypot(pane.frame.x - frame.x, pane.frame.y - frame.y)
        same = abs(math.remainder(pane.frame.yaw - frame.yaw, math.tau)) < 0.1
        if same and apart < (pane.width + width) / 2 + 0.05:
            top = min(top, max(pane.low, HEIGHT))
    return top


def _place(kit: Kit, units: list[Unit], at: Frame | None) -> Frame | None:
    """A place for units along a wall, or along the one that ``at`` looks at; None without one."""
    b, total = kit.b, sum(width for width, _, _ in units)
    depth = max([piece.entry.size[1] for _, piece, _ in units if piece] or [DEPTH]) + CLEAR_M
    if at is not None:
        return opposite(b, at, total, depth, HEIGHT)
    return against(b, total, depth, HEIGHT, least=total + 0.1)


Unit = tuple[float, Piece | None, str]
"""Width (m), the model or None for one of our own, and what it is: base, sink or hob."""


def _units(kit: Kit, row: _Row, sink: bool, hob: bool) -> list[Unit]:
    b, found = kit.b, []

    def suits(piece: Piece) -> bool:
        return piece.style == row.style and piece.kind not in ("island", "corner")

    def base(what: str) -> Unit:
        wide = what == "hob"
        piece = kit.pick(
            "kitchen_base", lambda p: suits(p) and (not wide or p.entry.size[0] > 0.55)
        )
        if row.style in STYLES and piece is not None:
            return piece.entry.size[0], piece, what
        return UNIT, None, what

    for _ in range(int(b.rng.integers(2, 4))):
        found.append(base("base"))
    if sink:
        piece = kit.pick("Sink", lambda p: p.kind == "unit" and p.style == row.style)
        own: Unit = (UNIT + 0.2, None, "sink")
        found.insert(int(b.rng.integers(1, len(found))),
                     (piece.entry.size[0], piece, "sink") if piece else own)  # fmt: skip
    if hob:
        found.insert(int(b.rng.integers(1, len(found))), base("hob"))
    return found


def _top(piece: Piece) -> float:
    top = piece.entry.drop_on_top
    return piece.entry.size[2] if top is None else top


def _own_unit(kit: Kit, row: _Row, frame: Frame, width: float, what: str) -> None:
    """A base unit with its piece of worktop; an oven under a hob, a basin in a sink's."""
    b, d = kit.b, DEPTH - 0.02
    owner = b.new("Counter")
    b.add(owner, "box", frame, (0, d / 2 - 0.03, 0.05), (width / 2, d / 2 - 0.03, 0.05),
          (0.15, 0.15, 0.15))  # fmt: skip
    b.add(owner, "box", frame, (0, d / 2 - 0.01, 0.48), (width / 2, d / 2 - 0.01, 0.38), row.front,
          "paint", 1.0)  # fmt: skip
    b.add(owner, "box", frame, (0, DEPTH / 2, HEIGHT - 0.02), (width / 2, DEPTH / 2, 0.02), row.top,
          row.top_texture, 0.8)  # fmt: skip
    oven = kit.pick("oven", lambda p: not p.kind and p.entry.size[2] < 0.7)
    if what == "hob" and oven is not None and b.chance(0.85):
        kit.add(oven, frame.at(0, DEPTH + 0.005 - oven.entry.size[1], 0.14))
    elif b.chance(0.3) and what == "base":
        for z in (0.22, 0.48, 0.72):
            _front(kit, row, owner, frame, 0, z, width / 2, 0.115)
    else:
        doors = 2 if width > 0.7 else 1
        for k in range(doors):
            x = (k + 0.5) * width / doors - width / 2
            _front(kit, row, owner, frame, x, 0.48, width / doors / 2, 0.37)
    b.occupy_wall(frame, width, 0, HEIGHT + 0.45)
    if what == "sink":
        b.surfaces.append(Surface(frame.at(0, 0, HEIGHT), width, DEPTH, "sink_top"))
        ob.put(b, "Sink", ("sink_top",))


def _front(
    kit: Kit, row: _Row, owner: int, frame: Frame, x: float, z: float, half: float, high: float
) -> None:
    """A door or drawer front with its handle; middle and half sizes, metres."""
    kit.b.add(owner, "box", frame, (x, DEPTH - 0.015, z), (half - 0.004, 0.009, high), row.front,
              "panel_door" if row.style == "own" and high > 0.2 else "paint")  # fmt: skip
    kit.b.add(owner, "box", frame, (x, DEPTH, z + high - 0.05), (min(0.07, half / 2), 0.006, 0.006),
              row.handles, solid=False)  # fmt: skip


def _hob(kit: Kit, frame: Frame, top: float) -> None:
    """A hob in the worktop, pots on it, and a hood above."""
    hob = kit.pick("StoveBurner", lambda piece: piece.kind == "hob")
    if hob is None:
        return
    width, depth, height = hob.entry.size
    kit.add(hob, frame.at(0, (DEPTH - depth) / 2, top))
    kit.b.surfaces.append(
        Surface(frame.at(0, (DEPTH - depth) / 2, top + height), width, depth, "stove")
    )
    hood = kit.pick("hood")
    if hood is not None and kit.b.chance(0.7) and kit.b.take_wall(
        frame.at(0, -0.01), min(hood.entry.size[0], UNIT) - 0.12, UPPER_M + 0.06, 2.3
    ):  # fmt: skip
        kit.add(hood, frame.at(0, 0, max(hood.entry.elevation, 1.55)))


def _uppers(kit: Kit, row: _Row, frame: Frame, units: list[Unit]) -> None:
    """Cupboards on the wall above the units, but above hobs and under windows."""
    b = kit.b
    x = -sum(width for width, _, _ in units) / 2
    kind = "shaker" if row.style == "shaker" else "oak"
    for width, _, what in units:
        at, x = frame.at(x + width / 2, 0), x + width
        if what == "hob" or not b.take_wall(at.at(0, -0.01), width - 0.11, UPPER_M, 2.25):
            continue
        if row.style in STYLES:
            piece = kit.pick("kitchen_wall", lambda p, w=width: (  # type: ignore[misc]
                p.style == kind and not p.kind and p.entry.size[0] < w + 0.12
            ))  # fmt: skip
            if piece is not None:
                kit.add(piece, at.at(0, 0, max(piece.entry.elevation, UPPER_M)))
            continue
        owner = b.new("Cabinet")
        b.add(owner, "box", at, (0, 0.16, 1.8), (width / 2 - 0.002, 0.16, 0.36), row.front, "paint",
              1.0)  # fmt: skip
        doors = 2 if width > 0.7 else 1
        for k in range(doors):
            middle = (k + 0.5) * width / doors - width / 2
            half = width / doors / 2 - 0.004
            b.add(owner, "box", at, (middle, 0.325, 1.8), (half, 0.009, 0.355), row.front,
                  "panel_door")  # fmt: skip
            b.add(owner, "box", at, (middle, 0.34, 1.5), (0.05, 0.006, 0.006), row.handles,
                  solid=False)  # fmt: skip
