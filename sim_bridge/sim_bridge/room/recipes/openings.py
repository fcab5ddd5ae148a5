"""Doors, windows with what hangs before them, and lamps: where people and light come in."""

from __future__ import annotations

import math

import numpy as np

from sim_bridge.room import fixtures as fx
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Frame, hsv
from sim_bridge.room.shell import WALL_HEIGHT
from sim_bridge.room.surroundings import Pane
from sim_bridge.sweet_home.table import Piece

LEAF_M = 0.012
"""Of a door's leaf before the wall."""
MOST_OUT_M = 0.08
"""From the wall to the front of a window."""
SWING_M = 0.8
"""Free floor before a door."""
BESIDE_M = 0.9
"""Wall beside a window, both sides together, for its curtains."""
ROD_M = 0.1
"""From the wall to the rod of curtains."""
OWN_DOOR = (0.95, 2.08)
"""Width and height of our own, metres."""


def door(kit: Kit) -> None:
    """A door in a wall, its swing free. Entrance doors lead to kitchens and living rooms only."""
    b = kit.b
    indoors = kit.around.room_type in ("bedroom", "bathroom")
    piece = kit.pick(
        "door", lambda p: not (indoors and (p.kind == "entrance" or p.entry.size[0] > 1.1))
    )
    width, height = OWN_DOOR if piece is None else piece.entry.size[::2]
    frame = b.wall_spot(width, 0.0, height)
    if frame is None:
        return
    b.take(frame.at(0, 0.001), width, SWING_M)
    if piece is None:
        fx.door(b, frame, width, height)
    else:
        kit.add(piece, frame.at(0, LEAF_M - piece.entry.size[1] / 2 - leaf(piece)))
    if b.chance(0.8):
        side = 1.0 if b.chance(0.5) else -1.0
        kit.hang("LightSwitch", frame.at(side * (width / 2 + 0.16), 0))


def leaf(piece: Piece) -> float:
    """Where a door's leaf, or a pane, is in its frame: y in metres, where most looks forward."""
    corners = piece.load().triangles
    a, b, c = np.moveaxis(corners, 1, 0)
    cross = np.cross(b - a, c - a)
    front = cross[:, 1] > 0.9 * np.linalg.norm(cross, axis=1)
    bins = np.round(corners[front].mean(1)[:, 1] / 0.01).astype(int)
    low = int(bins.min())
    area = np.bincount(bins - low, cross[front, 1])
    return 0.01 * (low + int(area.argmax()))


def window(kit: Kit) -> None:
    """A window in its wall, then curtains or blinds before it."""
    b = kit.b
    bath = kit.around.room_type in ("bathroom", "kitchen")
    piece = kit.pick(
        "window", lambda p: p.kind != "french" and not (bath and p.entry.size[2] > 1.5)
    )
    if piece is None:
        width, height, low = (float(b.rng.uniform(*r)) for r in ((0.9, 1.5), (1.0, 1.3), (0.9, 1)))
    else:
        width, _, height = piece.entry.size
        low = min(piece.entry.elevation or 0.9, WALL_HEIGHT - 0.1 - height)
    frame = b.wall_spot(width + BESIDE_M, low, WALL_HEIGHT)
    if frame is None:
        return
    kit.around.panes.append(Pane(frame, low, width, height))
    b.add(b.new("Window"), "box", frame, (0, 0.003, low + height / 2),
          (width / 2 - 0.03, 0.003, height / 2 - 0.03), (1, 1, 1), "outdoors", solid=False,
          emission=0.3 + 0.6 * kit.around.daylight)  # fmt: skip
    if piece is None:
        fx.window_frame(b, frame, low, width, height)
    else:
        depth = piece.entry.size[1]
        out = min(LEAF_M + depth / 2 - leaf(piece), MOST_OUT_M)
        kit.add(piece, frame.at(0, out - depth, low))
    chance = {"bathroom": 0.1, "kitchen": 0.3}.get(kit.around.room_type, 0.7)
    if b.chance(0.45 if kit.around.room_type == "bedroom" else 0.25):
        _blinds(kit, frame, low, width, height)
    elif b.chance(chance):
        _curtains(kit, frame, low, width)


def _blinds(kit: Kit, frame: Frame, low: float, width: float, height: float) -> None:
    b, owner = kit.b, kit.b.new("Blinds")
    colour = hsv(float(b.rng.choice([0.1, 0.6, 0.08])), float(b.rng.uniform(0, 0.15)),
                 float(b.rng.uniform(0.75, 0.98)))  # fmt: skip
    drop, top = float(b.rng.uniform(0.35, 1.0)) * height / 2, low + height
    texture = "slats" if b.chance(0.7) else "fabric"
    b.add(owner, "box", frame, (0, 0.075, top + 0.02 - drop), (width / 2 + 0.03, 0.01, drop),
          colour, texture, 0.4, solid=False, emission=0.2)  # fmt: skip
    b.add(owner, "box", frame, (0, 0.075, top + 0.04), (width / 2 + 0.03, 0.025, 0.025), colour,
          solid=False)  # fmt: skip


def _curtains(kit: Kit, frame: Frame, low: float, width: float) -> None:
    """Curtains at both sides of a window, in folds from a rod, to the floor or the sill."""
    b, owner = kit.b, kit.b.new("Curtain")
    h, s = float(b.rng.choice([0.08, 0.1, 0.6, 0.95, 0.3])), float(b.rng.uniform(0.0, 0.45))
    colour = hsv(h, s, float(b.rng.uniform(0.5, 0.97)))
    long = low < 0.7 or (kit.around.room_type != "kitchen" and b.chance(0.6))
    top, bottom = WALL_HEIGHT - 0.12, 0.03 if long else low - 0.12
    reach, folds = float(b.rng.uniform(0.2, 0.34)), int(b.rng.integers(5, 8))
    half = reach / folds
    for side in (-1, 1):
        for k in range(folds):
            x = side * (width / 2 + 0.2 - 2 * half * (k + 0.5) + reach * 0.7)
            y = ROD_M + 0.018 * (-1) ** k
            b.add(owner, "cylinder", frame, (x, y, (top + bottom) / 2),
                  (half * 1.15, half * 1.15, (top - bottom) / 2), colour, solid=False)  # fmt: skip
    if long:
        b.occupy_wall(frame, width + BESIDE_M, 0.0, low)
    rod = (0.2, 0.2, 0.2) if b.chance(0.5) else (0.75, 0.7, 0.6)
    b.add(owner, "box", frame, (0, ROD_M, top + 0.02), (width / 2 + 0.42, 0.011, 0.011), rod,
          solid=False)  # fmt: skip


def lamps(kit: Kit) -> None:
    """One lamp of a model in the middle of the ceiling, or two plain ones, and their light."""
    b = kit.b
    strength, warmth = float(b.rng.uniform(0.35, 0.55)), float(b.rng.uniform(0.78, 1.0))
    colour = strength, strength * (1 + warmth) / 2, strength * warmth
    tallest = 0.3 if kit.around.room_type == "bathroom" else 0.7
    piece = kit.pick("ceiling_lamp", lambda p: p.entry.size[2] < tallest)
    places = [(0.5, 0.5)] if b.chance(0.7) or piece is None else [(0.28, 0.5), (0.72, 0.5)]
    for u, v in places:
        x, y = u * b.width, v * b.depth
        share = tuple(c * 1.2 / math.sqrt(len(places)) for c in colour)
        kit.around.lamps.append(((x, y, WALL_HEIGHT - 0.25), (share[0], share[1], share[2])))
        if piece is not None:
            _, depth, height = piece.entry.size
            kit.add(piece, Frame(x, y - depth / 2, WALL_HEIGHT - height))
