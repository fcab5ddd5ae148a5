"""Noise has the magnitudes that are written down, repeats itself for a seed, and can be none."""

import math

import numpy as np
import pytest
from sim_bridge.robot.lidar_turn import standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels, blurred
from sim_bridge.robot.simulator import Simulator
from sim_bridge.world.world import World

from tests.sim.test_simulator import bare_room

NONE = NoiseLevels().scaled(0.0)
LEVELS = NoiseLevels()
WALL = np.full(360, 2.0, np.float32)


def levels(**values):
    """No noise but this."""
    return NoiseLevels(**{**NONE.__dict__, **values})


def scans(noise, distances, count=300):
    return np.stack([noise.scan(distances) for _ in range(count)])


def test_without_noise_everything_is_as_it_was():
    noise = Noise(NONE, 3)
    assert noise.scan(WALL) is WALL
    assert noise.slip(0.2, -0.3) == (0.2, -0.3)
    assert noise.count(0.01, 0.001, 0.02, 0.01) == (0.01, 0.001, 0.02)
    assert noise.twist(0.1, 0.2) == (0.1, 0.2)
    picture = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
    assert noise.picture(picture, 0.1, (500.0, 500.0)) is picture


def test_ranges_spread_within_the_data_sheet_on_its_grid():
    seen = scans(Noise(levels(range_share=0.003, range_resolution=0.0005), 0), WALL)
    assert seen.std() == pytest.approx(0.003 * 2.0, rel=0.02)
    assert seen.mean() == pytest.approx(2.0, abs=1e-4)
    assert np.abs(seen / 0.0005 - np.round(seen / 0.0005)).max() < 1e-3
    nominal = scans(Noise(LEVELS, 0), WALL)
    assert np.mean(np.abs(nominal[np.isfinite(nominal)] - 2.0) < 0.01 * 2.0) > 0.995


def test_beams_drop_out_at_the_stated_share():
    seen = scans(Noise(LEVELS, 1), WALL)
    assert np.isinf(seen).mean() == pytest.approx(LEVELS.dropout, rel=0.1)
    assert np.isinf(scans(Noise(LEVELS, 1), np.full(360, np.inf, np.float32))).all()


def test_ghosts_stand_between_both_sides_of_a_depth_edge_only():
    step = WALL.copy()
    step[100:200] = 1.0
    seen = scans(Noise(levels(edge_ghost=0.02), 2), step, 3000)
    differs = seen != step
    assert set(np.nonzero(differs.any(0))[0]) == {100, 200}
    assert differs[:, [100, 200]].mean() == pytest.approx(0.02, abs=0.005)
    ghosts = seen[differs]
    assert ghosts.min() > 1.0
    assert ghosts.max() < 2.0


def spread(values):
    return float(np.std(values))


def test_slip_is_drawn_for_each_motion_and_holds_through_it():
    noise = Noise(LEVELS, 0)
    forward, turns, veers = [], [], []
    for _ in range(2000):
        v, w = noise.slip(0.2, 0.0)
        assert noise.slip(0.2, 0.0) == (v, w)
        forward.append(v / 0.2 - 1)
        veers.append(w / 0.2)
        assert noise.slip(0.0, 0.0) == (0.0, 0.0)
        turns.append(noise.slip(0.0, 1.0)[1] - 1)
        noise.slip(0.0, 0.0)
    assert spread(forward) == pytest.approx(LEVELS.forward_slip, rel=0.06)
    assert spread(turns) == pytest.approx(LEVELS.turn_slip, rel=0.06)
    assert spread(veers) == pytest.approx(LEVELS.veer, rel=0.06)


def test_counting_errors_are_one_draw_for_a_robot():
    scales, angles, drifts = [], [], []
    noise = Noise(LEVELS, 0)
    for seed in range(1500):
        noise.reseed(seed)
        assert noise.count(0.0, 0.0, 0.0, 0.01) == (0.0, 0.0, 0.0)  # at rest nothing drifts
        noise.slip(0.1, 0.0)
        drift = noise.count(0.0, 0.0, 0.0, 1.0)[2]
        forward, left, turn = noise.count(1.0, 0.5, 1.0, 1.0)
        assert left == forward / 2
        scales.append(forward - 1)
        angles.append(turn - drift - 1)
        drifts.append(drift)
    assert spread(scales) == pytest.approx(LEVELS.odometry_scale, rel=0.06)
    assert spread(angles) == pytest.approx(LEVELS.gyro_scale, rel=0.06)
    assert spread(drifts) == pytest.approx(LEVELS.gyro_drift, rel=0.06)


def test_twist_spreads_and_is_zero_at_rest():
    noise = Noise(LEVELS, 0)
    seen = np.array([noise.twist(0.2, 1.0) for _ in range(4000)])
    assert seen.std(0) == pytest.approx([0.2 * LEVELS.twist_share, LEVELS.twist_share], rel=0.05)
    assert noise.twist(0.0, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize("grey", [10, 100, 200])
def test_pixels_spread_by_reading_and_photons(grey):
    noise = Noise(levels(read_noise=1.0, photon_noise=0.03), 0)
    seen = noise.picture(np.full((300, 300, 3), grey, np.uint8), 1 / 15)
    assert seen.mean() == pytest.approx(grey, abs=0.05)
    rounding = 1 / 12
    assert seen.std() == pytest.approx(math.sqrt(1.0 + 0.03 * grey + rounding), rel=0.02)


@pytest.mark.parametrize("size", [836, 837, 1080])
def test_large_picture_has_the_noise_of_a_small_one(size):
    noise = Noise(levels(read_noise=1.0, photon_noise=0.03), 0)
    seen = noise.picture(np.full((size, size, 3), 100, np.uint8), 1 / 15)
    assert seen.std() == pytest.approx(math.sqrt(1.0 + 0.03 * 100 + 1 / 12), rel=0.02)


def test_brightness_wanders_slowly_and_stays_a_byte():
    noise = Noise(levels(exposure=0.03), 0)
    picture = np.full((4, 4, 3), 200, np.uint8)
    means = np.array([noise.picture(picture, 1 / 15).mean() for _ in range(20000)])
    assert means.std() / 200 == pytest.approx(0.03, rel=0.15)
    assert np.abs(np.diff(means)).mean() < 0.2 * means.std()
    white = Noise(LEVELS, 0).picture(np.full((64, 64, 3), 255, np.uint8), 1.0)
    black = Noise(LEVELS, 0).picture(np.zeros((64, 64, 3), np.uint8), 1.0)
    assert white.min() > 180
    assert black.max() < 10


def test_motion_smears_the_picture_by_its_length():
    line = np.zeros((9, 41, 3), np.uint8)
    line[:, 20] = 240
    noise = Noise(levels(exposure_time=0.02), 0)
    # 150 pixels focal length at 1 rad/s for 0.02 s: 3 pixels, so 4 places share the light.
    smeared = noise.picture(line, 0.1, (150.0, 0.0))
    assert list(np.nonzero(smeared[4, :, 0])[0]) == [18, 19, 20, 21]
    assert smeared[4, 20, 0] == 60
    assert np.array_equal(noise.picture(line, 0.1, (20.0, 0.0)), line)
    assert np.array_equal(blurred(line, 4.0, 0), line)  # along the line nothing changes
    assert np.array_equal(blurred(line.swapaxes(0, 1), -3.0, 0), smeared.swapaxes(0, 1))


def test_seed_decides_everything():
    def draw(seed):
        noise = Noise(LEVELS, seed)
        noise.slip(0.1, 0.1)
        picture = noise.picture(np.full((8, 8, 3), 99, np.uint8), 0.1)
        return noise.scan(WALL), noise.slip(0.1, 0.1), noise.count(1, 1, 1, 1), picture

    def same(a, b):
        return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))

    assert same(draw(5), draw(5))
    assert not same(draw(5), draw(6))
    # What one sense draws does not change what another does.
    noise, other = Noise(LEVELS, 5), Noise(LEVELS, 5)
    other.scan(WALL)
    assert noise.slip(0.1, 0.1) == other.slip(0.1, 0.1)


def test_two_runs_of_the_simulator_with_noise_are_the_same_to_the_last_bit():
    def run(seed):
        noise = Noise(LEVELS, seed)
        simulator = Simulator(World(bare_room()), noise)
        simulator.place(1.0, 1.0, 0.0)
        seen = []
        for step in range(400):
            if step % 5 == 0:
                simulator.command(
                    *((0.2, 0.1) if step < 150 else (0.0, 0.0 if step < 200 else 0.8))
                )
            simulator.step()
            if step % 13 == 0:
                seen.append(standing_turn(simulator.world, noise).tobytes())
            odometry = simulator.odometry
            seen.append((simulator.world.pose, odometry.x, odometry.y, odometry.yaw))
        return seen

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_odometry_is_off_by_little_after_a_drive_and_a_turn():
    errors = []
    for seed in range(12):
        simulator = Simulator(World(bare_room()), Noise(LEVELS, seed))
        simulator.place(1.0, 1.0, 0.0)
        for step in range(500):
            simulator.command(*((0.2, 0.0) if step < 300 else (0.0, 0.785)))
            simulator.step()
        pose, counted = simulator.world.pose, simulator.odometry
        errors.append((counted.x - (pose.x - 1.0), counted.yaw - pose.yaw))
        # By the wheels 0.6 m and 0.785 * 1.9 rad (0.2 s to speed up); the truth is near that.
        assert pose.x == pytest.approx(1.6, abs=0.03)
        assert pose.yaw == pytest.approx(0.785 * 1.9, abs=0.12)
    along, around = np.abs(errors).max(0)
    assert 1e-4 < along < 0.015
    assert 1e-4 < around < 0.03
