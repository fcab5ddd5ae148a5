"""The robot driven through the real physics of a bare room with one wall and one high shelf."""

import math

import pytest
from sim_bridge.robot.collisions import Collisions
from sim_bridge.robot.simulator import Simulator
from sim_bridge.room.parts import Part, RoomObject
from sim_bridge.room.room import Room
from sim_bridge.world.grid import StartPose
from sim_bridge.world.world import Touch, World

WALL_X = 3.0
HULL_RADIUS, MAST_RADIUS = 0.175, 0.03
SHELF_Y = 4.0


def solid(owner, centre, half):
    return Part("box", centre, half, 0.0, (0.5, 0.5, 0.5), None, None, owner, True, 0.0)


def bare_room():
    parts = (
        solid(0, (WALL_X + 0.1, 2.0, 0.5), (0.1, 3.0, 0.5)),
        solid(1, (1.0, SHELF_Y + 0.1, 0.9), (1.0, 0.1, 0.05)),
    )
    objects = (
        RoomObject("Wall", (WALL_X, -1.0, WALL_X + 0.2, 5.0)),
        RoomObject("Shelf", (0.0, SHELF_Y, 2.0, SHELF_Y + 0.2)),
    )
    return Room("kitchen", 0, 4.0, 5.0, parts, (), objects, {}, 0.5, ())


@pytest.fixture
def simulator():
    simulator = Simulator(World(bare_room()))
    simulator.place(1.0, 1.0, 0.0)
    return simulator


def drive(simulator, v, w, seconds):
    """Renew a command every step; returns the number of collisions that began."""
    began = 0
    for _ in range(round(seconds / simulator.world.timestep)):
        simulator.command(v, w)
        began += simulator.step()
    return began


def test_the_way_ahead_is_free_when_hull_and_mast_reach_its_end(simulator):
    nearest = WALL_X - HULL_RADIUS - 0.25
    for x, free in ((nearest - 0.02, True), (nearest + 0.02, False)):
        simulator.place(x, 2.0, 0.0)
        assert simulator.ahead_free() is free
        simulator.place(x, 2.0, math.pi)
        assert simulator.ahead_free()


def test_a_fixed_camera_looks_down_from_the_first_moment_on():
    simulator = Simulator(World(bare_room()), tilts=(-0.5,))
    simulator.place(1.0, 1.0, 0.0)
    assert simulator.world.pose.tilt == -0.5
    drive(simulator, 0.2, 0.0, 0.5)
    assert simulator.world.pose.tilt == -0.5


def test_straight_drive_has_the_length_of_its_speed_profile(simulator):
    # 0.2 m/s for 2 s: speeding up loses what braking adds, so 0.4 m in all.
    drive(simulator, 0.2, 0.0, 2.0)
    drive(simulator, 0.0, 0.0, 0.5)
    pose = simulator.world.pose
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((1.4, 1.0, 0.0), abs=1e-3)
    assert simulator.path_length == pytest.approx(0.4, abs=1e-3)
    assert simulator.world.velocity == pytest.approx((0.0, 0.0), abs=1e-6)
    assert simulator.time == pytest.approx(2.5)


def test_turn_in_place_has_the_angle_of_its_rate(simulator):
    drive(simulator, 0.0, 1.0, 2.0)
    drive(simulator, 0.0, 0.0, 0.5)
    assert simulator.world.pose.yaw == pytest.approx(2.0, abs=1e-3)
    assert simulator.path_length == pytest.approx(0.0, abs=1e-3)


def test_robot_stops_by_itself_after_the_last_command(simulator):
    drive(simulator, 0.2, 0.0, 1.0)
    x = simulator.world.pose.x
    for _ in range(200):
        simulator.step()
    # The last command came at 0.99 s, so 0.49 s more at 0.2 m/s, then braking at 0.9 m/s^2.
    assert simulator.world.pose.x - x == pytest.approx(0.2 * 0.49 + 0.2**2 / 1.8, abs=2e-3)
    assert simulator.world.velocity == pytest.approx((0.0, 0.0), abs=1e-6)


def test_odometry_starts_at_zero_and_follows_the_truth(simulator):
    simulator.place(1.0, 1.0, math.pi / 2)
    drive(simulator, 0.2, 0.4, 2.0)
    pose, odometry = simulator.world.pose, simulator.odometry
    assert odometry.x == pytest.approx(pose.y - 1.0, abs=1e-6)
    assert odometry.y == pytest.approx(1.0 - pose.x, abs=1e-6)
    assert odometry.yaw == pytest.approx(pose.yaw - math.pi / 2, abs=1e-6)


def test_odometry_does_not_notice_being_carried(simulator):
    drive(simulator, 0.2, 0.0, 1.0)
    before = simulator.odometry.x
    simulator.place(2.0, 2.0, 1.0)
    simulator.step()
    assert simulator.odometry.x == before
    assert simulator.path_length == 0.0


def test_wall_stops_the_robot_and_is_one_collision_with_its_impact(simulator):
    simulator.place(2.0, 1.0, 0.0)
    seen = []
    for _ in range(800):
        simulator.command(0.2, 0.0)
        if simulator.step():
            seen.append((simulator.collisions.impact_speed, simulator.collisions.contacts[0]))
    assert len(seen) == simulator.collisions.count == 1
    speed, contact = seen[0]
    assert speed == pytest.approx(0.2, abs=0.005)
    assert (contact.part, contact.other) == ("hull", "Wall")
    assert contact.bearing == pytest.approx(0.0, abs=0.05)
    assert simulator.world.pose.x == pytest.approx(WALL_X - HULL_RADIUS, abs=0.01)
    assert simulator.path_length == pytest.approx(WALL_X - HULL_RADIUS - 2.0, abs=0.02)


def test_backing_off_for_longer_than_the_gap_makes_a_second_collision(simulator):
    simulator.place(2.7, 1.0, 0.0)
    assert drive(simulator, 0.2, 0.0, 1.5) == 1
    drive(simulator, -0.1, 0.0, 1.0)
    assert not simulator.collisions.contacts
    assert simulator.collisions.impact_speed == 0.0
    assert drive(simulator, 0.2, 0.0, 2.0) == 1
    assert simulator.collisions.count == 2


def test_mast_hits_what_the_hull_passes_under(simulator):
    simulator.place(1.0, 3.5, math.pi / 2)
    drive(simulator, 0.2, 0.0, 4.0)
    (contact, *_) = simulator.collisions.contacts
    assert (contact.part, contact.other) == ("mast", "Shelf")
    assert simulator.world.pose.y == pytest.approx(SHELF_Y - MAST_RADIUS, abs=0.01)


def test_contacts_closer_than_the_gap_are_one_collision():
    touch = [Touch("hull", "Wall", 0.0, 0.1)]
    collisions = Collisions()
    times = (1.0, 1.3, 1.79, 2.28, 2.78)  # the last gap is 0.5 s
    began = [collisions.update(t, touch, 0.1) for t in times]
    assert began == [True, False, False, False, True]
    assert collisions.count == 2


def test_camera_tilts_within_its_range(simulator):
    for asked, reached in ((-math.pi / 6, -math.pi / 6), (2.0, math.pi / 6), (-2.0, -math.pi / 6)):
        simulator.tilt_to(asked)
        for _ in range(200):
            simulator.step()
        assert simulator.world.pose.tilt == pytest.approx(reached, abs=0.01)
    simulator.tilt_to(math.nan)
    simulator.step()
    assert simulator.world.pose.tilt == pytest.approx(-math.pi / 6, abs=0.01)


def test_episode_account(simulator):
    drive(simulator, 0.2, 0.0, 1.0)
    simulator.start_episode("Mug", StartPose(2.6, 1.0, 0.0, 1.25, 9))
    drive(simulator, 0.2, 0.0, 2.0)
    account = simulator.end_episode()
    assert (account.goal, account.shortest_path, account.collisions) == ("Mug", 1.25, 1)
    assert account.path_length == pytest.approx(WALL_X - HULL_RADIUS - 2.6, abs=0.02)
    with pytest.raises(RuntimeError, match="No episode runs"):
        simulator.end_episode()


def test_time_and_odometry_go_on_in_another_room(simulator):
    drive(simulator, 0.2, 0.0, 1.0)
    x = simulator.odometry.x
    simulator.enter(World(bare_room()))
    assert simulator.time == pytest.approx(1.0)
    assert simulator.odometry.x == x
    assert simulator.collisions.count == 0


def test_same_commands_give_the_same_motion_to_the_last_bit():
    poses = []
    for _ in range(2):
        simulator = Simulator(World(bare_room()))
        simulator.place(2.0, 1.0, 0.3)
        drive(simulator, 0.3, 0.2, 6.0)
        poses.append((simulator.world.pose, simulator.odometry.x, simulator.collisions.count))
    assert poses[0] == poses[1]


def test_goal_distance_is_to_the_nearest_edge_of_the_footprint(simulator):
    assert simulator.goal_distance() == math.inf
    simulator.start_episode("Wall", StartPose(1.0, 1.0, 0.0, 1.0, 5))
    assert simulator.goal_distance() == pytest.approx(WALL_X - 1.0)


def test_a_camera_that_is_made_to_look_further_down_does():
    simulator = Simulator(World(bare_room()), tilts=(0.0, -0.8))
    simulator.place(1.0, 1.0, 0.0)
    simulator.tilt_to(-1.2)
    drive(simulator, 0.0, 0.0, 5.0)
    assert simulator.world.pose.tilt == pytest.approx(-0.8)
