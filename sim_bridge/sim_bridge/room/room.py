"""A seeded furnished room of one of four types, of our own furniture or of Sweet Home 3D's models.

``generate_room(kind, seed)`` is a pure function of its arguments. Knows no MuJoCo.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cfnav_core.task.rooms import (
    AGAIN,
    BUILT_IN,
    CC0,
    SHIFTED,
    SWEET_HOME,
    VARIED,
    furniture_of,
    parse_room,
    split_of,
    type_of,
)
from cfnav_core.task.vocabulary import CATEGORY_ID
from sim_bridge.room import built_in, sweet_home
from sim_bridge.room.parts import Builder, Colour, Part, Placed, RoomObject
from sim_bridge.room.shell import finish
from sim_bridge.room.textures import Texture

ROOMS_VERSION = 1
"""Rises when a seed's room, its grid or its pictures come out otherwise; a test holds it."""

SIZES = {
    "kitchen": ((3.8, 5.4), (3.4, 4.8)),
    "living_room": ((4.4, 5.8), (3.8, 5.2)),
    "bedroom": ((3.9, 5.2), (3.5, 4.8)),
    "bathroom": ((3.0, 4.2), (2.8, 3.8)),
}
"""Range of width and range of depth of each type of room, metres."""


@dataclass(frozen=True)
class Room:
    """A furnished room.

    Attributes:
        kind: one of ``cfnav_core.task.rooms.KINDS``: furniture and type.
        seed: what it was drawn from.
        width, depth: inner size along x and y, metres.
        parts: everything solid, or visible and no model.
        placed: models of furniture, which are seen; what is touched of them are parts.
        objects: what the parts belong to; goals carry a category's name.
        textures: uint8 [N, N, 3] by name.
        ambient: 0..1, strength of the undirected light.
        lights: position (m) and colour of each lamp.
    """

    kind: str
    seed: int
    width: float
    depth: float
    parts: tuple[Part, ...]
    placed: tuple[Placed, ...]
    objects: tuple[RoomObject, ...]
    textures: dict[str, Texture]
    ambient: float
    lights: tuple[tuple[tuple[float, float, float], Colour], ...]

    @property
    def room_type(self) -> str:
        """One of ``cfnav_core.task.vocabulary.ROOM_TYPES``."""
        return type_of(self.kind)

    @property
    def name(self) -> str:
        """``kind:seed``, as given on command lines."""
        return f"{self.kind}:{self.seed}"

    @property
    def goals(self) -> tuple[str, ...]:
        """Categories present in the room, alphabetical."""
        return tuple(sorted({o.name for o in self.objects if o.name in CATEGORY_ID}))


def check_furniture(kinds: Iterable[str]) -> None:
    """Look whether the furniture of kinds of rooms is installed.

    Raises:
        ValueError: it is not; the message says how to install it.
    """
    for furniture in sweet_home.PIECES.keys() & set(map(furniture_of, kinds)):
        sweet_home.PIECES[furniture]()


def generate_room(kind: str, seed: int) -> Room:
    """Draw a room.

    Args:
        kind: kitchen, living_room, bedroom or bathroom; sweet_home.kitchen, cc0.kitchen and so on.
        seed: 0 or more; ``cfnav_core.task.rooms.SPLITS`` says what for.

    Raises:
        ValueError: unknown kind or negative seed, or furniture that is not installed.
    """
    parse_room(f"{kind}:{seed}")
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    room_type = type_of(kind)
    (wl, wh), (dl, dh) = SIZES[room_type]
    b = Builder(rng, float(rng.uniform(wl, wh)), float(rng.uniform(dl, dh)))
    b.wood_tones = [finish(rng) for _ in range(3)]
    if (furniture := furniture_of(kind)) in sweet_home.PIECES:
        held_out = split_of("worlds", seed) == "test"
        look = sweet_home.make(b, room_type, furniture, held_out)
    else:
        look = built_in.make(b, room_type)
    return Room(
        kind, seed, b.width, b.depth, tuple(b.parts), tuple(b.placed), tuple(b.objects),
        look.textures, look.ambient, look.lights,
    )  # fmt: skip


def room_source(kind: str, visual_shift: float = 0.0) -> str:
    """What a kind of room and its pictures are made by: their version, and another light and lens.

    Each furniture has a version of its own.
    """
    models = f"{SWEET_HOME} rooms {sweet_home.SWEET_HOME_VERSION}"
    made = {
        BUILT_IN: f"rooms {ROOMS_VERSION}",
        SWEET_HOME: models,
        CC0: f"{CC0} rooms {sweet_home.CC0_VERSION}",
        VARIED: f"{VARIED} rooms {sweet_home.VARIED_VERSION} of {models}",
    }[furniture_of(kind)]
    return made + (f"{SHIFTED}{visual_shift}" if visual_shift else "")


def room_of(name: str, source: str) -> Room:
    """The room that a scene was made of.

    Args:
        name: of the scene, such as kitchen:100.
        source: of the scene, see ``room_source``.

    Raises:
        ValueError: rooms of that name were made otherwise then, or there are none.
    """
    kind, seed = parse_room(name)
    made, today = source.partition(SHIFTED)[0], room_source(kind)
    if made != today:
        raise ValueError(
            f"found a scene of {name} made by another version ({made}, today's is {today}); "
            f"{AGAIN} with --rooms {name}"
        )
    return generate_room(kind, seed)
