"""Furniture in other paint and proportions: what changes, what stays, and that a name is a room."""

from __future__ import annotations

from dataclasses import replace

import mujoco as mj
import numpy as np
import pytest
from sim_bridge.room import sweet_home
from sim_bridge.room.parts import Frame
from sim_bridge.room.room import Room, check_furniture, generate_room, room_source
from sim_bridge.room.sweet_home import SWEET_HOME_VERSION, VARIED_VERSION
from sim_bridge.sweet_home.catalogue import VARIABLE, SweetHomeError
from sim_bridge.sweet_home.table import shipped_pieces
from sim_bridge.sweet_home.variation import (
    BUILDING,
    GROWN,
    MOST_STRETCH,
    VariedPiece,
    varied,
)
from sim_bridge.world.grid import state_grid
from sim_bridge.world.model_parts import add_model
from sim_bridge.world.world import World

from cfnav_core.task.rooms import VARIED, furniture_of
from cfnav_core.task.vocabulary import ROOM_TYPES


@pytest.fixture
def drawn() -> dict[str, tuple[VariedPiece, ...]]:
    """The models that come with cfnav, varied; without parts of buildings."""
    found = varied(shipped_pieces(), np.random.default_rng(0))
    return {role: its for role, its in found.items() if role not in BUILDING}


@pytest.fixture
def rooms(monkeypatch: pytest.MonkeyPatch):
    """Rooms of the models that come with cfnav, varied."""
    monkeypatch.setitem(sweet_home.PIECES, VARIED, shipped_pieces)
    return lambda kind, seed: generate_room(f"{VARIED}.{kind}", seed)


def colours(room: Room) -> dict[str, list[object]]:
    """By the model's id: the mean of each of its textures, the colours of what has none."""
    return {
        placed.model.id.partition("~")[0]: [
            mesh.colour if mesh.texture is None else mesh.texture.mean()
            for mesh in placed.model.meshes
        ]
        for placed in room.placed
    }


def test_widths_and_depths_change_with_all_that_hangs_on_them_and_heights_stay(drawn):
    stretched = 0
    for its in drawn.values():
        for piece in its:
            (x, y), old = piece.variation.stretch, piece.original
            assert max(abs(np.log([x, y]))) <= MOST_STRETCH
            stretched += (x, y) != (1, 1)
            assert piece.entry.size == pytest.approx(np.multiply(old.entry.size, (x, y, 1)))
            assert (piece.held_out, piece.role, piece.goals) == (old.held_out, old.role, old.goals)
    assert stretched > 40
    piece = next(p for p in drawn["Chair"] if p.variation.stretch != (1, 1))
    model, before = piece.load(), piece.original.load()
    assert model.size == pytest.approx(piece.entry.size)
    factors = np.array([*piece.variation.stretch, 1])
    np.testing.assert_allclose(model.triangles, before.triangles * factors, rtol=1e-5, atol=1e-6)
    for box, old in zip(model.boxes, before.boxes, strict=True):
        assert box.centre == pytest.approx(np.multiply(old.centre, factors))
        assert box.half == pytest.approx(np.multiply(old.half, factors))
    for mesh in model.meshes:
        if mesh.normals is not None:
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)


def test_most_are_dyed_but_not_what_grows_nor_glass(drawn):
    dyed = total = 0
    for role, its in drawn.items():
        for piece in its[:2]:
            total += 1
            model, before = piece.load(), piece.original.load()
            for mesh, old in zip(model.meshes, before.meshes, strict=True):
                same = mesh.colour == old.colour and (
                    mesh.texture is old.texture or np.array_equal(mesh.texture, old.texture)
                )
                if role in GROWN or old.transparent or not piece.variation.dyed:
                    assert same, (piece.entry.id, mesh.name)
                if mesh.texture is not None:
                    assert (mesh.texture.dtype, mesh.texture.shape) == (np.uint8, old.texture.shape)
                assert mesh.colour[3] == old.colour[3]
                assert 0 <= min(mesh.colour) <= max(mesh.colour) <= 1
            dyed += any(
                mesh.colour != old.colour or mesh.texture is not old.texture
                for mesh, old in zip(model.meshes, before.meshes, strict=True)
            )
    assert 0.5 < dyed / total < 0.95


def test_units_of_one_style_share_paint_and_keep_their_size():
    units = {
        role: tuple(replace(piece, style=style) for piece in shipped_pieces()["Chair"][:2])
        for role, style in (("kitchen_base", "oak"), ("Sink", "oak"), ("oven", "steel"))
    }
    found = varied(units, np.random.default_rng(0))
    looks = [piece.variation for its in found.values() for piece in its]
    assert len({*looks[:4]}) == len({*looks[4:]}) == 1
    assert looks[0] != looks[4]
    assert {look.stretch for look in looks} == {(1.0, 1.0)}


def test_parts_of_the_building_stay_as_they_are():
    before = {role: shipped_pieces()["Chair"] for role in (*BUILDING, "Chair")}
    found = varied(before, np.random.default_rng(0))
    assert {role for role in before if found[role] == before[role]} == BUILDING


def test_two_looks_of_a_model_are_two_models_in_a_room(drawn):
    plant = drawn["HousePlant"][0].original
    looks = varied({"HousePlant": (plant, plant)}, np.random.default_rng(0))["HousePlant"]
    assert not any(look.variation.dyed for look in looks)
    spec = mj.MjSpec()
    for piece in (*looks, looks[0]):
        add_model(spec, piece.load(), Frame(0, 0, 0, 0))
    assert len(spec.meshes) == 2 * len(plant.load().meshes)


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_a_name_is_always_the_same_room_and_another_seed_another_paint(rooms, room_type):
    room, again, *others = (rooms(room_type, seed) for seed in (100, 100, 101, 102, 103))
    assert furniture_of(room.kind) == VARIED
    assert room.goals
    assert colours(room) == colours(again)
    assert [p.frame for p in room.placed] == [p.frame for p in again.placed]
    assert any(
        colours(room)[name] != look
        for other in others
        for name, look in colours(other).items()
        if name in colours(room)
    )


def test_the_robot_gets_around_and_is_stopped_where_things_are(rooms):
    grid = state_grid(World(rooms("living_room", 100)))
    assert len(grid.positions) >= 60
    assert np.any(grid.collided)


def test_test_rooms_have_what_is_held_out(rooms):
    held_out = {p.entry.id: p.held_out for its in shipped_pieces().values() for p in its}
    chairs = {p.entry.id for p in shipped_pieces()["Chair"]}
    for seeds, expected in ((range(100, 104), False), (range(300, 304), True)):
        ids = {p.model.id.partition("~")[0] for s in seeds for p in rooms("kitchen", s).placed}
        assert ids & chairs
        assert {held_out[name] for name in ids & chairs} == {expected}


def test_the_source_tells_both_versions_and_the_package_is_asked_for(monkeypatch, tmp_path):
    versions = f"{VARIED_VERSION} of sweet_home rooms {SWEET_HOME_VERSION}"
    assert room_source(f"{VARIED}.kitchen") == f"varied rooms {versions}"
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    with pytest.raises(SweetHomeError, match="sweethome3d-furniture"):
        check_furniture([f"{VARIED}.kitchen"])
