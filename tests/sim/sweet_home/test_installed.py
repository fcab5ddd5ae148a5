"""Rooms with the models that the Debian package installs."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from sim_bridge.room.room import Room, generate_room
from sim_bridge.room.sweet_home import SWEET_HOME_VERSION
from sim_bridge.sweet_home.catalogue import SweetHomeError, furniture_folder
from sim_bridge.sweet_home.table import pieces
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import World

from cfnav_core.task.rooms import SWEET_HOME
from cfnav_core.task.vocabulary import ROOM_TYPES
from tests.sim.test_versions import Fingerprint

ROOMS = [
    (f"{SWEET_HOME}.{kind}", seed)
    for kind in ROOM_TYPES
    for seed in (*range(100, 107), *range(300, 303))
]
FEWEST_POSITIONS = 35
USUAL_POSITIONS = 80


def installed() -> bool:
    try:
        pieces()
    except SweetHomeError:
        return False
    return True


pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        not installed(), reason=f"sweethome3d-furniture is not in {furniture_folder()}"
    ),
]


def fingerprint(room: Room) -> str:
    made = hashlib.sha256(repr((room.parts, room.objects, room.lights, room.ambient)).encode())
    for placed in room.placed:
        made.update(repr((placed.model.id, placed.frame, placed.owners)).encode())
    for name in sorted(room.textures):
        made.update(room.textures[name].tobytes())
    return made.hexdigest()


def test_rooms_of_all_types_are_made_and_the_robot_gets_around():
    positions, blocked = [], []
    for kind, seed in ROOMS:
        room = generate_room(kind, seed)
        assert fingerprint(room) == fingerprint(generate_room(kind, seed))
        assert len(room.goals) >= 3, room.name
        grid = state_grid(World(room))
        positions.append(len(grid.positions))
        blocked.append(grid.collided.mean())
        assert positions[-1] >= FEWEST_POSITIONS, room.name
    assert np.mean(np.array(positions) >= USUAL_POSITIONS) >= 0.85
    assert 0.1 < np.median(blocked) < 0.3


def test_what_models_call_goals_is_in_their_files():
    for role in pieces().values():
        for piece in role:
            if piece.goals:
                names = {mesh.name for mesh in piece.load().meshes}
                assert set(piece.goals) <= names, piece.entry.id


def test_every_piece_of_the_table_can_be_read():
    for role in pieces().values():
        for piece in role:
            assert piece.load().meshes


@pytest.mark.parametrize(
    ("kind", "words", "numbers"),
    [
        ("kitchen", "b99840eae5a4", 22327.4587),
        ("living_room", "64748b1fdb0a", 10360.7169),
        ("bedroom", "a9e32b6ee637", 10587.6366),
        ("bathroom", "fdd5ccaad9a4", 10754.3916),
    ],
)
def test_the_version_holds(kind, words, numbers):
    """When this fails, either the change is a mistake or the version must rise with it."""
    room = generate_room(f"{SWEET_HOME}.{kind}", 100)
    models = [(placed.model.id, placed.frame, placed.owners) for placed in room.placed]
    made = Fingerprint([room.parts, room.objects, models, room.lights, room.ambient])
    assert (SWEET_HOME_VERSION, made.hash) == (1, words)
    assert made.sums[0] == pytest.approx(numbers, rel=1e-6)
