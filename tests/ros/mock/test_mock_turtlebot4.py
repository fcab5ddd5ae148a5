"""One mock TurtleBot 4 as a process of its own: what it sends, and how it obeys."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_interfaces.srv import StartEpisode  # noqa: E402
from cfnav_ros.process.domains import Domain  # noqa: E402
from irobot_create_msgs.msg import HazardDetection, HazardDetectionVector  # noqa: E402
from irobot_create_msgs.srv import EStop  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sim_bridge.room.room import generate_room, parse_room  # noqa: E402
from sim_bridge.world.camera import Camera  # noqa: E402
from sim_bridge.world.world import Pose, World  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402
from std_srvs.srv import Empty, Trigger  # noqa: E402

from tests.ros.mock_listener import (  # noqa: E402
    LATCHED,
    ROOM,
    TOPICS,
    Listener,
    before_a_wall,
    seconds,
    start_mock,
)

IMAGE, INFO = "oakd/rgb/preview/image_raw", "oakd/rgb/preview/camera_info"


@pytest.fixture(scope="module")
def domain():
    with Domain() as number:
        yield number


@pytest.fixture(scope="module")
def start():
    return before_a_wall()


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
        (IMAGE, 15.0),
        (INFO, 15.0),
        ("scan", 7.7),
        ("odom", 20.0),
        ("joint_states", 20.0),
        ("wheel_status", 20.0),
        ("dock_status", 1.0),
        ("ground_truth/state", 20.0),
    ],
)
def test_rate_by_stamps(robot, topic, hz):
    times, sent = np.diff(robot.stamps(topic)), np.diff(robot.numbers[topic])
    # By the numbers under which they were sent: a busy machine may lose some on the way.
    assert np.all(abs(times - sent / hz) <= 0.0101)
    assert times.sum() / sent.sum() == pytest.approx(1 / hz, rel=0.02)


def test_gyroscope_comes_as_often_as_through_the_relay(robot):
    stamps, numbers = robot.stamps("imu"), robot.numbers["imu"]
    rate = (numbers[-1] - numbers[0]) / (stamps[-1] - stamps[0])
    assert rate == pytest.approx(30.0, abs=2.0)


def test_clock_announces_the_time_of_every_stamp(robot):
    ticks = [seconds(m.clock) for m in robot.heard["/clock"]]
    assert np.all(np.diff(ticks) > 0)
    # What comes before a tick that was lost on a busy machine cannot be judged.
    whole = np.diff(robot.numbers["/clock"]) == 1
    assert whole.mean() > 0.1
    assert np.all(np.diff(ticks)[whole] < 0.051)
    stamps = np.array(robot.stamps("odom"))
    stamps = stamps[(ticks[0] < stamps) & (stamps < ticks[-1])]
    before = np.searchsorted(ticks, stamps + 1e-4) - 1
    assert np.all((stamps - np.array(ticks)[before])[whole[before]] < 1e-4)


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
    image, info = robot.last(IMAGE), robot.last(INFO)
    assert (image.encoding, image.is_bigendian, image.step) == ("bgr8", 1, 900)
    assert (image.height, image.width) == (info.height, info.width) == (300, 300)
    assert image.header.frame_id == info.header.frame_id == "oakd_rgb_camera_optical_frame"
    bgr = np.frombuffer(image.data, np.uint8).reshape(300, 300, 3)
    truth = robot.truth
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
    # 1034 samples: nearly each bin is one's own
    assert 0.8 < np.mean(np.diff(ranges[np.isfinite(ranges)]) != 0) < 0.99
    assert np.isinf(ranges).any()
    assert np.isfinite(ranges).mean() > 0.5
    world = World(generate_room(*parse_room(ROOM)))
    world.reset(*start)
    assert world.free(*start[:2])
    forward = ranges[round((-math.pi / 2 - scan.angle_min) / scan.angle_increment)]
    assert forward == pytest.approx(world.scan(np.zeros(1))[0], abs=0.02)


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
    robot.drive(0.0, rate, lambda: turned * (yaw() - before) > 0.15, "turn", unstamped)
    # Nobody tells it to stand. After how long it does is a test of its base: commands are sent as
    # best effort, and a busy machine may lose the last or deliver it late.
    robot.wait_rest()
    assert turned * (yaw() - before) > 0.15


def test_camera_tilts(robot):
    for asked in (-math.pi / 6, 0.0):
        robot.tilt.publish(Float64(data=asked))

        def reached(asked=asked):
            (camera,) = (t for t in robot.last("tf").transforms if t.child_frame_id == "oakd_link")
            pitch = 2 * math.atan2(camera.transform.rotation.y, camera.transform.rotation.w)
            tilt = robot.last("joint_states").position[0]
            return abs(tilt - asked) < 0.01 and abs(pitch + asked) < 0.01

        robot.wait(reached, "the tilt")
        assert robot.last("joint_states").name == ["camera_tilt"]


def test_bump_is_reported_counted_and_backed_off_from(robot, start):
    # Turns before this test end anywhere on a busy machine.
    assert robot.call(StartEpisode, room=ROOM, start=start).ok
    truths = robot.heard["ground_truth/state"]
    began = len(truths)
    robot.drive(0.2, 0.0, robot.bumps, "a bump hazard")
    assert all(zone.startswith("bump_") for zone in robot.bumps())
    robot.wait(lambda: any(m.v < -0.1 for m in truths[began:]), "the reflex")
    robot.wait_rest()
    # Up to the end of the reflex: who hears late of the bump has driven on, into the next.
    pairs = itertools.pairwise(truths[began:])
    before, onset = next((a, b) for a, b in pairs if b.in_contact)
    assert next(b for _, b in pairs if b.v < -0.1).collisions == 1
    truth = next(b for _, b in pairs if b.v > -0.01)
    assert truth.collisions == 1
    assert not truth.in_contact
    assert onset.contact_with
    assert onset.impact_speed == pytest.approx(before.v, abs=0.02)
    assert math.dist((onset.x, onset.y), start[:2]) > 0.3
    assert 0.05 <= math.dist((onset.x, onset.y), (truth.x, truth.y)) < 0.1


def test_hazards_are_told_when_they_change_and_to_those_who_come_later(robot, start):
    heard = robot.heard["hazard_detection"]
    before = len(heard)
    assert robot.call(StartEpisode, room=ROOM, start=start).ok
    robot.wait_for(1.0)
    told = [
        [(h.type, h.header.frame_id) for h in message.detections]
        for message in list(heard)[max(before - 1, 0) :]
    ]
    repeated = sum(one == other for one, other in itertools.pairwise(told))
    assert repeated <= 1  # where it is put down anew, all is told again
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    late = []
    robot.node.create_subscription(HazardDetectionVector, "hazard_detection", late.append, qos)
    robot.wait(lambda: late, "what was told last")


def test_backup_limit_is_a_hazard_until_the_robot_drives_forward(robot, start):
    assert robot.call(StartEpisode, room=ROOM, start=start).ok

    def limited():
        return [h.type for h in robot.last("hazard_detection").detections]

    robot.wait(lambda: limited() == [HazardDetection.BACKUP_LIMIT], "the limit")
    robot.drive(0.2, 0.0, lambda: limited() == [], "the limit's end")
    robot.wait_rest()


def test_e_stop_is_obeyed_although_the_answer_is_the_relays_default(robot, start):
    assert robot.call(StartEpisode, room=ROOM, start=start).ok
    robot.drive(0.0, 0.5, lambda: robot.truth.w > 0.4, "a turn")
    for on in (True, False):
        answer = robot.call(EStop, e_stop_on=on)
        assert (answer.success, answer.message) == (False, "")
        robot.wait(lambda on=on: robot.last("wheel_status").wheels_enabled != on, "the wheels")

        def obeyed(on=on):
            return robot.truth.still_since if on else robot.truth.w > 0.4

        robot.drive(0.0, 0.5, obeyed, "stop and go")
    robot.wait_rest()


@pytest.mark.parametrize(
    ("topic", "off", "on"),
    [
        ("scan", (Empty, "stop_motor"), (Empty, "start_motor")),
        (IMAGE, (Trigger, "oakd/stop_camera"), (Trigger, "oakd/start_camera")),
    ],
)
def test_sensors_stop_and_start_on_demand(robot, topic, off, on):
    answer = robot.ask(*off)
    assert getattr(answer, "success", True)

    def silence():
        return robot.truth_time() - seconds(robot.last(topic).header.stamp)

    robot.wait(lambda: silence() > 3.0, "silence")
    assert getattr(robot.ask(*on), "success", True)
    count = len(robot.heard[topic])
    robot.wait(lambda: len(robot.heard[topic]) > count + 3, topic)
    # More may have been on the way when silence seemed to have begun.
    assert np.diff(robot.stamps(topic)[count - 1 :]).max() > 2.5


def test_base_tells_of_dock_battery_and_gyroscope(robot):
    assert not robot.last("dock_status").is_docked
    assert 0 < robot.last("battery_state").percentage <= 1
    robot.drive(0.0, 0.5, lambda: robot.last("imu").angular_velocity.z > 0.4, "the gyroscope")
    robot.wait_rest()
    still_since = robot.truth.still_since
    robot.wait(lambda: robot.stamps("imu")[-1] > still_since, "the gyroscope at rest")
    yaw = robot.last("imu").orientation
    assert 2 * math.atan2(yaw.z, yaw.w) == pytest.approx(
        2 * math.atan2(*(getattr(robot.last("odom").pose.pose.orientation, k) for k in "zw")),
        abs=0.01,
    )
