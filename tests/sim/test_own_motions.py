"""What the base does by itself, driven through the real physics of a bare room."""

import math

import pytest
from sim_bridge.robot.own_motions import DOCK_S, UNDOCK_S, BackupBuffer
from sim_bridge.robot.simulator import Simulator
from sim_bridge.world.world import HULL_RADIUS, World

from tests.sim.test_simulator import WALL_X, bare_room, drive


def robot(x, *, reflexes=True):
    simulator = Simulator(World(bare_room()), reflexes=reflexes)
    simulator.place(x, 1.0, 0.0)
    return simulator


def test_bumped_base_backs_off_by_itself_and_ignores_commands_meanwhile():
    simulator = robot(2.7)
    while not simulator.collisions.count:
        simulator.command(0.2, 0.0)
        simulator.step()
    assert simulator.pressed()
    speeds = []
    for _ in range(8):
        simulator.command(0.3, 0.5)
        simulator.step()
    while simulator.busy:
        simulator.command(0.3, 0.5)
        simulator.step()
        speeds.append(simulator.world.velocity)
    assert min(v for v, _ in speeds) == pytest.approx(-0.14, abs=0.002)
    assert max(abs(w) for _, w in speeds) < 0.01
    assert 0.05 <= WALL_X - HULL_RADIUS - simulator.world.pose.x < 0.08
    assert not simulator.pressed()


def test_base_without_reflexes_keeps_pushing():
    simulator = robot(2.7, reflexes=False)
    drive(simulator, 0.2, 0.0, 2.0)
    assert simulator.pressed()
    assert not simulator.busy


def test_stuck_bumper_makes_it_back_off_once_and_not_far():
    simulator = robot(1.5)
    simulator.take_faults(frozenset({"bumper_stuck"}))
    drive(simulator, 0.0, 0.0, 4.0)
    assert 1.5 - simulator.world.pose.x == pytest.approx(0.15, abs=0.015)
    assert not simulator.busy


def test_reflex_that_cannot_move_gives_up():
    simulator = robot(1.5)
    simulator.take_faults(frozenset({"bumper_stuck", "base_stuck"}))
    drive(simulator, 0.0, 0.0, 2.1)
    assert not simulator.busy


def test_commands_drive_backward_only_as_far_as_forward_before():
    simulator = robot(1.5)
    assert simulator.backup_low
    drive(simulator, -0.1, 0.5, 1.0)
    assert simulator.world.pose.x == pytest.approx(1.5)
    assert simulator.world.pose.yaw == pytest.approx(0.0)
    drive(simulator, 0.2, 0.0, 0.7)
    drive(simulator, 0.0, 0.0, 0.5)
    ahead = simulator.world.pose.x - 1.5
    assert 0.1 < ahead < 0.15
    assert not simulator.backup_low
    drive(simulator, -0.2, 0.0, 3.0)
    # It brakes from 0.2 m/s when nothing is left.
    assert simulator.world.pose.x == pytest.approx(1.5 - 0.2**2 / 1.8, abs=0.005)
    assert simulator.backup_low


def test_buffer_holds_so_much_and_a_lifted_robot_has_none():
    buffer = BackupBuffer()
    buffer.move(5.0)
    assert buffer.left == 0.15
    buffer.move(-0.11)
    assert buffer.low
    assert buffer.limit(-0.1, 0.2) == (-0.1, 0.2)
    buffer.move(-1.0)
    assert buffer.limit(-0.1, 0.2) == (0.0, 0.0)
    assert buffer.limit(0.1, 0.2) == (0.1, 0.2)
    simulator = robot(1.5)
    drive(simulator, 0.2, 0.0, 1.0)
    simulator.place(1.5, 1.0, 0.0)
    assert simulator.backup_low


def test_docked_robot_ignores_commands_until_it_has_left_the_dock():
    simulator = robot(1.5)
    simulator.dock()
    drive(simulator, 0.2, 0.5, 1.0)
    assert simulator.world.pose.x == pytest.approx(1.5)
    undock = simulator.undock()
    steps = 0
    while simulator.busy:
        assert simulator.docked
        simulator.command(0.2, 0.0)
        simulator.step()
        steps += 1
    assert steps * 0.01 < UNDOCK_S / 1.5
    assert undock.done
    assert not simulator.docked
    drive(simulator, 0.0, 0.0, 0.5)
    pose = simulator.world.pose
    assert 1.5 - pose.x == pytest.approx(0.3, abs=0.05)
    assert abs(math.remainder(pose.yaw - math.pi, math.tau)) < 0.05
    drive(simulator, 0.2, 0.0, 0.5)
    assert simulator.world.pose.x < pose.x - 0.05


def test_undocking_against_a_wall_is_given_up():
    simulator = robot(1.5)
    simulator.place(WALL_X - HULL_RADIUS - 0.02, 1.0, math.pi)
    simulator.dock()
    undock = simulator.undock()
    drive(simulator, 0.0, 0.0, UNDOCK_S - 0.1)
    assert simulator.own is undock
    drive(simulator, 0.0, 0.0, 0.3)
    assert not simulator.busy
    assert simulator.docked
    assert not undock.done


@pytest.mark.parametrize(("seconds", "docked"), [(1.0, True), (4.0, False)])
def test_undocking_without_power_is_dropped_and_not_taken_up_again(seconds, docked):
    simulator = robot(1.5)
    simulator.dock()
    undock = simulator.undock()
    drive(simulator, 0.0, 0.0, seconds)
    simulator.e_stop = True
    drive(simulator, 0.0, 0.0, 1.0)
    assert not simulator.busy
    simulator.e_stop = False
    x, yaw = simulator.world.pose.x, simulator.world.pose.yaw
    drive(simulator, 0.0, 0.0, 1.0)
    now = simulator.world.pose
    assert (now.x, now.yaw) == pytest.approx((x, yaw), abs=1e-6)
    assert (simulator.docked, undock.done) == (docked, False)


def test_back_off_without_power_is_dropped_and_not_taken_up_again():
    simulator = robot(1.5)
    simulator.take_faults(frozenset({"bumper_stuck"}))
    drive(simulator, 0.0, 0.0, 0.3)
    assert simulator.busy
    simulator.take_faults(frozenset({"bumper_stuck", "e_stop"}))
    drive(simulator, 0.0, 0.0, 0.5)
    simulator.take_faults(frozenset({"bumper_stuck"}))
    x = simulator.world.pose.x
    drive(simulator, 0.0, 0.0, 1.0)
    assert simulator.world.pose.x == pytest.approx(x, abs=1e-6)


def run_own(simulator):
    """Let the base do what it does by itself to its end, commands or not."""
    while simulator.busy:
        simulator.command(0.2, 0.3)
        simulator.step()


def left_its_dock(x=1.2):
    simulator = robot(x)
    assert not simulator.dock_visible
    simulator.dock()
    simulator.undock()
    run_own(simulator)
    return simulator


def test_a_robot_goes_back_to_a_dock_in_sight_from_where_it_is():
    simulator = left_its_dock()
    drive(simulator, 0.0, -0.7, 1.0)
    drive(simulator, 0.2, 0.0, 1.5)
    drive(simulator, 0.0, 0.0, 0.5)
    assert simulator.dock_visible
    dock = simulator.go_to_dock()
    run_own(simulator)
    pose = simulator.world.pose
    assert (dock.done, simulator.docked) == (True, True)
    assert math.dist((pose.x, pose.y), (1.2, 1.0)) < 0.05
    assert abs(math.remainder(pose.yaw, math.tau)) < 0.05
    simulator.undock()
    run_own(simulator)
    assert not simulator.docked


def test_a_dock_far_away_is_not_seen():
    simulator = left_its_dock(2.2)
    drive(simulator, 0.2, 0.0, 4.0)
    assert not simulator.dock_visible


def test_going_back_to_the_dock_is_given_up_when_it_cannot_be_or_is_told_so():
    simulator = left_its_dock()
    simulator.take_faults(frozenset({"base_stuck"}))
    dock = simulator.go_to_dock()
    drive(simulator, 0.0, 0.0, DOCK_S + 0.1)
    assert (simulator.busy, dock.done, simulator.docked) == (False, False, False)
    simulator.take_faults(frozenset())
    dock = simulator.go_to_dock()
    drive(simulator, 0.0, 0.0, 1.0)
    simulator.stop_own()
    assert (simulator.busy, dock.done, simulator.docked) == (False, False, False)


def test_dock_that_is_a_fault_holds_a_driving_robot():
    simulator = robot(1.5)
    drive(simulator, 0.2, 0.0, 1.0)
    simulator.take_faults(frozenset({"docked"}))
    drive(simulator, 0.2, 0.0, 1.0)
    assert simulator.docked
    assert simulator.world.velocity[0] == pytest.approx(0.0, abs=1e-6)


def test_base_without_power_does_not_back_off():
    simulator = robot(2.8)
    simulator.e_stop = True
    simulator.take_faults(frozenset({"bumper_stuck"}))
    drive(simulator, 0.0, 0.0, 1.0)
    assert simulator.world.pose.x == pytest.approx(2.8)
