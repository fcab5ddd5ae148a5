"""A turn of the LiDAR takes time: what it shows of a robot that stands, drives and turns."""

import math

import numpy as np
import pytest
from sim_bridge.lidar_turn import LidarTurn
from sim_bridge.rplidar import SCAN_PERIOD
from sim_bridge.world import Pose, World

from tests.sim.test_simulator import WALL_X, bare_room


@pytest.fixture(scope="module")
def world():
    return World(bare_room())


def turns(world, pose_at, seconds):
    """(begin, distances, time of completion) of each turn of a robot that moves as told."""
    turn, found = LidarTurn(), []
    for step in range(1, round(seconds * 100) + 1):
        t = step * 0.01
        if turn.complete(t, pose_at(t)):
            found.append((turn.began, turn.distances(world), t))
            turn.next()
    return found


def test_standing_robot_sees_what_one_cast_sees(world):
    pose = Pose(1.0, 1.0, 0.3)
    for _, distances, _ in turns(world, lambda t: pose, 1.0):
        assert np.array_equal(distances, world.scan(pose))


def test_turns_follow_each_other_and_are_stamped_with_their_beginning(world):
    pose = Pose(1.0, 1.0, 0.0)
    found = turns(world, lambda t: pose, 10.0)
    assert len(found) == 77 - 1 or len(found) == 77
    for k, (began, _, complete) in enumerate(found):
        assert began == pytest.approx(k * SCAN_PERIOD)
        assert 0 <= complete - began - SCAN_PERIOD <= 0.01


def test_beams_of_a_driving_robot_come_from_where_it_was(world):
    def pose_at(t):
        return Pose(1.0 + 0.3 * t, 1.0, 0.0)

    _, distances, complete = turns(world, pose_at, 0.2)[0]
    # Clockwise from bearing 270 (to the right): the front, bearing 0, comes after 270/360.
    when = 270 / 360 * SCAN_PERIOD
    lidar_x = pose_at(when).x - 0.04
    assert distances[0] == pytest.approx(WALL_X - lidar_x, abs=0.3 * 0.011)
    assert distances[0] > WALL_X - (pose_at(complete).x - 0.04) + 0.005


def test_turning_smears_bearings(world):
    def pose_at(t):
        return Pose(1.0, 1.0, t)

    _, distances, complete = turns(world, pose_at, 0.2)[0]
    late, still = world.scan(pose_at(complete)), world.scan(pose_at(0.0))
    # The first beam (bearing 270) saw the robot before its turn, the last one after.
    assert distances[269] == pytest.approx(still[269], rel=0.02)
    assert distances[271] == pytest.approx(late[271], rel=0.02)
    assert not np.allclose(distances[:90], late[:90], rtol=1e-3)
    assert math.isfinite(distances[0])


def test_restart_begins_a_turn_then(world):
    turn = LidarTurn()
    turn.complete(0.05, Pose(1.0, 1.0, 0.0))
    turn.restart(0.06)
    assert not turn.complete(0.15, Pose(1.0, 1.0, 0.0))
    assert turn.complete(0.06 + SCAN_PERIOD, Pose(1.0, 1.0, 0.0))
    assert turn.began == 0.06
