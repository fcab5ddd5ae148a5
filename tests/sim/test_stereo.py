"""The stereo camera errs with the square of depth, and measures nothing where an OAK-D does not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sim_bridge.robot import stereo
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.world.camera import Camera
from sim_bridge.world.world import Pose, World

from cfnav_core.task.camera import CAMERAS, MAST
from tests.sim.test_simulator import bare_room

WIDTH, HEIGHT = stereo.SIZE
ROUGH = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
NONE = NoiseLevels().scaled(0.0)
FB = stereo.FOCAL_PX * stereo.BASELINE_M


def measure(depth, rgb=ROUGH, **levels):
    whole = np.broadcast_to(np.float32(depth), (HEIGHT, WIDTH))
    return Noise(replace(NONE, **levels), 0).depth(whole, rgb) / 1000


def test_without_noise_depth_is_right_to_an_eighth_of_a_pixel():
    for depth in (0.3, 1.0, 3.0):
        seen = measure(depth)
        assert np.abs(seen[seen > 0] - depth).max() <= depth**2 / FB / 16 + 1e-3
        # the left edge is out of the right camera's sight by the disparity
        assert (seen == 0).mean() == pytest.approx(FB / depth / stereo.NATIVE_COLUMNS, abs=0.01)


def test_errors_grow_with_the_square_of_depth():
    for depth in (0.5, 1.0, 2.0, 4.0):
        seen = measure(depth, disparity=0.2)
        spread = (seen[seen > 0] - depth).std()
        assert spread == pytest.approx(0.2 * depth**2 / FB, rel=0.2)


def test_too_near_and_too_far_are_not_measured():
    nearest = FB / stereo.MOST_DISPARITY
    assert 0.15 < nearest < 0.2
    assert not measure(nearest - 0.01).any()
    assert measure(nearest + 0.01).any()
    assert not measure(stereo.FURTHEST_M + 1).any()


def test_plain_surfaces_return_nothing_unless_dots_are_thrown_on_them():
    plain = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    assert not measure(1.0, plain, plain=0.5).any()
    assert measure(1.0, plain).any()
    assert measure(1.0, plain=0.5).any()


def test_what_only_one_camera_sees_is_not_measured():
    depth = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    depth[:, 150:200] = 0.5
    seen = Noise(NONE, 0).depth(depth, ROUGH) / 1000
    hidden = (1 / 0.5 - 1 / 2.0) * FB / 2  # pixels of the halved picture
    row = seen[100]
    assert (row[150 - round(hidden) + 1 : 150] == 0).all()
    assert (row[150:200] > 0.49).all()
    assert (row[200:] > 1.9).all()


def test_mismatches_have_the_stated_share_and_repeat_for_a_seed():
    seen = measure(2.0, mismatch=0.05)
    assert np.mean(np.abs(seen[:, 40:] - 2.0) > 0.1) == pytest.approx(0.05, abs=0.015)
    assert (seen == measure(2.0, mismatch=0.05)).all()


def test_the_camera_of_the_room_and_that_of_depth_share_a_world():
    world = World(bare_room())
    at = Pose(1.5, 1.5, 0.0, -math.radians(30.0))
    set_up = stereo.set_up_of(MAST)
    with Camera(world) as eye:
        alone = eye.rgb(at)
        with Camera(world, set_up) as two:
            rgb, depth = two.depth(at)
            assert (eye.rgb(at) == alone).all()
            assert (two.depth(at)[1] == depth).all()
    assert (rgb.shape, depth.shape) == ((HEIGHT, WIDTH, 3), (HEIGHT, WIDTH))
    # the wall 1.5 m ahead, seen 30 degrees downwards in the middle of the picture
    wall = 1.5 / math.cos(math.radians(30.0))
    assert depth[HEIGHT // 2, WIDTH // 2] == pytest.approx(wall, rel=0.01)
    assert stereo.set_up_of(CAMERAS["stock_preview"]).horizons == (0.0,)
