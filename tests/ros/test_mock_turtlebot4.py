"""One mock TurtleBot 4 as a process of its own: what it sends, and how it obeys."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_interfaces.srv import EndEpisode, StartEpisode  # noqa: E402
from irobot_create_msgs.msg import HazardDetection  # noqa: E402
from irobot_create_msgs.srv import EStop  # noqa: E402
from sim_bridge.camera import Camera  # noqa: E402
from sim_bridge.room import generate_room, parse_room  # noqa: E402
from sim_bridge.world import HULL_RADIUS, Pose, World  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from std_srvs.srv import Empty, Trigger  # noqa: E402

from .mock_listener import (  # noqa: E402
    LATCHED,
    OTHER_ROOM,
    ROOM,
    TOPICS,
    Listener,
    locked_domain,
    seconds,
    start_mock,
)


@pytest.fixture(scope="module")
def domain():
    with locked_domain() as number:
        yield number


def before_a_wall():
    """A free pose that looks at a wall or a piece of furniture 3 cm ahead of the hull."""
    world = World(generate_room(*parse_room(ROOM)))
    for x in np.arange(world.room.width - HULL_RADIUS, 0.5, -0.01):
        for y in np.arange(0.4, world.room.depth - 0.4, 0.1):
            ahead = world.free(x + 0.03, y)
            if not ahead and world.sweep_free((x, y), (x - 0.6, y)):
                return float(x), float(y), 0.0
    raise AssertionError("no wall found")


@pytest.fixture(scope="module")
def start():
    x, y, yaw = before_a_wall()
    return x - 0.6, y, yaw


@pytest.fixture(scope="module")
def mock(tmp_path_factory, domain, start):
    pose = "[{:.4f}, {:.4f}, {:.4f}]".format(*start)
    log = tmp_path_factory.mktemp("mock") / "log"
    process = start_mock(log, domain, f"room:={ROOM}", f"start:={pose}", "speed:=2", "noise:=0")
    try:
        process.wait_for_line("ready")
        yield process
        assert process.interrupt() == 0, process.output
    finally:
        process.end()


@pytest.fixture(scope="module")
def robot(mock, domain):
    listener = Listener(domain)
    try:
        listener.wait_connected()
        listener.wait(lambda: len(listener.heard["scan"]) > 40, "5 s of scans")
        yield listener
    finally:
        listener.close()


def test_one_ready_line(mock):
    ready = [line for line in mock.output.splitlines() if "ready" in line]
    assert ready == [f"mock_turtlebot4 ready: room {ROOM}, goal none, 2 times real time"]


@pytest.mark.parametrize(
    ("topic", "hz"),
    [
        ("oakd/rgb/preview/image_raw", 15.0),
        ("oakd/rgb/preview/camera_info", 15.0),
        ("scan", 7.7),
        ("odom", 20.0),
        ("joint_states", 20.0),
        ("hazard_detection", 20.0),
        ("wheel_status", 20.0),
        ("dock_status", 1.0),
        ("ground_truth/state", 20.0),
    ],
)
def test_rate_by_stamps(robot, topic, hz):
    stamps = [seconds(m.header.stamp) for m in robot.heard[topic]]
    periods = np.diff(stamps)
    # A message lost on a busy machine would show as a double period; the median does not.
    assert np.all(periods >= 1 / hz - 0.0101)
    assert np.median(periods) == pytest.approx(1 / hz, abs=0.0101)
    assert periods[periods < 1.5 / hz].mean() == pytest.approx(1 / hz, rel=0.02)


def test_gyroscope_comes_as_often_as_through_the_relay(robot):
    stamps = [seconds(m.header.stamp) for m in robot.heard["imu"]]
    assert (len(stamps) - 1) / (stamps[-1] - stamps[0]) == pytest.approx(30.0, abs=2.0)


def test_clock_announces_the_time_of_every_stamp(robot):
    ticks = [seconds(m.clock) for m in robot.heard["/clock"]]
    assert np.all(np.diff(ticks) > 0)
    assert np.mean(np.diff(ticks) < 0.051) > 0.9  # a busy machine may lose a message
    known = {round(tick, 4) for tick in ticks}
    stamps = [
        seconds(m.header.stamp)
        for m in robot.heard["odom"]
        if ticks[0] < seconds(m.header.stamp) < ticks[-1]
    ]
    assert np.mean([round(stamp, 4) in known for stamp in stamps]) > 0.9


@pytest.mark.parametrize("topic", TOPICS)
def test_quality_of_service(robot, topic):
    (publisher,) = robot.node.get_publishers_info_by_topic(topic)
    qos = publisher.qos_profile
    durability = "TRANSIENT_LOCAL" if topic in LATCHED else "VOLATILE"
    truth = topic.startswith("ground_truth")
    assert publisher.node_name == ("simulator" if truth else "mock_turtlebot4")
    assert (qos.reliability.name, qos.durability.name) == ("RELIABLE", durability)


def test_commands_are_received_best_effort(robot):
    kinds = {"cmd_vel": "TwistStamped", "cmd_vel_unstamped": "Twist"}
    for topic, kind in kinds.items():
        (subscriber,) = robot.node.get_subscriptions_info_by_topic(topic)
        assert subscriber.topic_type == f"geometry_msgs/msg/{kind}"
        assert subscriber.qos_profile.reliability.name == "BEST_EFFORT"


def test_picture_is_what_the_oakd_sends(robot):
    image, info = (
        robot.last("oakd/rgb/preview/image_raw"),
        robot.last("oakd/rgb/preview/camera_info"),
    )
    assert (image.encoding, image.is_bigendian, image.step) == ("bgr8", 1, 900)
    assert (image.height, image.width) == (info.height, info.width) == (300, 300)
    assert image.header.frame_id == info.header.frame_id == "oakd_rgb_camera_optical_frame"
    bgr = np.frombuffer(image.data, np.uint8).reshape(300, 300, 3)
    truth = robot.last("ground_truth/state")
    with Camera(World(generate_room(*parse_room(ROOM)))) as camera:
        rgb = camera.rgb(Pose(truth.x, truth.y, truth.yaw, truth.tilt))
    assert np.abs(bgr[..., ::-1].astype(int) - rgb).mean() < 1
    assert rgb.std() > 10
    # 90 degrees: half the picture's width spans 45 degrees.
    assert 2 * math.atan(info.width / 2 / info.k[0]) == pytest.approx(math.pi / 2)


def test_scan_is_what_the_a1m8_driver_sends(robot, start):
    scan = robot.last("scan")
    ranges = np.array(scan.ranges)
    assert scan.header.frame_id == "rplidar_link"
    assert ranges.shape == (1080,)
    assert (scan.angle_min, scan.angle_max) == pytest.approx((-3.12414, 3.14159), abs=1e-4)
    assert scan.angle_increment == pytest.approx((scan.angle_max - scan.angle_min) / 1079)
    assert (scan.range_min, scan.range_max) == pytest.approx((0.15, 12.0))
    triples = ranges.reshape(360, 3)
    assert np.array_equal(triples[:, 0], triples[:, 1])
    assert np.array_equal(triples[:, 0], triples[:, 2])
    assert np.isinf(ranges).any()
    assert np.isfinite(ranges).mean() > 0.5
    world = World(generate_room(*parse_room(ROOM)))
    world.reset(*start)
    assert world.free(*start[:2])
    forward = ranges[round((-math.pi / 2 - scan.angle_min) / scan.angle_increment)]
    assert forward == pytest.approx(world.scan()[0], abs=0.02)


def test_frames_join_sensors_to_odometry(robot):
    poses = {}
    for topic in ("tf_static", "tf"):
        for transform in robot.last(topic).transforms:
            poses[transform.child_frame_id] = transform
    parents = {child: t.header.frame_id for child, t in poses.items()}
    assert parents["base_footprint"] == parents["base_link"] == "odom"

    def chain(frame):
        return [frame, *(chain(parents[frame]) if frame in parents else [])]

    assert chain("rplidar_link") == ["rplidar_link", "shell_link", "base_link", "odom"]
    assert chain("oakd_rgb_camera_optical_frame")[-2:] == ["base_link", "odom"]
    lidar, shell = poses["rplidar_link"].transform, poses["shell_link"].transform
    assert lidar.translation.z + shell.translation.z == pytest.approx(0.193)
    assert lidar.translation.x == pytest.approx(-0.04)
    assert 2 * math.atan2(lidar.rotation.z, lidar.rotation.w) == pytest.approx(math.pi / 2)
    assert poses["oakd_link"].transform.translation.z == pytest.approx(1.3)


def test_map_covers_the_room(robot):
    room, grid = generate_room(*parse_room(ROOM)), robot.last("ground_truth/map")
    assert grid.header.frame_id == "room"
    assert grid.info.resolution == pytest.approx(0.02)
    assert grid.info.width * 0.02 == pytest.approx(room.width, abs=0.02)
    assert grid.info.height * 0.02 == pytest.approx(room.depth, abs=0.02)
    assert set(grid.data) == {0, 100}


@pytest.mark.parametrize("unstamped", [False, True])
def test_command_turns_the_robot_and_expires(robot, unstamped):
    def yaw():
        rotation = robot.last("odom").pose.pose.orientation
        return 2 * math.atan2(rotation.z, rotation.w)

    before = yaw()
    rate = 0.3 if unstamped else -0.3
    turned = math.copysign(1.0, rate)
    asked_last = robot.drive(0.0, rate, lambda: turned * (yaw() - before) > 0.15, "turn", unstamped)
    robot.wait_rest()
    # 0.5 s to expire; on a busy machine the last command is under way for some time.
    assert 0.5 <= robot.odometry_time() - asked_last < 5.0
    assert turned * (yaw() - before) > 0.15 + 0.1


def test_camera_tilts(robot):
    for asked in (-math.pi / 6, 0.0):
        robot.tilt.publish(Float64(data=asked))

        def reached(asked=asked):
            return abs(robot.last("joint_states").position[0] - asked) < 0.01

        robot.wait(reached, "the tilt")
        assert robot.last("joint_states").name == ["camera_tilt"]
        (camera,) = (t for t in robot.last("tf").transforms if t.child_frame_id == "oakd_link")
        pitch = 2 * math.atan2(camera.transform.rotation.y, camera.transform.rotation.w)
        assert pitch == pytest.approx(-asked, abs=0.1)


def test_bump_is_reported_counted_and_backed_off_from(robot, start):
    robot.drive(0.2, 0.0, robot.bumps, "a bump hazard")
    assert all(zone.startswith("bump_") for zone in robot.bumps())
    robot.wait(lambda: robot.last("ground_truth/state").v < -0.1, "the reflex")
    robot.wait_rest()
    truth = robot.last("ground_truth/state")
    assert truth.collisions == 1
    assert not truth.in_contact
    onset = next(m for m in robot.heard["ground_truth/state"] if m.in_contact)
    assert onset.contact_with
    assert onset.impact_speed == pytest.approx(0.2, abs=0.02)
    assert math.dist((onset.x, onset.y), start[:2]) > 0.3
    assert 0.05 <= math.dist((onset.x, onset.y), (truth.x, truth.y)) < 0.1


def test_backup_limit_is_a_hazard_until_the_robot_drives_forward(robot, start):
    assert robot.call(StartEpisode, room=ROOM, start=start).ok

    def limited():
        return [h.type for h in robot.last("hazard_detection").detections]

    robot.wait(lambda: limited() == [HazardDetection.BACKUP_LIMIT], "the limit")
    robot.drive(0.2, 0.0, lambda: limited() == [], "the limit's end")
    robot.wait_rest()


def test_e_stop_is_obeyed_although_the_answer_is_the_relays_default(robot, start):
    assert robot.call(StartEpisode, room=ROOM, start=start).ok
    robot.drive(0.0, 0.5, lambda: robot.last("ground_truth/state").w > 0.4, "a turn")
    for on in (True, False):
        answer = robot.call(EStop, e_stop_on=on)
        assert (answer.success, answer.message) == (False, "")
        robot.wait(lambda on=on: robot.last("wheel_status").wheels_enabled != on, "the wheels")
        wanted = (
            (lambda: robot.last("ground_truth/state").still_since)
            if on
            else (lambda: robot.last("ground_truth/state").w > 0.4)
        )
        robot.drive(0.0, 0.5, wanted, "stop and go")
    robot.wait_rest()


@pytest.mark.parametrize(
    ("topic", "off", "on"),
    [
        ("scan", (Empty, "stop_motor"), (Empty, "start_motor")),
        (
            "oakd/rgb/preview/image_raw",
            (Trigger, "oakd/stop_camera"),
            (Trigger, "oakd/start_camera"),
        ),
    ],
)
def test_sensors_stop_and_start_on_demand(robot, topic, off, on):
    answer = robot.ask(*off)
    assert getattr(answer, "success", True)
    robot.wait_for(1.0)
    count = len(robot.heard[topic])
    robot.wait_for(1.0)
    assert len(robot.heard[topic]) == count
    assert getattr(robot.ask(*on), "success", True)
    robot.wait(lambda: len(robot.heard[topic]) > count + 3, topic)


def test_base_tells_of_dock_battery_and_gyroscope(robot):
    assert not robot.last("dock_status").is_docked
    assert 0 < robot.last("battery_state").percentage <= 1
    robot.drive(0.0, 0.5, lambda: robot.last("imu").angular_velocity.z > 0.4, "the gyroscope")
    robot.wait_rest()
    yaw = robot.last("imu").orientation
    assert 2 * math.atan2(yaw.z, yaw.w) == pytest.approx(
        2 * math.atan2(*(getattr(robot.last("odom").pose.pose.orientation, k) for k in "zw")),
        abs=0.01,
    )


def test_episode_of_its_own_room_and_of_another(robot):
    for room in (ROOM, OTHER_ROOM):
        for goal in generate_room(*parse_room(room)).goals:
            answer = robot.call(StartEpisode, room=room, goal=goal, seed=3)
            if answer.ok:
                break
        assert answer.ok, answer.message
        assert answer.shortest_actions >= 6
        robot.wait(lambda goal=goal: robot.last("ground_truth/state").goal == goal, "the episode")
        truth = robot.last("ground_truth/state")
        assert (truth.room, truth.collisions, truth.goal_visible) == (room, 0, False)
        assert (truth.x, truth.y) == pytest.approx((answer.x, answer.y), abs=1e-3)
        assert truth.shortest_path == pytest.approx(answer.shortest_path)
        turned = robot.now() + 1.0
        robot.drive(0.0, 1.0, lambda t=turned: robot.now() > t, "a turn")
        account = robot.call(EndEpisode)
        assert account.ok
        assert account.path_length == pytest.approx(0.0, abs=0.01)
        assert account.shortest_path == pytest.approx(answer.shortest_path)
    assert len(robot.heard["ground_truth/map"]) == 2
    answer = robot.call(EndEpisode)
    assert not answer.ok
    assert "No episode runs" in answer.message


def test_start_at_a_pose_with_and_without_a_goal(robot, start):
    goal = generate_room(*parse_room(ROOM)).goals[0]
    for wanted in ("", goal):
        answer = robot.call(StartEpisode, room=ROOM, goal=wanted, seed=3, start=start)
        assert answer.ok, answer.message
        assert (answer.x, answer.y, answer.yaw) == pytest.approx(start)
        assert bool(answer.shortest_actions) == bool(wanted)
        began = len(robot.heard["ground_truth/state"])
        robot.wait(lambda n=began + 2: len(robot.heard["ground_truth/state"]) > n, "two states")
        truth = robot.last("ground_truth/state")
        assert (truth.goal, truth.collisions) == (wanted, 0)
        assert (truth.x, truth.y, truth.yaw) == pytest.approx(start, abs=1e-3)
    assert robot.call(EndEpisode).ok


def test_truth_tells_velocity_and_standstill(robot, start):
    assert robot.call(StartEpisode, room=ROOM, start=start).ok
    robot.drive(0.0, 0.5, lambda: robot.last("ground_truth/state").w > 0.45, "a turn")
    assert robot.last("ground_truth/state").still_since == 0.0
    robot.wait_rest()
    robot.wait(lambda: robot.last("ground_truth/state").still_since, "standstill")
    truth = robot.last("ground_truth/state")
    assert (truth.v, truth.w) == pytest.approx((0.0, 0.0), abs=0.01)
    turning = [m for m in robot.heard["ground_truth/state"] if abs(m.w) > 0.05]
    assert seconds(turning[-1].header.stamp) < truth.still_since <= seconds(truth.header.stamp)


@pytest.mark.parametrize(
    ("room", "goal", "pose", "words"),
    [
        (OTHER_ROOM, "Television", [], "it has"),
        ("cellar:1", "Mug", [], "kitchen"),
        (ROOM, "", [], "'' is no known category"),
        (ROOM, "", [1.0, 1.0], "expected [x, y, yaw]"),
        (OTHER_ROOM, "", [0.0, 0.0, 0.0], "is not free"),
        (ROOM, "", [math.nan, 1.0, 0.0], "expected [x, y, yaw]"),
    ],
)
def test_episode_that_cannot_start_says_why(robot, room, goal, pose, words):
    before = robot.last("ground_truth/state")
    answer = robot.call(StartEpisode, room=room, goal=goal, seed=3, start=pose)
    assert not answer.ok
    assert words in answer.message
    robot.wait(lambda: robot.last("ground_truth/state") is not before, "the next state")
    assert robot.last("ground_truth/state").room == before.room


def test_second_robot_in_the_domain_is_refused(robot, domain, tmp_path):
    second = start_mock(tmp_path / "log", domain)
    try:
        robot.wait(lambda: second.process.poll() is not None, "the second to give up")
    finally:
        second.end()
    assert second.process.returncode == 2
    assert "choose another ROS_DOMAIN_ID" in second.output
