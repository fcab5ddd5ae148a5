"""Rooms furnished with Sweet Home 3D's models, as people furnish theirs.

What belongs together stands together: a low table and armchairs before the sofa, which faces the
television; night stands beside the bed; kitchen units in a row; chairs at tables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cfnav_core.task.rooms import CC0, SWEET_HOME, VARIED
from sim_bridge.room import materials as ma
from sim_bridge.room.built_in import Look
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Builder
from sim_bridge.room.recipes import bathroom, bedroom, kitchen, living_room
from sim_bridge.room.recipes.common import hang, litter
from sim_bridge.room.recipes.openings import door, lamps, window
from sim_bridge.room.surroundings import Surroundings
from sim_bridge.room.textures import TEXTURES
from sim_bridge.sweet_home.table import Piece, pieces, shipped_pieces
from sim_bridge.sweet_home.variation import varied

SWEET_HOME_VERSION, CC0_VERSION, VARIED_VERSION = 2, 2, 1
"""Each rises when a seed's room comes out otherwise: with the recipes, the table of models or how
they are read, that of CC0 with the models that come with cfnav, and the last one with how they are
varied."""

PIECES: dict[str, Callable[[], Mapping[str, tuple[Piece, ...]]]] = {
    SWEET_HOME: pieces, CC0: shipped_pieces, VARIED: pieces,
}  # fmt: skip
"""The models of a furniture."""

RECIPES: dict[str, Callable[[Kit], None]] = {
    "kitchen": kitchen.furnish, "living_room": living_room.furnish, "bedroom": bedroom.furnish,
    "bathroom": bathroom.furnish,
}  # fmt: skip


def make(b: Builder, room_type: str, furniture: str, held_out: bool) -> Look:
    """Build and furnish a room.

    Args:
        b: empty.
        room_type: one of ``cfnav_core.task.vocabulary.ROOM_TYPES``.
        furniture: one of ``PIECES``.
        held_out: whether the room has the models that only test rooms have.

    Raises:
        SweetHomeError: the furniture is not installed.
    """
    around = Surroundings(b, room_type)
    around.build()
    b.tallest = 2.0
    found = PIECES[furniture]()
    if furniture == VARIED:
        found = varied(found, b.rng)
    kit = Kit(around, found, held_out, sparse=furniture == CC0)
    door(kit)
    for _ in range(int(b.rng.integers(1, 3))):
        window(kit)
    lamps(kit)
    RECIPES[room_type](kit)
    if b.chance(0.5):
        kit.stand("radiator")
    litter(kit)
    hang(kit, {"wall_socket": 0.8})
    if room_type == "bathroom":
        if b.chance(0.2):
            kit.hang("clutter_wall", fits=lambda piece: room_type in piece.rooms)
    else:
        hang(kit, {"wall_socket": 0.5, "clutter_wall": 0.3, "wall_lamp": 0.2, "clock_wall": 0.08})
    return Look(_textures(around), around.lights(), float(b.rng.uniform(0.5, 0.66)))


def _textures(around: Surroundings) -> dict[str, np.ndarray]:
    """Those that parts of the room use."""
    b = around.b
    used = {part.texture for part in b.parts}
    made = {name: make(b.rng) for name, make in TEXTURES.items() if name in used}
    made |= {f"picture{i}": ma.art(b.rng) for i in range(3) if f"picture{i}" in used}
    if "outdoors" in used:
        made["outdoors"] = ma.outdoors(b.rng)
    if "splash" in used:
        tiles = ma.tiles(b.rng, 0.9, 0.9, wall=True)
        made["splash"] = (tiles * 255).astype(np.uint8)
    return made | around.pictures()
