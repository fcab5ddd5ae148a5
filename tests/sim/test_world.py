"""Rooms, free space, contacts, scans and pictures of the real world model."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sim_bridge.room.room import generate_room
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import DIRECTIONS, goal_states, sightings, start_episode, state_grid
from sim_bridge.world.world import HULL_RADIUS, LARGEST_PICTURE, LIDAR_X, Pose, World

from cfnav_core.scenes.scene import HEADINGS, HORIZONS
from cfnav_core.task.actions import STEP_M, Action
from cfnav_core.task.camera import CAMERAS, MAST
from cfnav_core.task.visibility import MIN_GOAL_STATES
from cfnav_core.task.vocabulary import DATA2_TARGETS, ROOM_TYPES


@pytest.fixture(scope="module")
def world() -> World:
    return World(generate_room("kitchen", 3))


@pytest.fixture(scope="module")
def camera(world):
    with Camera(world) as camera:
        yield camera


@pytest.fixture(scope="module")
def grid(world):
    return state_grid(world)


@pytest.mark.parametrize("kind", ROOM_TYPES)
def test_room_is_a_function_of_its_seed(kind):
    a, b, c = (generate_room(kind, seed) for seed in (4, 4, 5))
    assert a.parts == b.parts
    assert all((a.textures[k] == b.textures[k]).all() for k in a.textures)
    assert a.parts != c.parts


@pytest.mark.parametrize("kind", ROOM_TYPES)
def test_rooms_carry_their_goals(kind):
    """Every target of the published list stands in at least half of the rooms of its type."""
    rooms = [generate_room(kind, seed).goals for seed in range(12)]
    for goal in DATA2_TARGETS[kind]:
        assert sum(goal in goals for goals in rooms) >= 6, goal


def test_bad_rooms_say_what_was_expected():
    with pytest.raises(ValueError, match="expected TYPE:SEED"):
        generate_room("attic", 1)
    with pytest.raises(ValueError, match="expected TYPE:SEED"):
        generate_room("kitchen", -1)


def test_walls_bound_free_space(world):
    room = world.room
    for x, y in ((0.0, 1.0), (room.width, 1.0), (1.0, 0.0), (1.0, room.depth)):
        assert not world.free(x, y)


def test_driving_into_a_wall_touches_it_and_stops(world, grid):
    room = world.room
    # from the free cell nearest the right wall, straight at it
    x, y = max(((float(x), float(y)) for x, y in grid.positions), key=lambda p: p[0])
    world.reset(x, y, 0.0)
    touched = set()
    for _ in range(600):
        world.drive(0.2, 0.0, 0.0)
        touched |= {c.part for c in world.contacts()}
    assert "hull" in touched or "mast" in touched
    assert world.pose.x < room.width - HULL_RADIUS + 0.01
    assert abs(world.velocity[0]) < 0.02


def test_free_drive_and_turn_reach_what_was_commanded(world, grid):
    p = next(
        grid.pose(s) for s in range(0, len(grid.next_state), HORIZONS)
         if not grid.collided[s] and s // HORIZONS % HEADINGS == 0
    )  # fmt: skip
    world.reset(p.x, p.y, p.yaw)
    for _ in range(100):
        world.drive(0.2, 0.0, 0.0)
    assert world.pose.x - p.x == pytest.approx(0.2, abs=0.005)
    world.reset(p.x, p.y, 0.0)
    for _ in range(100):
        world.drive(0.0, 0.5, 0.0)
    assert world.pose.yaw == pytest.approx(0.5, abs=0.01)


def test_data_set_and_live_world_agree(world, grid):
    """The same displacement, looked up and driven: same end, same collision."""
    rng = np.random.default_rng(0)
    agree = []
    for s in rng.choice(len(grid.next_state), 60, replace=False):
        pose = grid.pose(int(s))
        heading = s // HORIZONS % HEADINGS
        length = STEP_M * math.hypot(*DIRECTIONS[heading])
        world.reset(pose.x, pose.y, pose.yaw)
        hit = False
        start = (pose.x, pose.y)
        for _ in range(2 * round(length / 0.1 / world.timestep)):
            world.drive(0.1, 0.0, 0.0)
            hit = hit or bool(world.contacts())
            if hit or math.dist((world.pose.x, world.pose.y), start) >= length:
                break
        agree.append(hit == bool(grid.collided[s]))
        if not hit and not grid.collided[s]:
            end = grid.pose(int(grid.next_state[s, Action.MoveAhead]))
            assert math.dist((world.pose.x, world.pose.y), (end.x, end.y)) < 0.01
    assert all(agree)


def test_scan_sees_the_walls_of_an_empty_corner(world):
    room = world.room
    pose = Pose(room.width / 2, room.depth / 2, 0.3)
    ranges = world.scan(np.deg2rad(np.arange(360)), pose)
    origin = np.array([pose.x + LIDAR_X * math.cos(0.3), pose.y + LIDAR_X * math.sin(0.3)])
    angle = np.deg2rad(np.arange(360)) + 0.3
    ends = origin + ranges[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    assert ranges.dtype == np.float32
    assert np.isfinite(ranges).all()
    assert (ends > -1e-3).all()
    assert (ends < np.array([room.width, room.depth]) + 1e-3).all()


def test_depth_of_the_floor_is_right(world, camera, grid):
    """Every floor pixel unprojects to height zero."""
    pose = grid.pose(1)
    picture = camera.picture(pose)
    floor = next(i for i, o in enumerate(world.room.objects) if o.name == "Floor")
    v, u = np.nonzero(picture.owner == floor)
    assert len(v) > 500
    x, y = (u + 0.5 - 150) / 150, (v + 0.5 - 150) / 150
    depth = picture.depth[v, u]
    tilt = pose.tilt
    height = 1.3 + depth * (math.sin(tilt) - y * math.cos(tilt))
    assert np.abs(height).max() < 0.03
    assert np.abs(x).max() <= 1


def test_pictures_repeat_and_tilt_matters(camera, grid):
    level, down = grid.pose(0), grid.pose(1)
    first = camera.rgb(level)
    np.testing.assert_array_equal(first, camera.rgb(level))
    assert np.abs(first.astype(int) - camera.rgb(down)).mean() > 5
    assert first.shape == (300, 300, 3)


@pytest.mark.parametrize("name", ["mast", "stock_wide"])
@pytest.mark.parametrize("kind", ["living_room", "cc0.kitchen"])
def test_what_is_not_drawn_is_not_in_the_picture(monkeypatch, kind, name):
    world = World(generate_room(kind, 1), CAMERAS[name].on_mast)
    grid = state_grid(world, CAMERAS[name].horizons)
    states = np.random.default_rng(0).choice(len(grid.next_state), 30, replace=False)
    with Camera(world, CAMERAS[name]) as camera:
        some = [camera.picture(grid.pose(int(state))) for state in states]
        drawn = [camera._renderer.scene.ngeom]
        monkeypatch.setattr(camera, "_out_of_view", lambda axes: np.zeros(world.model.ngeom, bool))
        everything = [camera.picture(grid.pose(int(state))) for state in states]
        drawn.append(camera._renderer.scene.ngeom)
    assert drawn[0] < drawn[1]
    for a, b in zip(some, everything, strict=True):
        for part in ("rgb", "depth", "owner"):
            np.testing.assert_array_equal(getattr(a, part), getattr(b, part))


def test_largest_picture_can_be_drawn():
    world = World(generate_room("bathroom", 3))
    with Camera(world, replace(MAST, size=(LARGEST_PICTURE, LARGEST_PICTURE))) as camera:
        large = camera.rgb(Pose(1.0, 1.0, 0.5))
    with Camera(world) as camera:
        small = camera.rgb(Pose(1.0, 1.0, 0.5))
    assert large.shape == (LARGEST_PICTURE, LARGEST_PICTURE, 3)
    assert small.std() > 5
    assert large.mean() == pytest.approx(small.mean(), abs=2)


@pytest.mark.parametrize("goal", ["Apple", "Chair", "Fridge"])
def test_pruned_goal_states_equal_looking_everywhere(world, camera, grid, goal):
    states = range(0, len(grid.next_state), 3)
    everywhere = [camera.goal_visible(goal, grid.pose(s)) for s in states]
    np.testing.assert_array_equal(goal_states(world, camera, grid, goal)[::3], everywhere)


def test_a_camera_that_does_not_tilt_has_level_states_only(grid):
    world = World(generate_room("kitchen", 3))  # a camera sets the field of view of its world
    with Camera(world, CAMERAS["stock_preview"]) as camera:
        level = state_grid(world, camera.set_up.horizons)
        seen = goal_states(world, camera, level, "Fridge")
        some = [camera.goal_visible("Fridge", level.pose(k)) for k in range(0, len(seen), 5)]
    assert any(some)
    np.testing.assert_array_equal(seen[::5], some)
    np.testing.assert_array_equal(level.positions, grid.positions)
    np.testing.assert_array_equal(level.collided, grid.collided[::2])
    looks = level.next_state[:, [Action.LookUp, Action.LookDown]]
    np.testing.assert_array_equal(looks, np.arange(len(seen))[:, None].repeat(2, 1))
    ahead = level.next_state[:, Action.MoveAhead]
    np.testing.assert_array_equal(ahead, grid.next_state[::2, Action.MoveAhead] // 2)


def test_start_is_far_enough_and_repeats(world, camera):
    a, b = (start_episode(world, camera, "Apple", 7) for _ in range(2))
    assert a == b
    assert a.shortest_actions >= 6
    assert world.free(a.x, a.y)
    assert not camera.goal_visible("Apple", Pose(a.x, a.y, a.yaw))
    with pytest.raises(ValueError, match=r"it has .*Toaster"):
        start_episode(world, camera, "Unicorn", 7)


@pytest.mark.parametrize("name", ["mast", "lite"])
def test_sightings_count_as_looking_from_every_state_does(name):
    world = World(generate_room("bathroom", 0))
    with Camera(world, CAMERAS[name]) as camera:
        grid = state_grid(world, camera.set_up.horizons)
        found = sightings(world, camera, grid)
        assert set(found) == set(world.room.goals)
        for goal, states in found.items():
            assert states == min(MIN_GOAL_STATES, goal_states(world, camera, grid, goal).sum())
    assert (0 in found.values()) is (name == "lite")


def test_an_episode_does_not_begin_for_a_goal_that_its_camera_hardly_sees():
    world = World(generate_room("bathroom", 0))
    with Camera(world, CAMERAS["lite"]) as camera:
        words = r"Mirror is seen within 1.5 m from 0 states by this camera .64 x 39 .*, expected 4"
        with pytest.raises(ValueError, match=words):
            start_episode(world, camera, "Mirror", 7)


def test_occupancy_marks_walls_and_leaves_the_robot_room(world, grid):
    plan = world.occupancy(0.02)
    assert plan.shape == (math.ceil(world.room.depth / 0.02), math.ceil(world.room.width / 0.02))
    cells = (grid.positions / 0.02).astype(int)
    assert (plan[cells[:, 1], cells[:, 0]] == 0).all()
    assert 0.02 < (plan == 100).mean() < 0.7


def test_some_furniture_overhangs_what_the_lidar_sees(world):
    """Table tops stop the mast where the scan sees nothing."""
    tops = [p for p in world.room.parts if p.solid and 0.351 < p.centre[2] - p.half[2] < 1.33]
    assert tops


@pytest.mark.parametrize("mast", [True, False])
def test_where_a_robot_can_stand_its_map_is_free(mast: bool) -> None:
    world = World(generate_room("kitchen", 21), mast)
    plan, grid = world.occupancy(0.02), state_grid(world, (0.0,))
    assert not any(plan[int(y / 0.02), int(x / 0.02)] for x, y in grid.positions)


def test_pictures_that_cannot_be_drawn_are_one_sentence(world) -> None:
    large = replace(CAMERAS["lite"], size=(3840, 2160))
    with pytest.raises(ValueError, match="camera of 3840 x 2160 pixels, expected at most 1920"):
        Camera(world, large)
    published = replace(CAMERAS["stock_wide"], size=(1280, 720))
    with Camera(world, published) as camera:
        assert camera.rgb(Pose(1.0, 1.0, 0.0)).shape == (720, 1280, 3)
