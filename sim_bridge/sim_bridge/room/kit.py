"""Models of furniture for one room: which ones, and how each is put down, up or on top.

Where a category has no model, or few, our own drawing stands in for it now and then. Where a role
has none, its recipe stands our own furniture there, or goes without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from sim_bridge.room import objects as ob
from sim_bridge.room.parts import Builder, Frame, Placed, Surface
from sim_bridge.room.surroundings import Surroundings
from sim_bridge.sweet_home.bands import BANDS, Box
from sim_bridge.sweet_home.model import Model
from sim_bridge.sweet_home.shelves import shelves
from sim_bridge.sweet_home.table import Piece

FEW = 3
"""Models of a category; where a room has fewer to choose from, half of its things are our own."""
OWN_M = 0.36
"""Floor that one of our own things takes each way, metres."""
SEATS = frozenset({"sofa", "ArmChair"})
BEDS = frozenset({"bed_double", "bed_single"})
CASES = frozenset({"bookcase", "tv_stand", "sideboard"})
"""Furniture that has places inside."""
MAST_FROM_M, MAST_TO_M = BANDS[-1]
"""Between these heights only the mast can touch."""
WALL_HEIGHTS = {"LightSwitch": 1.05, "Towel": 0.8, "ToiletPaper": 0.7, "wall_socket": 0.2}
"""Lower edge of what hangs there, metres, where the catalogue says none."""

Fits = Callable[[Piece], bool]


def any_piece(_: Piece) -> bool:
    """Every piece of a role will do."""
    return True


def on_wall(piece: Piece) -> bool:
    """Whether a piece is fixed to a wall."""
    return piece.wall


def on_floor(piece: Piece) -> bool:
    """Whether a piece stands on the floor; plants only where the table says so."""
    if piece.role == "HousePlant":
        return "floor" in piece.on
    return not piece.wall and (not piece.on or "floor" in piece.on)


def on_top(piece: Piece) -> bool:
    """Whether a piece stands on furniture."""
    return not piece.wall and piece.on != ("floor",)


@dataclass
class Kit:
    """The furniture of one room.

    Attributes:
        around: walls, windows and lamps of the room.
        pieces: models by role; a role may have none.
        held_out: whether the room has what only test rooms have, instead of what they do not.
        sparse: whether there are few models: then no clutter stands twice in the room, and where it
            has none of its own, what only the other rooms should have stands there.
    """

    around: Surroundings
    pieces: Mapping[str, tuple[Piece, ...]]
    held_out: bool
    sparse: bool = False

    @property
    def b(self) -> Builder:
        """What the furniture goes into."""
        return self.around.b

    def choices(self, role: str, fits: Fits = any_piece) -> list[Piece]:
        """The pieces of a role that suit the room.

        A test room has those of other rooms where there are none for test rooms only.
        """
        suits = [
            piece
            for piece in self.pieces.get(role, ())
            if (not piece.rooms or self.around.room_type in piece.rooms) and fits(piece)
        ]
        own = [piece for piece in suits if piece.held_out == self.held_out]
        if self.held_out or self.sparse:
            own = own or suits
        if self.sparse and role.startswith("clutter"):
            there = {placed.model.id for placed in self.b.placed}
            return [piece for piece in own if piece.entry.id not in there]
        return own

    def pick(self, role: str, fits: Fits = any_piece) -> Piece | None:
        """One of them at random, None when there is none."""
        found = self.choices(role, fits)
        return found[int(self.b.rng.integers(len(found)))] if found else None

    def add(self, piece: Piece, back: Frame, turn: float = 0.0) -> Frame:
        """Put a piece where its back edge's middle is at ``back``, and offer its tops.

        Args:
            piece: what to put.
            back: y to its front, metres.
            turn: about its own middle, radians.

        Returns:
            The frame of its middle.
        """
        model = piece.load()
        frame = back.at(0, piece.entry.size[1] / 2, 0, turn)
        own = self.b.new("Rug" if piece.role == "rug" else piece.role)
        apart: dict[str, int] = {}
        for mesh in model.meshes:
            if mesh.name in piece.goals and mesh.name not in apart:
                apart[mesh.name] = self.b.new(piece.goals[mesh.name])
        owners = tuple(apart.get(mesh.name, own) for mesh in model.meshes)
        self.b.put(own, Placed(model, frame, owners), _touched(piece, model, frame.z))
        self._offer(piece, model, back)
        return frame

    def _offer(self, piece: Piece, model: Model, back: Frame) -> None:
        top, (width, depth, height) = piece.entry.drop_on_top, piece.entry.size
        if piece.role in CASES:
            for shelf in shelves(model.triangles, model.size):
                if 0.25 < shelf.z < 1.5:
                    self.b.surfaces.append(Surface(
                        back.at(shelf.x, 0.02, shelf.z + 0.005), shelf.width, depth - 0.04,
                        "shelf" if piece.role == "bookcase" else piece.role, shelf.clear,
                    ))  # fmt: skip
        if top is None or back.z + top > 1.3:
            return
        kind, start = piece.role, 0.0
        if piece.role in SEATS:
            kind, start, width = "seat", 0.35 * depth, 0.7 * width
        elif piece.role in BEDS:
            self.b.surfaces.append(Surface(back.at(0, 0.06, top), width, 0.5, "bed_head"))
            kind, start = "bed", 0.35 * depth
        elif top < 0.9 * height or piece.role in ob.DRAWERS:
            return  # something stands up beside the place where things go: a tap, a backrest
        self.b.surfaces.append(Surface(back.at(0, start, top), width, depth - start, kind))

    def stand(
        self, role: str, wall: bool = True, gap: float = 0.0, fits: Fits = any_piece,
        clear: float = 0.0,
    ) -> tuple[Piece, Frame] | None:  # fmt: skip
        """Stand a piece of a role against a wall or in the room.

        Args:
            role: of the piece.
            wall: against a wall or free-standing.
            gap: free margin to other furniture, metres.
            fits: which pieces will do.
            clear: free floor before its front, metres.

        Returns:
            The piece and its back edge's middle, None when there is no such piece or no place.
        """
        piece = self.pick(role, fits)
        if piece is None:
            return None
        width, depth, height = piece.entry.size
        frame = self.b.place(width, depth + clear, wall, gap, height)
        if frame is None:
            return None
        self.add(piece, frame.at(0, 0, piece.entry.elevation))
        if wall:
            self.b.occupy_wall(frame, width, 0, piece.entry.elevation + height)
        return piece, frame

    def beside(self, piece: Piece | None, back: Frame, turn: float = 0.0) -> bool:
        """Stand a piece at a place, unless that is taken; says whether it stands."""
        if piece is None or not self.b.take(back, *piece.entry.size[:2]):
            return False
        self.add(piece, back, turn)
        return True

    def drawn(self, category: str, fits: Fits) -> bool:
        """Whether our own drawing of a category takes its turn."""
        if category not in ob.DRAWERS:
            return False
        count = len(self.choices(category, fits))
        return count == 0 or (count < FEW and self.b.chance(0.5))

    def top(self, category: str, kinds: tuple[str, ...], fits: Fits = any_piece) -> bool:
        """Put one thing on a surface of one of the kinds; False when none has room."""

        def will_do(piece: Piece) -> bool:
            return on_top(piece) and bool(_kinds(piece, kinds)) and fits(piece)

        if category not in ob.WALL_SPANS and self.drawn(category, will_do):
            return ob.put(self.b, category, kinds)
        piece = self.pick(category, will_do)
        if piece is None:
            return False
        most = 0.15 if category in ob.BACK_OF_SURFACE | ob.FACING else 0.6
        turn = float(self.b.rng.uniform(-most, most))
        found = self._spot(piece, _kinds(piece, kinds), turn)
        if found is None:
            return False
        self.add(piece, found.at(0, -piece.entry.size[1] / 2), turn)
        return True

    def _spot(self, piece: Piece, kinds: tuple[str, ...], turn: float) -> Frame | None:
        """Where a turned piece stands wholly on a surface and beside what is there, now taken."""
        b, (width, depth, height) = self.b, piece.entry.size
        c, s = abs(math.cos(turn)), abs(math.sin(turn))
        across, along = (c * width + s * depth) / 2, (s * width + c * depth) / 2
        radius = math.hypot(width, depth) / 2
        tops = [
            top for top in b.surfaces
            if top.kind in kinds and top.clear >= height
            and top.width > 2 * across and top.depth > 2 * along
        ]  # fmt: skip
        for _ in range(40 if tops else 0):
            top = tops[int(b.rng.integers(len(tops)))]
            x = float(b.rng.uniform(across - top.width / 2, top.width / 2 - across))
            y = float(b.rng.uniform(along, top.depth - along))
            if piece.role in ob.BACK_OF_SURFACE:
                y = min(y, max(along, 0.42 * top.depth))
            if all(
                on is not top or math.hypot(x - u, y - v) >= radius + r
                for on, u, v, r in b.on_surface
            ):
                b.on_surface.append((top, x, y, radius))
                return top.frame.at(x, y)
        return None

    def floor(self, category: str, wall: float = 0.95) -> bool:
        """Stand one thing on the floor, against a wall with a chance; False without a place."""
        at_wall = self.b.chance(wall)
        if not self.drawn(category, on_floor):
            return self.stand(category, at_wall, fits=on_floor) is not None
        frame = self.b.place(OWN_M, OWN_M, at_wall, height=0.6)
        if frame is None:
            return False
        ob.DRAWERS[category](self.b, self.b.new(category), frame.at(0, OWN_M / 2))
        return True

    def hang(self, category: str, at: Frame | None = None, fits: Fits = any_piece) -> bool:
        """Hang one thing on a wall.

        Args:
            category: of the thing, or its role.
            at: frame on the wall below it; anywhere when None.
            fits: which models will do.

        Returns:
            False when there is no such thing or the wall is taken.
        """
        b = self.b
        if category in ob.WALL_SPANS and self.drawn(category, on_wall):
            if at is None:
                return ob.hang(b, category)
            if not b.take_wall(at, *ob.WALL_SPANS[category]):
                return False
            ob.DRAWERS[category](b, b.new(category), at)
            return True
        piece = self.pick(category, lambda piece: on_wall(piece) and fits(piece))
        if piece is None:
            return False
        width, _, height = piece.entry.size
        low = piece.entry.elevation or WALL_HEIGHTS.get(category, 1.3)
        if at is None:
            at = b.wall_spot(width, low, low + height)
        elif not b.take_wall(at, width, low, low + height):
            return False
        if at is None:
            return False
        self.add(piece, at.at(0, 0, low))
        return True


def _kinds(piece: Piece, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Those kinds of surfaces on which a piece may stand."""
    return tuple(kind for kind in kinds if not piece.on or kind in piece.on)


def _touched(piece: Piece, model: Model, z: float) -> tuple[Box, ...]:
    """The boxes of a model whose bottom is at a height (m): one of what stands on something."""
    if piece.role == "rug":
        return ()  # one drives over it
    if abs(z - piece.entry.elevation) < 0.01 and z < MAST_FROM_M:
        return model.boxes
    width, depth, height = model.size
    whole = Box((0.0, 0.0, height / 2), (width / 2, depth / 2, height / 2))
    return (whole,) if z < MAST_TO_M else ()
