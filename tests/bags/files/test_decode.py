"""Every kind of message as its event; those that make no sense as one sentence."""

from __future__ import annotations

import math
import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from cfnav_ros.bags.files import events as e
from cfnav_ros.bags.files.decode import WITH_EVENTS, decode
from cfnav_ros.bags.files.message_types import MessageTypes
from cfnav_ros.bags.files.roles import ROLES
from cfnav_ros.bags.files.storage import BagTopic, Notes

from cfnav_core.task.actions import Action
from studies.bags import bag_files as b

S, LOG = b.S, 12_345
STAMP = 7 * S + 5


def event_of(role: str, message, kind: int = 0, **how):
    """The event of a message that is written and read again."""
    name = ROLES[role].types[kind]
    text, _ = b.STORE.generate_msgdef(name, ros_version=2)
    topic = BagTopic(f"/{role}", name, None, text, "ros2msg")
    read = MessageTypes(Notes()).reader(topic)
    cdr = how.pop("cdr", None) or bytes(b.STORE.serialize_cdr(message, name))
    event = decode(role, topic, LOG, cdr, read, **how)
    if event is not None:
        assert (event.log_ns, event.topic) == (LOG, f"/{role}")
    return event


def about(role: str):
    return {"t_ns": STAMP, "log_ns": LOG, "topic": f"/{role}"}


def test_every_role_has_events():
    assert set(ROLES) == WITH_EVENTS


def test_detections_with_places():
    """A box in pixels, and how far the thing is, as depthai fills Detection3DArray."""
    kinds, xyz = "vision_msgs/msg/", {"x": 20.0, "y": 30.0, "z": 0.0}
    place = b.make("geometry_msgs/msg/Point", x=0.1, y=0.2, z=1.5)
    pose = b.make("geometry_msgs/msg/PoseWithCovariance", pose=b.make(
        "geometry_msgs/msg/Pose", position=place
    ))  # fmt: skip
    said = b.make(f"{kinds}ObjectHypothesis", class_id="41", score=0.75)
    box = b.make(
        f"{kinds}BoundingBox3D", size=b.make("geometry_msgs/msg/Vector3", x=10.0, y=20.0, z=0.0),
        center=b.make("geometry_msgs/msg/Pose", position=b.make("geometry_msgs/msg/Point", **xyz)),
    )  # fmt: skip
    one = b.make(f"{kinds}Detection3D", bbox=box, results=[
        b.make(f"{kinds}ObjectHypothesisWithPose", hypothesis=said, pose=pose)
    ])  # fmt: skip
    message = b.make(f"{kinds}Detection3DArray", header=b.header(STAMP), detections=[one])
    kind = ROLES["detections"].types.index("vision_msgs/msg/Detection3DArray")
    (claim,) = event_of("detections", message, kind).claims
    assert (claim.class_id, claim.score, claim.depth) == ("41", 0.75, 1.5)
    assert claim.box == (15.0, 20.0, 25.0, 40.0)


def test_plain_events():
    assert event_of("cmd_vel", b.command(STAMP, 0.3)) == e.Velocity(
        v=0.3, w=0.0, **about("cmd_vel")
    )
    assert event_of("joint_states", b.joints(STAMP, -0.5)) == e.Joint(
        angle=-0.5, **about("joint_states")
    )
    assert event_of("clock", b.make("rosgraph_msgs/msg/Clock", clock=b.stamp(STAMP))) == e.Tick(
        **about("clock")
    )
    assert event_of("hazards", b.hazards(STAMP, "bump_left", "")) == e.Bumps(
        zones=("bump_left", ""), **about("hazards")
    )
    assert event_of("hazards", b.hazards(STAMP)) == e.Bumps(zones=(), **about("hazards"))
    assert event_of("episode", b.status(STAMP, 1)) == e.Told(
        started=False,
        goal="Laptop",
        bundle="demo",
        outcome="success",
        message="",
        **about("episode"),
    )
    pose = event_of("odom", b.odometry(STAMP, 1.0, yaw=3.0))
    assert pose == e.Pose(
        x=1.0, y=0.5, yaw=pytest.approx(3.0), v=0.2, w=0.1, frames="odom to base_link",
        **about("odom"),
    )  # fmt: skip


def test_events_with_arrays():
    made = event_of("decision", b.decision(STAMP, 2))
    assert (made.action, made.step, made.goal) == (Action.RotateRight, 2, "Laptop")
    assert (made.image_ns, made.estimate_ns) == (STAMP - S // 10, STAMP - S // 20)
    assert made.probabilities.tolist() == pytest.approx([1 / 6] * 6)
    turn = event_of("scan", b.scan(STAMP, 0.5))
    assert turn.scan.ranges.dtype == np.float32
    assert turn.scan.ranges[[0, -1]].tolist() == [0.5, 2.5]
    assert (turn.scan.frame, turn.scan.scan_time, turn.t_ns) == ("rplidar_link", 0.125, STAMP)
    judged = event_of("estimate", b.estimate(STAMP, 0.25)).estimate
    assert (judged.probability, judged.clearance, judged.verdict) == (0.25, 0.5, 1)
    ((parent, child, at, q),) = event_of("tf", b.frames(STAMP, "oakd_link")).transforms
    assert (parent, child, at) == ("base_link", "oakd_link", (0.1, 0.0, 0.2))
    assert q == pytest.approx((0.0, 0.0, math.sin(0.25), math.cos(0.25)))
    room = event_of("map", b.grid(STAMP))
    assert room.occupied.tolist() == [[True] * 5, *[[False] * 5] * 3]
    assert (room.resolution, room.origin) == (pytest.approx(0.02), (-1.0, -2.0))
    sample = event_of("truth", b.truth(STAMP, 1.5))
    assert (sample.x, sample.room, sample.shortest_path, sample.t_ns) == (
        1.5,
        "kitchen:25",
        2.0,
        STAMP,
    )


def test_a_message_without_a_stamp_has_its_log_time():
    assert event_of("cmd_vel", b.twist(0.1, 0.2), kind=1).t_ns == LOG
    assert event_of("cmd_vel", b.command(0, 0.1)).t_ns == LOG


def test_a_joint_message_about_the_wheels_says_nothing():
    message = b.joints(STAMP, 0.1, name="arm")
    assert event_of("joint_states", message) is None
    assert event_of("joint_states", message, tilt_joint="arm").angle == 0.1


def test_a_picture_costs_no_copy_and_is_decoded_on_demand():
    message = b.image(STAMP, 3)
    picture = event_of("image", message)
    assert np.array_equal(picture.data, message.data)
    assert picture.data.base is not None
    expected = message.data.reshape(24, 24, 3)[:, :, ::-1]
    assert np.array_equal(picture.decode(), expected)


def test_pictures_read_at_far_more_than_twenty_times_real_time():
    name = "sensor_msgs/msg/Image"
    cdr = bytes(b.STORE.serialize_cdr(b.image(STAMP, side=300), name))
    text, _ = b.STORE.generate_msgdef(name, ros_version=2)
    topic = BagTopic("/image", name, None, text, "ros2msg")
    read = MessageTypes(Notes()).reader(topic)
    began = time.process_time()
    for _ in range(300):
        decode("image", topic, LOG, cdr, read)
    assert time.process_time() - began < 0.3  # 15 Hz at twenty times real time: 1 s


def test_compressed_pictures_are_decoded_on_demand():
    from tests.bags.files.test_pictures import packed

    rgb = np.random.default_rng(0).integers(0, 256, (16, 16, 3), np.uint8)
    data = np.frombuffer(packed(rgb, "PNG"), np.uint8)
    message = b.make(
        "sensor_msgs/msg/CompressedImage", header=b.header(STAMP), format="png", data=data
    )
    assert np.array_equal(event_of("image", message, kind=1).decode(), rgb)
    broken = event_of("image", replace(message, data=data[: len(data) // 2]), kind=1)
    with pytest.raises(ValueError, match="cannot be read"):
        broken.decode()
    assert (
        "expected JPEG or PNG" in event_of("image", replace(message, data=data[8:]), kind=1).reason
    )


def with_pose(x=1.0, w=1.0):
    message = b.odometry(STAMP, x)
    message.pose.pose.orientation.w = w
    return message


def changed(message, **fields):
    return replace(message, **fields)


def test_cells_of_a_map_are_occupied_from_65_percent():
    cells = np.array([-1, 0, 1, 10, 64, 65, 100, *[0] * 13], np.int8)
    room = event_of("map", changed(b.grid(STAMP), data=cells))
    assert np.flatnonzero(room.occupied).tolist() == [5, 6]


@pytest.mark.parametrize(
    ("role", "message", "sentence"),
    [
        ("odom", with_pose(x=math.nan), "not finite"),
        ("odom", with_pose(x=math.inf), "not finite"),
        ("odom", with_pose(w=0.0), "quaternion of length 0, expected 1"),
        ("odom", with_pose(w=1e200), "quaternion"),
        ("cmd_vel", b.command(STAMP, math.nan), "not finite"),
        ("image", b.image(STAMP, encoding="16UC1"), "encoded as '16UC1'"),
        ("image", changed(b.image(STAMP), height=2**31, width=2**31), "expected 1 to"),
        ("image", changed(b.image(STAMP), height=25), "holds 1728 bytes, expected 1800"),
        ("decision", changed(b.decision(STAMP, 1), action=6), "action 6, expected 0 to 5"),
        ("decision", changed(b.decision(STAMP, 1), detection_score=math.nan), "not finite"),
        ("episode", b.status(STAMP, 2), "phase is 2"),
        ("estimate", b.estimate(STAMP, 1.5), "is 1.5, expected 0 to 1"),
        ("estimate", changed(b.estimate(STAMP, 0.5), verdict=9), "9 is not a valid Verdict"),
        ("truth", b.truth(STAMP, math.nan), "not finite"),
        ("map", b.grid(STAMP, yaw=0.3), "turned by 0.300 rad"),
        ("map", changed(b.grid(STAMP), data=np.zeros(7, np.int8)), "says 5x4 and holds 7 cells"),
    ],
)
def test_a_message_that_makes_no_sense_says_why(role, message, sentence):
    event = event_of(role, message)
    assert isinstance(event, e.Unreadable)
    assert sentence in event.reason
    assert "\n" not in event.reason


@pytest.mark.parametrize(("sec", "nanosec"), [(-1, 0), (5, 1_000_000_000)])
def test_a_stamp_that_is_no_time_says_so(sec, nanosec):
    message = b.command(STAMP, 0.1)
    message.header.stamp = b.make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    event = event_of("cmd_vel", message)
    assert (type(event), event.t_ns) == (e.Unreadable, LOG)
    assert "which is no time" in event.reason


@pytest.mark.parametrize("role", sorted(WITH_EVENTS))
def test_damaged_bytes_of_every_kind_neither_raise_nor_fill_the_memory(role):
    name = ROLES[role].types[0]
    message = next(m for m in b.drive(1.0) if m.type == name)
    rng = np.random.default_rng(0)
    tracemalloc.start()
    for n in range(300):
        cdr = bytearray(message.cdr)
        for at in rng.integers(0, len(cdr), rng.integers(1, 4)):
            cdr[at] = rng.choice([0, 1, 127, 255, rng.integers(256)])
        if n % 3 == 0:
            cdr = cdr[: rng.integers(0, len(cdr))]
        event = event_of(role, None, cdr=bytes(cdr) or b"\0")
        assert event is None or isinstance(event, e.Event)
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


def test_a_type_that_lacks_a_field_says_so():
    name = "geometry_msgs/msg/Twist"
    topic = BagTopic("/cmd_vel", name, None, "float64 x\n", "ros2msg")
    notes = Notes()
    read = MessageTypes(notes).reader(topic)
    event = decode("cmd_vel", topic, LOG, b"\0\1\0\0" + bytes(8), read)
    assert isinstance(event, e.Unreadable)
    assert "is no geometry_msgs/msg/Twist" in event.reason
    assert list(notes) == [
        "The messages of /cmd_vel have other fields than geometry_msgs/msg/Twist of ROS 2 Jazzy."
    ]
