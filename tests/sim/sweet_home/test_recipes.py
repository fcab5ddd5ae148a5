"""Rooms with models: what stands where. The models are boards of the tests' own."""

from __future__ import annotations

import math
from itertools import combinations

import cv2
import numpy as np
import pytest
from sim_bridge.data.dataset import RoomOptions, run
from sim_bridge.data.room_sheet import ShowOptions
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Builder, Frame, Surface
from sim_bridge.room.recipes.openings import LEAF_M, leaf
from sim_bridge.room.room import Room, generate_room, room_source
from sim_bridge.room.surroundings import Surroundings
from sim_bridge.sweet_home.catalogue import SweetHomeError
from sim_bridge.sweet_home.table import pieces
from sim_bridge.world.camera import Camera
from sim_bridge.world.world import Pose, World

from cfnav_core.task.rooms import SWEET_HOME
from cfnav_core.task.vocabulary import ROOM_TYPES
from tests.sim.sweet_home.rooms import SIZES, little_home  # noqa: F401  (a fixture)

pytestmark = pytest.mark.usefixtures("little_home")

KINDS = [f"{SWEET_HOME}.{kind}" for kind in ROOM_TYPES]
MOVED = ("Chair", "ArmChair", "Rug")
"""What is pushed under tables, or turned where it stands."""


def roles(room: Room) -> list[str]:
    return [placed.model.id.partition("#")[2] for placed in room.placed]


def empty(room_type: str = "living_room", held_out: bool = False, seed: int = 0) -> Kit:
    around = Surroundings(Builder(np.random.default_rng(seed), 5.0, 4.0), room_type)
    return Kit(around, pieces(), held_out)


@pytest.mark.parametrize("kind", KINDS)
def test_a_room_is_a_pure_function_of_kind_and_seed(kind):
    a, b, other = (generate_room(kind, seed) for seed in (100, 100, 101))
    assert a.parts == b.parts
    assert roles(a) == roles(b)
    assert [p.frame for p in a.placed] == [p.frame for p in b.placed]
    assert set(a.textures) == set(b.textures)
    assert all(np.array_equal(a.textures[name], b.textures[name]) for name in a.textures)
    assert a.parts != other.parts
    used = {part.texture for part in a.parts} - {None}
    assert used == set(a.textures)


@pytest.mark.parametrize("kind", KINDS)
def test_test_rooms_alone_have_what_is_held_out(kind):
    for seeds, last in (((100, 101, 230, 1000), False), ((300, 301), True)):
        found = [role for seed in seeds for role in roles(generate_room(kind, seed))]
        assert found
        assert {role.endswith("2") for role in found} == {last}


def test_what_is_held_out_stands_in_no_other_room_even_where_there_is_nothing_else():
    other, test, few = empty(), empty(held_out=True), empty()
    both = other.pieces["sofa"]
    last = tuple(piece for piece in both if piece.held_out)
    assert 0 < len(last) < len(both)
    other.pieces = test.pieces = few.pieces = {"sofa": last}
    few.sparse = True
    assert other.choices("sofa") == []
    assert test.choices("sofa") == few.choices("sofa") == list(last)
    test.pieces = {"sofa": tuple(piece for piece in both if not piece.held_out)}
    assert test.choices("sofa") == list(test.pieces["sofa"])


@pytest.mark.parametrize("kind", KINDS)
def test_what_stands_on_the_floor_stands_beside_each_other(kind):
    for seed in range(100, 106):
        room = generate_room(kind, seed)
        standing = []
        for placed in room.placed:
            name = room.objects[placed.owners[0]].name
            if placed.frame.z < 0.02 and name not in (*MOVED, "door"):
                c, s = (abs(f(placed.frame.yaw)) for f in (math.cos, math.sin))
                w, d, _ = placed.model.size
                half = (c * w + s * d) / 2, (s * w + c * d) / 2
                standing.append((name, placed.frame, half))
                assert half[0] - 0.01 <= placed.frame.x <= room.width - half[0] + 0.01
                assert half[1] - 0.01 <= placed.frame.y <= room.depth - half[1] + 0.01
        for (a, f, p), (b, g, q) in combinations(standing, 2):
            apart = max(abs(f.x - g.x) - p[0] - q[0], abs(f.y - g.y) - p[1] - q[1])
            assert apart > -0.005, (kind, seed, a, b)


def test_things_on_a_top_are_wholly_on_it_and_beside_each_other():
    kit = empty()
    top = Surface(Frame(2.0, 1.0, 0.75, 0.3), 1.2, 0.5, "desk")
    kit.b.surfaces.append(top)
    names = ("Laptop", "Mug", "Mug", "Microwave", "clutter_top", "clutter_top")
    put = sum(kit.top(name, ("desk",)) for name in names)
    assert put >= 4
    assert len(kit.b.placed) == put
    places = []
    for placed in kit.b.placed:
        dx, dy = placed.frame.x - top.frame.x, placed.frame.y - top.frame.y
        c, s = math.cos(top.frame.yaw), math.sin(top.frame.yaw)
        x, y, turn = c * dx + s * dy, c * dy - s * dx, placed.frame.yaw - top.frame.yaw
        w, d, _ = placed.model.size
        half_x = (abs(math.cos(turn)) * w + abs(math.sin(turn)) * d) / 2
        half_y = (abs(math.sin(turn)) * w + abs(math.cos(turn)) * d) / 2
        assert abs(x) + half_x <= top.width / 2 + 1e-9
        assert half_y - 1e-9 <= y <= top.depth - half_y + 1e-9
        assert placed.frame.z == top.frame.z
        places.append((x, y, math.hypot(w, d) / 2))
    for (x, y, r), (u, v, q) in combinations(places, 2):
        assert math.hypot(x - u, y - v) >= r + q - 1e-9


def test_a_low_shelf_takes_nothing_tall_and_a_kind_takes_what_may_stand_there():
    kit = empty()
    kit.b.surfaces.append(Surface(Frame(2.0, 1.0, 0.4), 1.2, 0.5, "shelf", clear=0.2))
    assert not kit.top("Vase", ("shelf",))
    assert not kit.top("Mug", ("desk",))
    assert kit.top("Mug", ("shelf",))
    # the plants of this table stand on floors only, and our own may stand for them on tops
    assert not any("HousePlant" in role for role in (p.model.id for p in kit.b.placed))


def test_what_is_part_of_a_model_is_a_goal_of_its_own():
    kit = empty("bedroom")
    bed = pieces()["bed_double"][0]
    kit.add(bed, Frame(2.5, 0.5))
    (placed,) = kit.b.placed
    names = [kit.b.objects[owner].name for owner in placed.owners]
    assert sorted(names) == ["Pillow", "bed_double"]
    # the front of this bed is its pillow, and its footprint is no larger
    x0, y0, x1, y1 = kit.b.objects[placed.owners[names.index("Pillow")]].footprint
    assert (x1 - x0, y1 - y0) == pytest.approx((1.6, 0), abs=1e-5)
    room = Room("sweet_home.bedroom", 0, 5.0, 4.0, tuple(kit.b.parts), tuple(kit.b.placed),
                tuple(kit.b.objects), {}, 0.5, ())  # fmt: skip
    assert room.goals == ("Pillow",)
    with Camera(World(room)) as camera:
        seen = camera.owner_pixels(Pose(2.5, 3.6, -math.pi / 2, -0.3))
    pillow, frame = (names.index(name) for name in ("Pillow", "bed_double"))
    assert seen[placed.owners[pillow]] > 500
    assert seen[placed.owners[frame]] > 500


def test_the_boxes_of_what_stands_on_something_are_one_and_of_a_rug_none():
    kit = empty()
    mug = pieces()["Mug"][0]
    before = len(kit.b.parts)
    kit.add(mug, Frame(2, 2, 0.7))
    (part,) = kit.b.parts[before:]
    assert part.half == pytest.approx((0.045, 0.045, 0.05))
    assert part.centre[2] == pytest.approx(0.75)
    kit.add(mug, Frame(2, 2, 1.5))
    assert len(kit.b.parts) == before + 1


def test_a_room_in_the_shape_of_an_l_has_six_walls_with_frames_that_look_inwards():
    rng = np.random.default_rng(4)
    for _ in range(20):
        b = Builder(rng, 5.0, 4.0)
        Surroundings(b, "kitchen").build()
        assert len(b.stretches) in (4, 6)
        for wall in b.stretches:
            inside = wall.frame((wall.low + wall.high) / 2).at(0, 0.3)
            assert b.take(inside.at(0, -0.05), 0.1, 0.1), wall
            b.taken.pop()
        if len(b.stretches) == 6:
            assert len(b.taken) == 1
            inner = b.stretches[4]
            frame = inner.frame((inner.low + inner.high) / 2)
            assert b.take_wall(frame, 0.3, 0, 1)
            assert not b.take_wall(frame, 0.3, 0, 1)


def test_what_is_on_a_wall_is_not_covered():
    b = Builder(np.random.default_rng(0), 3.0, 3.0)
    for wall in b.stretches[1:]:
        b.occupy_wall(wall.frame(1.5), 3.0, 0.0, 2.5)
    b.occupy_wall(b.stretches[0].frame(1.0), 2.0, 1.0, 2.0)
    for _ in range(20):
        high = b.place(0.5, 0.3, height=1.5)
        assert high is None or high.x > 2.0
    low = b.place(0.5, 0.3, height=0.9)
    assert low is None or low.y < 0.1


def test_the_leaf_of_a_door_stands_before_the_wall():
    door = pieces()["door"][0]
    # of the board it is the front
    assert leaf(door) == pytest.approx(SIZES["door"][1] / 200, abs=0.01)
    assert LEAF_M > 0


def test_the_laser_looks_at_what_its_plane_cuts_and_sees_the_same():
    world = World(generate_room(KINDS[0], 102))
    bearings = np.linspace(0, math.tau, 360, endpoint=False)
    fewer = world.scan(bearings)
    world._laser_groups[3] = 1
    np.testing.assert_array_equal(world.scan(bearings), fewer)
    assert np.isfinite(fewer).all()


def test_a_missing_package_is_one_sentence_before_anything_is_rendered(tmp_path, monkeypatch):
    monkeypatch.setenv("CFNAV_SWEET_HOME", str(tmp_path / "none"))
    with pytest.raises(SweetHomeError, match="apt install sweethome3d-furniture"):
        generate_room(KINDS[0], 100)
    options = RoomOptions(["kitchen:3"], tmp_path / "out", furniture="both")
    with pytest.raises(SweetHomeError, match="apt install sweethome3d-furniture"):
        run(options)
    with pytest.raises(SweetHomeError, match="apt install sweethome3d-furniture"):
        ShowOptions(tmp_path / "out", [f"{KINDS[0]}:100"]).run_command()
    assert not (tmp_path / "out").exists()


def test_rooms_of_models_have_a_version_of_their_own():
    assert room_source("kitchen") != room_source("sweet_home.kitchen")
    assert room_source("sweet_home.kitchen", 0.5) == room_source("sweet_home.kitchen") + (
        " shifted by 0.5"
    )


def test_pages_show_each_room_from_above_and_inside(tmp_path, capsys):
    options = ShowOptions(tmp_path, [f"{KINDS[3]}:100-101"], views=2, side=120, rows=1)
    options.run_command()
    assert capsys.readouterr().out == f"2 rooms on 2 pages in {tmp_path}\n"
    page = cv2.imread(str(tmp_path / "page_002.png"))
    assert page.shape == (120, 360, 3)
    assert page[:, 120:].std() > 10
    with pytest.raises(ValueError, match="found no rooms"):
        ShowOptions(tmp_path).run_command()
    with pytest.raises(ValueError, match="found --views 0"):
        ShowOptions(tmp_path, ["kitchen:1"], views=0).run_command()
