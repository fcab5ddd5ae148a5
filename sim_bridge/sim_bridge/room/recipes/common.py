"""What recipes share: things on tops and walls, tables with chairs, rugs, clutter."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim_bridge.room.kit import Fits, Kit, any_piece, on_floor
from sim_bridge.room.parts import Builder, Frame, hsv
from sim_bridge.sweet_home.table import Piece

TABLE_TOPS = (
    "dining_table", "low_table", "side_table", "sideboard", "side", "dresser", "desk", "shelf",
)  # fmt: skip
"""Kinds of surfaces in rooms to live in."""
LARGE_M = 0.75
"""From this length on what lies about is in the way."""
NEVER_ABOUT = frozenset({
    "Blend Swap CC-0#table_football", "Blend Swap CC-BY#treadmill", "Scopia#christmas_tree",
    "Blend Swap CC-BY#abdominalBench", "Scopia#step-ladder-metal", "Blend Swap CC-0#ammoBox",
})  # fmt: skip
"""Clutter that fills a room."""


def tops(kit: Kit, chances: Mapping[str, float], *kinds: str) -> None:
    """Put things on surfaces of some kinds, each with its chance."""
    for category, p in chances.items():
        if kit.b.chance(p):
            kit.top(category, kinds)


def hang(kit: Kit, chances: Mapping[str, float]) -> None:
    """Hang things on free walls, each with its chance."""
    for category, p in chances.items():
        if kit.b.chance(p):
            kit.hang(category)


def stand(kit: Kit, chances: Mapping[str, float]) -> None:
    """Stand things on the floor, each with its chance."""
    for category, p in chances.items():
        if kit.b.chance(p):
            kit.floor(category)


def clutter(kit: Kit, role: str, most: int, *kinds: str) -> None:
    """Up to so many small things of a role on surfaces."""
    for _ in range(int(kit.b.rng.integers(0, most + 1))):
        kit.top(role, kinds)


def litter(kit: Kit) -> None:
    """What stands about on the floor: up to two small things, seldom a large one."""

    def small(piece: Piece) -> bool:
        return on_floor(piece) and max(piece.entry.size[:2]) < LARGE_M

    def large(piece: Piece) -> bool:
        return on_floor(piece) and not small(piece) and piece.entry.id not in NEVER_ABOUT

    if kit.around.room_type == "bathroom":
        return
    for _ in range(int(kit.b.rng.integers(0, 3))):
        kit.stand("clutter_floor", wall=kit.b.chance(0.97), fits=small)
    if kit.b.chance(0.15):
        kit.stand("clutter_floor", fits=large)


def within(b: Builder, frame: Frame, margin: float = 0.3) -> bool:
    """Whether a frame is that far (m) from the outer walls."""
    return margin < frame.x < b.width - margin and margin < frame.y < b.depth - margin


def against(
    b: Builder, width: float, depth: float, height: float, least: float = 0.0
) -> Frame | None:
    """A place at a wall that is at least so long, as the largest thing of a room wants; metres."""
    found = None
    for _ in range(8):
        wall = b.stretches[int(b.rng.integers(len(b.stretches)))]
        reach = width / 2 + 0.01
        if wall.high - wall.low < max(width + 0.04, least):
            continue
        middle, spread = (wall.low + wall.high) / 2, (wall.high - wall.low) / 2 - reach
        u = middle + spread * float(b.rng.uniform(-0.7, 0.7))
        found = wall.frame(u, 0.01)
        if b.uncovered(found, width, height) and b.take(found, width, depth):
            return found
    return b.place(width, depth, height=height)


def opposite(b: Builder, frame: Frame, width: float, depth: float, height: float) -> Frame | None:
    """A place at the wall that a frame looks at, as near to straight ahead as is free; metres."""
    ahead = [
        wall for wall in b.stretches
        if abs(math.remainder(frame.yaw + math.pi - wall.yaw, math.tau)) < 0.1
    ]  # fmt: skip
    for aside in (0.0, 0.25, -0.25, 0.5, -0.5, 0.8, -0.8):
        for wall in ahead:
            u = (frame.x if wall.along == 0 else frame.y) + aside
            if wall.low + width / 2 < u < wall.high - width / 2:
                place = wall.frame(u, 0.01)
                if b.uncovered(place, width, height) and b.take(place, width, depth):
                    return place
    return None


def table_with_chairs(kit: Kit, least: int, fits: Fits = any_piece) -> Frame | None:
    """A table free in the room, chairs of one design at its sides, looking at it.

    Args:
        kit: the furniture of the room.
        least: chairs where there is space.
        fits: which tables will do.
    """
    b = kit.b
    table = kit.pick("dining_table", lambda piece: piece.kind != "bar" and fits(piece))
    chair = kit.pick("Chair", _at_table)
    if table is None or chair is None:
        return None
    width, depth, height = table.entry.size
    back = b.place(width, depth, wall=False, gap=0.4) or b.place(
        width, depth, gap=0.3, height=height
    )
    if back is None:
        return None
    kit.add(table, back)
    middle, seat = back.at(0, depth / 2), chair.entry.size[1]
    places = []
    quarter = math.pi / 2
    for turns in range(4):
        yaw, (along, across) = turns * quarter, (depth, width) if turns % 2 else (width, depth)
        row = 2 if along > 1.25 else 1
        places += [(yaw, (k + 0.5) * along / row - along / 2, across) for k in range(row)]
    order = b.rng.permutation(len(places))
    for k in order[: int(b.rng.integers(least, len(places) + 1))]:
        yaw, along, across = places[int(k)]
        tucked = float(b.rng.uniform(0.05, 0.3))
        # its back edge is the far one
        at = middle.at(0, 0, 0, yaw).at(along, across / 2 + seat - tucked, 0, math.pi)
        if within(b, at):
            kit.add(chair, at, float(b.rng.normal(0, 0.12)))
    return back


def _at_table(chair: Piece) -> bool:
    return chair.entry.size[2] > 0.7 and "office" not in chair.entry.id


def rug(kit: Kit, middle: Frame, large: bool = True) -> None:
    """A rug under a place: a model, or one of our own in a quiet colour."""
    b = kit.b
    piece = kit.pick(
        "rug", lambda piece: not piece.kind and (max(piece.entry.size[:2]) > 1) == large
    )
    if piece is not None and b.chance(0.3 if large else 0.6):
        width, depth, _ = piece.entry.size
        if within(b, middle, min(width, depth) / 2):
            kit.add(piece, middle.at(0, -depth / 2))
        return
    low, high = (0.8, 1.3) if large else (0.32, 0.5)
    w = float(b.rng.uniform(low, high))
    d = w * float(b.rng.uniform(0.6, 0.9))
    colour = hsv(float(b.rng.choice([0.05, 0.1, 0.6, 0.95, 0.3])), float(b.rng.uniform(0.05, 0.45)),
                 float(b.rng.uniform(0.35, 0.85)))  # fmt: skip
    owner = b.new("Rug")
    if b.chance(0.4):
        edge = tuple(0.6 * c for c in colour)
        b.add(owner, "box", middle, (0, 0, 0.003), (w, d, 0.003), (edge[0], edge[1], edge[2]),
              "carpet", 0.5, solid=False)  # fmt: skip
        w, d = w - 0.1, d - 0.1
    b.add(owner, "box", middle, (0, 0, 0.005), (w, d, 0.003), colour, "carpet", 0.5, solid=False)
