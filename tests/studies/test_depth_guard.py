"""The study of depth: a few decisions of a wandering robot, figures by hand, what a camera sees."""

import math
from dataclasses import replace

import pytest
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import Pose, World

from cfnav_core.task.camera import CAMERAS
from studies.deploy.depth_guard import Decision, decisions, figures, furnished, seen_strip


def test_misses_and_false_alarms_by_hand():
    found = [
        Decision("a", 0.9, 0.9, True, True),
        Decision("a", 0.2, 0.8, True, False),
        Decision("b", 0.2, 0.2, True, False),
        Decision("b", 0.1, 0.1, False, False),
        Decision("a", 0.1, 0.7, False, False),
    ]
    rows = figures(found)
    assert [rows[f"{who}_missed"][0] for who in ("lidar", "both")] == [
        pytest.approx(2 / 3),
        pytest.approx(1 / 3),
    ]
    assert rows["lidar_missed_over_the_plane"][::3] == [1.0, 2]
    assert rows["both_missed_over_the_plane"][::3] == [0.5, 2]
    assert rows["lidar_free_but_forbidden"][::3] == [0.0, 2]
    assert rows["both_free_but_forbidden"][::3] == [0.5, 2]


@pytest.mark.parametrize("camera", list(CAMERAS))
def test_a_wandering_robot_is_judged_and_repeats_itself(camera):
    walk = ("living_room", 3, 20, CAMERAS[camera], 0.0)
    found = list(decisions(*walk))
    assert len(found) == 20
    assert all(d.both >= d.lidar for d in found)
    assert all(d.blocked for d in found if d.in_plane)
    assert found == list(decisions(*walk))


def test_a_camera_that_looks_down_measures_the_floor():
    world = World(furnished("kitchen", 20))
    x, y = state_grid(world).positions[0]
    with Camera(world, replace(CAMERAS["mast"], fov_deg=(60.0, 60.0), size=(64, 64))) as camera:
        _, depth = camera.depth(Pose(float(x), float(y), 0.0, math.radians(-65.0)))
    assert depth.max() < 1.3 / math.sin(math.radians(35.0)) + 0.1  # the far edge of a bare floor


def test_what_a_camera_sees_of_the_way_is_what_its_geometry_says():
    mast = CAMERAS["mast"]
    level = seen_strip(mast, 0.0)
    assert level["hull"] == 0.0
    # the lower edge of a picture 48.8 degrees high
    assert level["from_0.75_m"] == pytest.approx(0.55 / math.tan(math.radians(24.4)), abs=0.002)
    down = seen_strip(mast, mast.horizons[1])
    assert level["mast"] < down["mast"] < 0.5
    assert down["from_0.75_m"] < level["from_0.75_m"]
    sold = seen_strip(CAMERAS["stock_preview"], 0.0)
    assert "mast" not in sold
    assert 0.7 < sold["hull"] < 0.9
