"""Models of furniture for one room: which ones, and how each is put down, up or on top.

Where a category has no model, or few, our own drawing stands in for it now and then.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from sim_bridge.room import objects as ob
from sim_bridge.room.parts import Builder, Frame, Surface
from sim_bridge.sweet_home.bands import boxes
from sim_bridge.sweet_home.table import Piece, pieces

FEW = 3
"""Models of a category; where it has fewer, half of them are our own drawings."""

SEATS = frozenset({"sofa", "ArmChair"})
BEDS = frozenset({"bed_double", "bed_single"})

Fits = Callable[[Piece], bool]


def any_piece(_: Piece) -> bool:
    """Every piece of a role will do."""
    return True


@dataclass
class Kit:
    """The furniture of one room.

    Attributes:
        b: what it goes into.
        room_type: of the room.
        held_out: whether the room has what only test rooms have, instead of what they do not.
    """

    b: Builder
    room_type: str
    held_out: bool

    def choices(self, role: str, fits: Fits = any_piece) -> list[Piece]:
        """The pieces of a role that suit the room; those of both sides where its own has none."""
        suits = [
            piece
            for piece in pieces().get(role, ())
            if (not piece.rooms or self.room_type in piece.rooms) and fits(piece)
        ]
        own = [piece for piece in suits if piece.held_out == self.held_out]
        return own or suits

    def pick(self, role: str, fits: Fits = any_piece) -> Piece | None:
        """One of them at random, None when there is none."""
        found = self.choices(role, fits)
        return found[int(self.b.rng.integers(len(found)))] if found else None

    def add(self, piece: Piece, back: Frame, turn: float = 0.0, owner: int = -1) -> int:
        """Put a piece where its back edge's middle is at ``back``; returns its object.

        Args:
            piece: what to put.
            back: y to its front, metres.
            turn: about its own middle, radians.
            owner: the object that it is part of; a new one when -1.
        """
        model = piece.load()
        _, depth, height = piece.entry.size
        frame = back.at(0, depth / 2, 0, turn)
        own = abs(frame.z - piece.entry.elevation) < 0.01
        solid = model.boxes if own else boxes(model.triangles, frame.z)
        owner = self.b.new(piece.role) if owner < 0 else owner
        self.b.put(owner, frame, model, solid)
        self._offer(piece, back, height)
        return owner

    def _offer(self, piece: Piece, back: Frame, height: float) -> None:
        top, (width, depth, _) = piece.entry.drop_on_top, piece.entry.size
        if top is None or back.z + top > 1.3:
            return
        kind, start = piece.role, 0.0
        if piece.role in SEATS:
            kind, start, width = "seat", 0.35 * depth, 0.7 * width
        elif piece.role in BEDS:
            self.b.surfaces.append(Surface(back.at(0, 0.06, top), width, 0.5, "bed_head"))
            kind, start = "bed", 0.35 * depth
        elif top < 0.9 * height:
            return  # something stands up beside the place where things go: a tap, a backrest
        self.b.surfaces.append(Surface(back.at(0, start, top), width, depth - start, kind))

    def stand(self, role: str, wall: bool = True, gap: float = 0.0, fits: Fits = any_piece) -> Frame | None:
        """Stand a piece of a role against a wall or in the room; its back edge's middle, or None."""
        piece = self.pick(role, fits)
        if piece is None:
            return None
        width, depth, height = piece.entry.size
        frame = self.b.place(width, depth, wall, gap)
        if frame is None:
            return None
        self.add(piece, frame)
        if wall:
            self.b.occupy_wall(frame, width, 0, height)
        return frame

    def beside(self, piece: Piece, back: Frame, gap: float = 0.0) -> bool:
        """Stand a piece at a place, unless that is taken; says whether it stands."""
        width, depth, _ = piece.entry.size
        if not self.b.take(back, width, depth, gap):
            return False
        self.add(piece, back)
        return True

    def drawn(self, category: str) -> bool:
        """Whether our own drawing of a category takes its turn."""
        if category not in ob.DRAWERS:
            return False
        count = len(self.choices(category, _free_standing))
        return count == 0 or (count < FEW and self.b.chance(0.5))

    def top(self, category: str, kinds: tuple[str, ...]) -> bool:
        """Put one thing on a surface of one of the kinds; False when none has room."""
        if self.drawn(category):
            return ob.put(self.b, category, kinds)
        piece = self.pick(category, _free_standing)
        if piece is None:
            return False
        width, depth, height = piece.entry.size
        found = ob.spot(self.b, category, kinds, math.hypot(width, depth) / 2)
        if found is None:
            return False
        turn = 0.0 if category in ob.FACING else float(self.b.rng.uniform(-0.6, 0.6))
        self.add(piece, found.at(0, -depth / 2), turn)
        return True

    def floor(self, category: str) -> bool:
        """Stand one thing on the floor; False when there is no place."""
        if self.drawn(category):
            return ob.stand(self.b, category)
        return self.stand(category, wall=self.b.chance(0.85), fits=_free_standing) is not None

    def hang(self, category: str) -> bool:
        """Hang one thing on a free stretch of wall; False when there is none."""
        if category in ob.WALL_SPANS and self.drawn_wall(category):
            return ob.hang(self.b, category)
        piece = self.pick(category, _on_wall)
        if piece is None:
            return False
        width, _, height = piece.entry.size
        low = piece.entry.elevation or WALL_HEIGHTS.get(category, 1.3)
        frame = self.b.wall_spot(width, low, low + height)
        if frame is None:
            return False
        self.add(piece, frame.at(0, 0, low))
        return True

    def drawn_wall(self, category: str) -> bool:
        """The same as ``drawn``, of things on walls."""
        count = len(self.choices(category, _on_wall))
        return count == 0 or (count < FEW and self.b.chance(0.5))


WALL_HEIGHTS = {"LightSwitch": 1.05, "Towel": 0.8, "ToiletPaper": 0.7, "wall_socket": 0.2}
"""Lower edge of what hangs there, metres, where the catalogue says none."""


def _on_wall(piece: Piece) -> bool:
    return piece.wall


def _free_standing(piece: Piece) -> bool:
    return not piece.wall
