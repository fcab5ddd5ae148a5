"""Scenes of a detector's boxes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from sim_bridge.data import boxes
from sim_bridge.data.states import sampled_visible
from sim_bridge.room.room import generate_room, room_source
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import state_grid
from sim_bridge.world.things import Things, surface
from sim_bridge.world.world import Pose, World

from cfnav_core.detect.errors import SHIPPED
from cfnav_core.scenes.scene import OfflineScene
from cfnav_core.task.camera import CAMERAS, MAST
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.rooms import room_folder
from cfnav_core.task.visibility import MIN_GOAL_STATES
from cfnav_core.task.vocabulary import CATEGORIES, ROOM_TYPES
from studies.eyes.rooms import things_of_rooms

import mujoco  # isort: skip

ROOM = ("bathroom", 3)
WIDE = CAMERAS["stock_wide"]


@pytest.fixture(scope="module")
def faultless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Errors of a detector that has none."""
    said = yaml.safe_load(SHIPPED.read_text())
    said |= {"jitter": 0, "false_alarms": 0, "confused": 0}
    said["recall"] |= {"base": 99.0}
    path = tmp_path_factory.mktemp("errors") / "none.yaml"
    path.write_text(yaml.safe_dump(said))
    return path


def made(out: Path, **options) -> OfflineScene:
    boxes.run(boxes.BoxOptions(out, ["bathroom:3"], processes=1, **options))
    return OfflineScene.load(room_folder(out, *ROOM))


@pytest.fixture(scope="module")
def true(faultless: Path, tmp_path_factory: pytest.TempPathFactory) -> OfflineScene:
    """With every true box, and distances by depth."""
    return made(tmp_path_factory.mktemp("out"), errors=faultless, distance="depth")


def test_a_scene_is_of_the_room_as_the_camera_sees_it(true: OfflineScene) -> None:
    world = World(generate_room(*ROOM), False)
    grid = state_grid(world, WIDE.horizons)
    assert (true.name, true.fields, true.camera) == ("bathroom:3", SIGHTINGS, WIDE)
    assert true.source == room_source("bathroom")
    assert "far by depth" in true.perception
    np.testing.assert_array_equal(true.next_state, grid.next_state)
    states = np.arange(true.num_states)
    expected = sampled_visible(world, grid, WIDE, CATEGORIES, states)
    np.testing.assert_array_equal(true.visible, expected)
    assert set(true.goals) == {
        name for name, often in zip(CATEGORIES, expected.sum(0), strict=True)
        if often >= MIN_GOAL_STATES
    }  # fmt: skip


def test_what_scores_less_than_the_least_does_not_count(tmp_path: Path) -> None:
    every, sure = (made(tmp_path / str(n), distance="lidar", least=n) for n in (0.3, 0.5))
    expected = np.array(every.detections)
    expected[expected[:, :, SIGHTINGS.index("confidence")] < 0.5] = 0
    assert expected.any()
    assert (expected != every.detections).any()
    np.testing.assert_array_equal(sure.detections, expected)
    assert sure.perception == f"{every.perception}, from 0.5 on"
    with pytest.raises(ValueError, match="found --least 2, expected a score"):
        made(tmp_path, least=2.0)


def test_features_are_how_near_things_are_ahead(true: OfflineScene) -> None:
    world = World(generate_room(*ROOM), False)
    grid = state_grid(world, WIDE.horizons)
    off = []
    for state in range(0, true.num_states, 5):
        exact = boxes.nearness(world.scan(boxes.BEAMS, grid.pose(state)))
        off.append(np.abs(np.asarray(true.features[state], float) - exact))
    assert np.median(off) < 0.01  # the LiDAR's noise
    ahead = true.features[:, true.features.shape[1] // 2]
    assert ahead[true.collided].mean() > ahead[~true.collided].mean() + 0.1


def test_what_the_camera_sees_is_where_it_is_said(true: OfflineScene) -> None:
    """Of each sighting the direction leads to the thing, as the room has it."""
    room = generate_room(*ROOM)
    grid = state_grid(World(room, False), WIDE.horizons)
    checked = 0
    for state in range(0, true.num_states, 7):
        pose = grid.pose(state)
        eye = np.array([pose.x + WIDE.x * np.cos(pose.yaw), pose.y + WIDE.x * np.sin(pose.yaw)])
        for row in np.flatnonzero(true.detections[state, :, 0]):
            things = [o for o in room.objects if o.name == CATEGORIES[row]]
            azimuth = true.detections[state, row, 1]
            ray = np.array([np.cos(pose.yaw - azimuth), np.sin(pose.yaw - azimuth)])
            assert min(_off(eye, ray, thing.footprint) for thing in things) < 0.15
            checked += 1
    assert checked > 30


def _off(eye: np.ndarray, ray: np.ndarray, footprint: tuple[float, float, float, float]) -> float:
    """By how much a ray misses a footprint, metres."""
    x0, y0, x1, y1 = footprint
    along = eye + np.linspace(0, 8, 400)[:, None] * ray
    away = np.maximum(np.maximum([x0, y0] - along, along - [x1, y1]), 0)
    return float(np.hypot(*away.T).min())


def test_distances_are_those_of_things_give_or_take_a_cameras_error(true: OfflineScene) -> None:
    room = generate_room(*ROOM)
    grid = state_grid(World(room, False), WIDE.horizons)
    off = []
    for state, row in zip(*np.nonzero(true.detections[..., 0]), strict=True):
        pose, said = grid.pose(int(state)), float(true.detections[state, row, 5])
        near = [
            float(np.hypot(max(x0 - pose.x, pose.x - x1, 0), max(y0 - pose.y, pose.y - y1, 0)))
            for x0, y0, x1, y1 in (o.footprint for o in room.objects if o.name == CATEGORIES[row])
        ]
        off.append(min(abs(said / one - 1) for one in near) if said else np.nan)
    assert 0.05 < np.isnan(off).mean() < 0.2  # stereo has none of some
    assert np.nanstd(off) < 0.05
    assert 0.01 < np.nanmean(off) < 0.06


@pytest.mark.parametrize("by", ["size", "lidar", "nothing"])
def test_distances_may_be_known_otherwise(
    by: str, faultless: Path, true: OfflineScene, tmp_path: Path
) -> None:
    other = made(tmp_path, errors=faultless, distance=by)
    seen = (true.detections[..., 0] > 0) & (true.detections[..., 5] > 0)
    near, far = (np.asarray(s.detections[..., 5], float)[seen] for s in (true, other))
    if by == "nothing":
        assert not far.any()
    else:
        told = far > 0
        assert told.mean() > 0.5
        # what is cut off or hidden looks small, and so far
        assert np.median(np.abs(far - near)[told]) < {"size": 1.2, "lidar": 0.6}[by]


def test_each_room_has_one_way_of_the_three_where_they_are_mixed(tmp_path: Path) -> None:
    options = boxes.BoxOptions(tmp_path, distance="mixed")
    drawn = {boxes.way_of(kind, seed, options) for kind in ROOM_TYPES for seed in range(20)}
    assert drawn == {"size", "lidar", "depth"}
    assert boxes.way_of("kitchen", 1, replace(options, distance="nothing")) == "nothing"


def test_the_boxes_of_a_scene_are_those_of_their_version(faultless: Path, tmp_path: Path) -> None:
    """When this fails, either the change is a mistake or the version must rise."""
    scene = made(tmp_path, errors=faultless, distance="lidar")
    found, features = scene.detections.astype(float), scene.features.astype(float)
    about = [np.count_nonzero(found[..., 0]), *found.sum((0, 1)), features.sum()]
    assert boxes.BOXES_VERSION == 4
    expected = [560, 295.37, -1.02, 101.23, 66.72, 74.38, 1043.43, 29391]
    assert about == pytest.approx(expected, rel=0.005, abs=0.05)


def test_rooms_that_are_there_are_kept_and_others_made_again(tmp_path: Path) -> None:
    first = made(tmp_path, distance="size")
    path = room_folder(tmp_path, *ROOM) / "detections.npy"
    before = path.stat().st_mtime_ns
    made(tmp_path, distance="size")
    assert path.stat().st_mtime_ns == before
    second = made(tmp_path, distance="nothing")
    assert path.stat().st_mtime_ns > before
    assert first.perception != second.perception


def test_a_thing_that_is_cut_off_shows_a_smaller_share_of_itself() -> None:
    world = World(generate_room("kitchen", 3))
    fridge = next(o for o in world.room.objects if o.name == "Fridge")
    x0, y0, x1, y1 = fridge.footprint
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    inwards = np.array([world.room.width, world.room.depth]) / 2 - middle
    yaw = float(np.arctan2(*-inwards[::-1]))
    shares = []
    with Camera(world, MAST) as camera:
        things = Things(camera)
        for away in (0.9, 1.6, 2.2):
            at = middle + inwards / np.hypot(*inwards) * away
            pose = Pose(float(at[0]), float(at[1]), yaw, 0.0)
            seen = things.seen(pose, camera.owners(pose))
            shares.append(max(t.share for t in seen if t.name == "Fridge"))
    assert shares == sorted(shares)
    assert shares[0] < 0.6


SHAPES = """<mujoco><asset><mesh name="wedge" vertex="0 0 0  .3 0 0  0 .2 0  0 0 .1"/></asset>
<worldbody>
  <geom type="sphere" size=".1"/> <geom type="ellipsoid" size=".1 .2 .05" euler="20 30 40"/>
  <geom type="cylinder" size=".1 .2" euler="50 0 10"/> <geom type="capsule" size=".1 .2"/>
  <geom type="box" size=".1 .2 .3" euler="5 6 7"/> <geom type="mesh" mesh="wedge"/>
</worldbody></mujoco>"""


REACH = (
    lambda s, u: s[0],
    lambda s, u: np.linalg.norm(s * u),
    lambda s, u: s[0] * np.hypot(u[0], u[1]) + s[1] * abs(u[2]),
    lambda s, u: s[0] + s[1] * abs(u[2]),
    lambda s, u: s @ abs(u),
)
"""How far the shapes reach from their middles in a direction u, by their sizes s."""


def test_the_surface_of_a_geom_spans_what_the_geom_spans() -> None:
    model = mujoco.MjModel.from_xml_string(SHAPES)
    everywhere = np.random.default_rng(0).normal(size=(200, 3))
    everywhere /= np.linalg.norm(everywhere, axis=1)[:, None]
    for geom, reach in enumerate(REACH):
        points, size = surface(model, geom), model.geom_size[geom]
        for u in everywhere:
            assert 0.98 * reach(size, u) < (points @ u).max() <= reach(size, u) + 1e-9
    points = surface(model, len(REACH))
    for u in everywhere:
        assert (points @ u).max() == pytest.approx((model.mesh_vert @ u).max(), abs=1e-6)


def test_of_a_thing_that_nothing_hides_all_is_in_view() -> None:
    """Round ones too, which fill less of the box around their length, width and height."""
    most: dict[str, float] = {}
    for view in things_of_rooms(["kitchen:3", "bedroom:3"], 40, MAST):
        for thing in view.things:
            most[thing.name] = max(most.get(thing.name, 0.0), thing.share)
    round_ones = {"Apple", "Bowl", "GarbageCan", "HousePlant", "Pillow", "Plate", "Pot", "Vase"}
    assert len(round_ones & most.keys()) > 4
    assert min(most[name] for name in round_ones & most.keys()) > 0.95
