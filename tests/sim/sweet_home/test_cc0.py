"""Rooms of the models that come with cfnav, where the Debian package is not installed."""

from __future__ import annotations

import hashlib
import re
import zipfile
from collections.abc import Iterator

import numpy as np
import pytest
from sim_bridge.data.dataset import RoomOptions
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Builder
from sim_bridge.room.room import Room, check_furniture, generate_room, room_source
from sim_bridge.room.shell import finish
from sim_bridge.room.surroundings import Surroundings
from sim_bridge.room.sweet_home import CC0_VERSION, RECIPES
from sim_bridge.sweet_home import catalogue
from sim_bridge.sweet_home.catalogue import SHIPPED, SweetHomeError, shipped
from sim_bridge.sweet_home.table import shipped_pieces
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import Pose, World

from cfnav_core.task.rooms import CC0
from cfnav_core.task.vocabulary import ROOM_TYPES
from tests.sim.test_versions import furnished

MOST_BYTES = 5_000_000
SEEDS = (25, 100, 101, 102, 300, 301)
USUAL = {
    "kitchen": {"Fridge", "Sink", "StoveBurner", "CoffeeMachine", "Bread", "Pan", "Chair", "Mug"},
    "living_room": {"Television", "Painting", "RemoteControl", "HousePlant", "FloorLamp", "Vase"},
    "bedroom": {"Pillow", "AlarmClock", "DeskLamp", "Laptop", "Book", "Chair", "Painting"},
    "bathroom": {"Sink", "Towel", "SoapBar", "ToiletPaper", "Mirror", "SprayBottle"},
}
"""Categories that some rooms of a type must have, of six."""
FEWEST_GOALS, USUAL_GOALS = 3, 6


@pytest.fixture(autouse=True, scope="module")
def bare_machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No package, and nobody's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFNAV_SWEET_HOME", str(tmp_path_factory.mktemp("nothing")))
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


def fingerprint(room: Room) -> str:
    made = hashlib.sha256(repr((room.parts, room.objects, room.lights, room.ambient)).encode())
    for placed in room.placed:
        made.update(repr((placed.model.id, placed.frame, placed.owners)).encode())
        for mesh in placed.model.meshes:
            made.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
    for name in sorted(room.textures):
        made.update(room.textures[name].tobytes())
    return made.hexdigest()


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_rooms_hold_what_is_looked_for_there(room_type):
    rooms = [generate_room(f"{CC0}.{room_type}", seed) for seed in SEEDS]
    for room in rooms:
        assert len(room.goals) >= FEWEST_GOALS, room.name
        assert len(room.placed) >= 3, room.name
        assert {placed.model.id for placed in room.placed} <= set(shipped())
        assert {"Door", "Window"} <= {thing.name for thing in room.objects}
    assert np.median([len(room.goals) for room in rooms]) >= USUAL_GOALS
    assert USUAL[room_type] <= {goal for room in rooms for goal in room.goals}


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_a_name_is_always_the_same_room(room_type):
    first, again, other = (generate_room(f"{CC0}.{room_type}", seed) for seed in (25, 25, 26))
    assert fingerprint(first) == fingerprint(again) != fingerprint(other)


def test_the_robot_gets_around_and_sees():
    world = World(generate_room(f"{CC0}.kitchen", 25))
    grid = state_grid(world)
    assert len(grid.positions) >= 80
    with Camera(world) as camera:
        x, y = grid.positions[0]
        assert camera.rgb(Pose(x, y, 0.0, 0.0)).std() > 10


def test_test_rooms_alone_have_what_is_held_out():
    held_out = {
        piece.entry.id: piece.held_out for role in shipped_pieces().values() for piece in role
    }
    both = {
        role for role, found in shipped_pieces().items() if len({p.held_out for p in found}) > 1
    }
    assert {"Chair", "ArmChair", "StoveBurner", "wardrobe", "dining_table"} <= both
    of_role = {p.entry.id: role for role, found in shipped_pieces().items() for p in found}
    for room_type in ROOM_TYPES:
        for seed in (100, 300):
            for placed in generate_room(f"{CC0}.{room_type}", seed).placed:
                if of_role[placed.model.id] in ("Chair", "ArmChair", "StoveBurner"):
                    assert held_out[placed.model.id] == (seed == 300)


def test_no_clutter_stands_twice_where_there_is_little():
    for room_type in ROOM_TYPES:
        clutter = {
            p.entry.id
            for role, found in shipped_pieces().items()
            if "clutter" in role
            for p in found
        }
        for seed in SEEDS:
            ids = [p.model.id for p in generate_room(f"{CC0}.{room_type}", seed).placed]
            twice = {i for i in ids if ids.count(i) > 1}
            assert not twice & clutter, (room_type, seed)


def test_a_kit_without_any_model_still_makes_rooms():
    for room_type, furnish in RECIPES.items():
        b = Builder(np.random.default_rng(0), 5.0, 4.0)
        b.wood_tones = [finish(b.rng)]
        around = Surroundings(b, room_type)
        around.build()
        furnish(Kit(around, {}, held_out=False))
        assert not b.placed
        assert len(b.objects) > 8


def test_what_is_shipped_can_be_read_is_small_and_says_whose_it_is():
    assert SHIPPED.stat().st_size < MOST_BYTES
    notice = SHIPPED.with_name("NOTICE").read_text()
    pattern = r'^(\S+): ".+" by (.+), CC0-1\.0, https://www\.blendswap\.com/blends/view/\d+$'
    named = dict(re.findall(pattern, notice, re.M))
    found = {name.partition("#")[2]: entry for name, entry in shipped().items()}
    assert named == {name: entry.creator for name, entry in found.items()}
    assert {entry.licence for entry in found.values()} == {"CC0-1.0"}
    cast = [piece for role in shipped_pieces().values() for piece in role]
    assert len(cast) == len(found) > 80
    for piece in cast:
        assert set(piece.goals) <= {mesh.name for mesh in piece.load().meshes}


def test_a_lost_archive_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(catalogue, "SHIPPED", tmp_path / "models.sh3f")
    with pytest.raises(
        SweetHomeError, match=r"found .*models\.sh3f damaged .*; install cfnav again"
    ):
        shipped()


def test_the_package_is_asked_for_only_where_it_is_needed():
    check_furniture(["kitchen", f"{CC0}.kitchen"])
    with pytest.raises(SweetHomeError, match=r"apt install sweethome3d-furniture.*cc0\.kitchen:25"):
        check_furniture([f"{CC0}.kitchen", "sweet_home.kitchen"])
    with pytest.raises(SweetHomeError, match="apt install sweethome3d-furniture"):
        generate_room("sweet_home.kitchen", 25)
    assert RoomOptions(furniture="cc0").furniture == CC0


@pytest.mark.parametrize(
    ("kind", "words", "numbers"),
    [
        ("kitchen", "2c83d9fa5c12", 18957.0574),
        ("living_room", "644a2dbfe410", 17545.0931),
        ("bedroom", "265b17bcee64", 9667.9290),
        ("bathroom", "1dd54db38741", 8591.0663),
    ],
)
def test_the_version_holds(kind, words, numbers):
    """When this fails, either the change is a mistake or the version must rise with it."""
    room = generate_room(f"{CC0}.{kind}", 100)
    made = furnished(room)
    assert (CC0_VERSION, made.hash) == (2, words)
    assert made.sums[0] == pytest.approx(numbers, rel=1e-6)


def test_the_version_holds_what_is_shipped():
    """As above; of the files inside, as what packs them may pack otherwise."""
    made = hashlib.sha256()
    with zipfile.ZipFile(SHIPPED) as archive:
        for name in sorted(archive.namelist()):
            made.update(name.encode() + archive.read(name))
    assert (CC0_VERSION, made.hexdigest()[:12]) == (2, "e09f55fd787d")


def test_rooms_say_by_which_version_they_were_made():
    assert room_source(f"{CC0}.kitchen") == f"cc0 rooms {CC0_VERSION}"
    assert room_source("kitchen") != room_source("sweet_home.kitchen") != room_source("cc0.kitchen")
