"""Troubles of the base, driven through the real physics of a bare room."""

import math

import pytest
from sim_bridge.robot.simulator import Simulator
from sim_bridge.world.world import World

from tests.sim.test_simulator import bare_room, drive


@pytest.fixture
def simulator():
    simulator = Simulator(World(bare_room()))
    simulator.place(1.0, 1.0, 0.0)
    return simulator


def give(simulator, *faults):
    simulator.take_faults(frozenset(faults))


def moved(simulator):
    pose = simulator.world.pose
    return math.dist((pose.x, pose.y), (1.0, 1.0))


def test_stuck_base_does_not_move_and_its_wheels_do_not_turn(simulator):
    give(simulator, "base_stuck")
    drive(simulator, 0.2, 0.5, 1.0)
    assert moved(simulator) < 1e-6
    assert simulator.twist == pytest.approx((0.0, 0.0), abs=1e-6)
    give(simulator)
    drive(simulator, 0.2, 0.0, 0.05)
    assert simulator.world.velocity[0] < 0.06  # it speeds up from rest


def test_slipping_wheels_report_a_motion_that_is_none(simulator):
    give(simulator, "base_slip")
    drive(simulator, 0.2, 0.0, 1.0)
    assert moved(simulator) < 1e-6
    assert simulator.odometry.x == pytest.approx(0.0, abs=1e-6)
    assert simulator.twist == pytest.approx((0.2, 0.0))


def test_push_moves_the_robot_back_and_sideways_without_a_command(simulator):
    give(simulator, "base_pushed")
    for _ in range(50):
        simulator.step()
    give(simulator)
    drive(simulator, 0.0, 0.0, 0.5)
    pose = simulator.world.pose
    assert moved(simulator) == pytest.approx(0.15, abs=0.005)
    assert pose.x < 0.9
    assert pose.y > 1.1
    assert simulator.odometry.y == pytest.approx(pose.y - 1.0, abs=1e-3)


@pytest.mark.parametrize("fault", ["base_busy", "e_stop"])
def test_base_that_does_not_listen_brakes_and_stands(simulator, fault):
    drive(simulator, 0.2, 0.0, 1.0)
    give(simulator, fault)
    assert simulator.wheels_enabled is (fault != "e_stop")
    drive(simulator, 0.2, 0.0, 0.3)
    x = simulator.world.pose.x
    drive(simulator, 0.2, 0.0, 1.0)
    assert simulator.world.pose.x == pytest.approx(x, abs=1e-6)
    give(simulator)
    drive(simulator, 0.2, 0.0, 0.5)
    assert simulator.world.pose.x > x + 0.05


def test_action_of_its_own_is_a_circle_that_no_command_ends(simulator):
    drive(simulator, 0.2, 0.0, 0.5)
    give(simulator, "base_action")
    assert simulator.busy
    drive(simulator, 0.0, 0.0, 1.0)
    assert simulator.world.velocity == pytest.approx((0.1, 0.5), abs=0.01)
    drive(simulator, 0.0, 0.0, math.tau / 0.5 - 1.0)
    assert moved(simulator) < 0.15
    give(simulator)
    drive(simulator, 0.0, 0.0, 0.5)
    assert simulator.motion.still_since is not None


def test_stuck_base_frees_itself_to_either_side_whatever_it_is_told(simulator):
    give(simulator, "base_frees_itself")
    rates = []
    for _ in range(6):
        drive(simulator, 0.2, 0.0, 0.5)
        rates.append(simulator.world.velocity[1])
    assert sorted(rates) == pytest.approx([-1.5] * 3 + [1.5] * 3, abs=0.1)
    assert 0.1 < 1.0 - simulator.world.pose.x < 0.2


def test_slowed_base_drives_and_turns_no_faster(simulator):
    give(simulator, "base_slowed")
    drive(simulator, 0.2, 0.0, 0.5)
    assert simulator.world.velocity == pytest.approx((0.1, 0.0), abs=0.01)
    drive(simulator, 0.0, 1.0, 0.5)
    assert simulator.world.velocity == pytest.approx((0.0, 0.1 / 0.1165), abs=0.02)
    give(simulator)
    drive(simulator, 0.2, 0.0, 0.5)
    assert simulator.world.velocity[0] == pytest.approx(0.2, abs=0.01)


def test_odometry_jumps_and_turns_once(simulator):
    give(simulator, "odom_jump")
    drive(simulator, 0.0, 0.0, 0.1)
    give(simulator, "odom_jump", "odom_turned")
    drive(simulator, 0.0, 0.0, 0.1)
    give(simulator)
    drive(simulator, 0.0, 0.0, 0.1)
    odometry = simulator.odometry
    assert (odometry.x, odometry.y, odometry.yaw) == pytest.approx((0.5, 0.0, math.pi / 2))
    assert moved(simulator) < 1e-6


def test_stuck_tilt_stays_where_it_is(simulator):
    simulator.tilt_to(-0.5)
    drive(simulator, 0.0, 0.0, 0.2)
    give(simulator, "tilt_stuck")
    drive(simulator, 0.0, 0.0, 0.5)
    assert simulator.world.pose.tilt == pytest.approx(-0.2, abs=0.011)


def test_stuck_bumper_is_pressed_in_front_without_a_contact(simulator):
    assert simulator.pressed() == []
    give(simulator, "bumper_stuck")
    assert simulator.pressed() == [0.0]
    assert not simulator.collisions.contacts


def test_standing_still_is_known_to_the_step(simulator):
    began = simulator.time
    assert simulator.motion.still_since == began
    drive(simulator, 0.0, 0.0, 0.3)
    assert simulator.motion.still_since == began
    drive(simulator, 0.2, 0.0, 1.0)
    assert simulator.motion.still_since is None
    assert simulator.motion.v == pytest.approx(0.2, abs=1e-3)
    while simulator.world.speed >= 0.005:
        simulator.command(0.0, 0.0)
        simulator.step()
    stopped = simulator.time
    drive(simulator, 0.0, 0.0, 1.0)
    assert simulator.motion.still_since == stopped
    give(simulator, "base_pushed")
    drive(simulator, 0.0, 0.0, 0.2)
    assert simulator.motion.still_since is None
