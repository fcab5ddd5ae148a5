"""A turn of the LiDAR takes time: what it shows of a robot that stands, drives and turns."""

import numpy as np
import pytest
from sim_bridge.robot.lidar_turn import LidarTurn, standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.rplidar import (
    MODES,
    SCAN_PERIOD,
    STANDARD,
    bearings,
    driver_ranges,
    sample_angles,
)
from sim_bridge.world.world import Pose, World

from tests.sim.test_simulator import bare_room


@pytest.fixture(scope="module")
def world():
    return World(bare_room())


EXACT = Noise(NoiseLevels().scaled(0.0), 0)
ANGLES = sample_angles(STANDARD, 0.5)
"""Where samples are taken without noise; at 2 kHz each bin holds one of them."""


def turns(world, pose_at, seconds, mode=STANDARD):
    """(begin, ranges, time of completion) of each turn of a robot that moves as told."""
    turn, found = LidarTurn(), []
    for step in range(1, round(seconds * 100) + 1):
        t = step * 0.01
        if turn.complete(t, pose_at(t)):
            found.append((turn.began, turn.ranges(world, EXACT, mode), t))
            turn.next()
    return found


def seen_from(world, poses):
    """The driver's turn of samples that are cast from a pose each."""
    distances = [
        world.scan(bearings(angle[None]), pose)[0]
        for angle, pose in zip(ANGLES, poses, strict=True)
    ]
    return driver_ranges(ANGLES, np.array(distances, np.float32), STANDARD)


@pytest.mark.parametrize("mode", MODES.values(), ids=list(MODES))
def test_standing_robot_sees_what_one_cast_sees(world, mode):
    pose = Pose(1.0, 1.0, 0.3)
    for _, ranges, _ in turns(world, lambda t: pose, 1.0, mode):
        assert np.array_equal(ranges, standing_turn(world, EXACT, mode, pose))


def test_turns_follow_each_other_and_are_stamped_with_their_beginning(world):
    pose = Pose(1.0, 1.0, 0.0)
    found = turns(world, lambda t: pose, 10.0)
    assert len(found) == 77 - 1 or len(found) == 77
    for k, (began, _, complete) in enumerate(found):
        assert began == pytest.approx(k * SCAN_PERIOD)
        assert 0 <= complete - began - SCAN_PERIOD <= 0.01


def test_each_sample_comes_from_where_the_robot_was_when_it_was_taken(world):
    """Physics steps of 0.01 s: a sample sees the robot at the end of its step."""

    def pose_at(t):
        return Pose(1.0 + 0.3 * t, 1.0, 1.2 * t)

    _, ranges, complete = turns(world, pose_at, 0.2)[0]
    steps = np.ceil(ANGLES / 360 * SCAN_PERIOD / 0.01 - 1e-6)
    assert np.array_equal(ranges, seen_from(world, [pose_at(0.01 * step) for step in steps]))
    assert not np.allclose(ranges, standing_turn(world, EXACT, STANDARD, pose_at(complete)))


def test_noise_draws_the_phase_of_each_turn(world):
    pose = Pose(1.0, 1.0, 0.3)
    levels = NoiseLevels(range_share=0.0, range_resolution=0.0, dropout=1e-12, edge_ghost=0.0)
    noise = Noise(levels, 0)
    first, second = (standing_turn(world, noise, STANDARD, pose) for _ in range(2))
    assert not np.array_equal(np.isinf(first), np.isinf(second))
    assert 0.0 <= noise.phase() < 1.0
    assert EXACT.phase() == 0.5


def test_restart_begins_a_turn_then(world):
    turn = LidarTurn()
    turn.complete(0.05, Pose(1.0, 1.0, 0.0))
    turn.restart(0.06)
    assert not turn.complete(0.15, Pose(1.0, 1.0, 0.0))
    assert turn.complete(0.06 + SCAN_PERIOD, Pose(1.0, 1.0, 0.0))
    assert turn.began == 0.06
