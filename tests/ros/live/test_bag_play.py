"""A recorded drive played into a real graph: the real LiDAR node judges it anew, no robot hears."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.roles import assign
from cfnav_ros.bags.files.sources import SENSORS
from cfnav_ros.bags.replay.estimates import Estimates
from cfnav_ros.drive.fields import estimate_from_message
from cfnav_ros.lidar.estimate import Estimate, Verdict
from rosbags.rosbag2 import Writer

from cfnav_core.robot.topics import TOPICS
from studies.bags import bag_files as files
from studies.bags.bag_files import STORE, ZERO_NS, Message, S, make
from tests.bags.files.test_playing import profile
from tests.conftest import RunningProcess
from tests.ros.lidar_scans import TURN_S, behind_posts, noisy, scan_of, wall_ahead

pytestmark = pytest.mark.ros

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_interfaces.msg import CollisionEstimate  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import Image, LaserScan  # noqa: E402
from tf2_msgs.msg import TFMessage  # noqa: E402

from tests.ros.own_node import OwnNode  # noqa: E402

PLAYER = ("cfnav.cli", "bag", "play")
SCAN, ODOM = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"
TURN_NS = round(TURN_S * 1e9)
TURNS = 30


def turn(number: int) -> Message:
    """A turn of the scanner on the way to a wall; it is recorded when it is over."""
    stamp = ZERO_NS + S // 2 + number * TURN_NS
    seen = noisy(
        behind_posts(scan_of(wall_ahead(1.2 - 0.03 * number))), np.random.default_rng(number)
    )
    message = make(
        SCAN,
        header=files.header(stamp, seen.frame),
        angle_min=seen.angle_min,
        angle_max=seen.angle_max,
        angle_increment=seen.angle_increment,
        time_increment=0.0,
        scan_time=seen.scan_time,
        range_min=seen.range_min,
        range_max=seen.range_max,
        ranges=seen.ranges,
        intensities=np.zeros(0, np.float32),
    )
    return Message("/scan", SCAN, stamp + TURN_NS, message)


def mounting() -> Message:
    """Where the LiDAR is on this robot, two centimetres from where the parameters have it."""
    half = math.pi / 4
    rotation = make(
        "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
    )
    stamped = make(
        "geometry_msgs/msg/TransformStamped",
        header=files.header(ZERO_NS),
        child_frame_id="rplidar_link",
        transform=make(
            "geometry_msgs/msg/Transform",
            translation=files.vector(-0.02, 0.0, 0.19),
            rotation=rotation,
        ),
    )
    kind = "tf2_msgs/msg/TFMessage"
    return Message("/tf_static", kind, ZERO_NS, make(kind, transforms=[stamped]))


def drive() -> list[Message]:
    """A drive of a few seconds with every topic, in the order of its log times."""
    other = [m for m in files.drive(4.5) if m.topic not in ("/clock", "/scan", "/tf_static")]
    return sorted([mounting(), *map(turn, range(TURNS)), *other], key=lambda m: m.log_ns)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return files.write(tmp_path / "bag", drive())


class Listener(OwnNode):
    """A node of the domain that keeps what it hears."""

    def __init__(self, domain: int) -> None:
        super().__init__(domain, "listener")
        self.heard: dict[str, list] = {}

    def listen(self, kind: type, name: str, latched: bool = False, raw: bool = True) -> None:
        self.heard[name] = []
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=1000, durability=durability)
        self.node.create_subscription(kind, name, self.heard[name].append, qos, raw=raw)


@pytest.fixture
def listener(ros_domain_id: int) -> Iterator[Listener]:
    listener = Listener(ros_domain_id)
    yield listener
    listener.close()


@pytest.fixture
def play(start_process: Callable, ros_domain_id: int) -> Callable[..., RunningProcess]:
    """A function: bag, options -> the player, started from a shell with another domain."""

    def start(bag: Path, *options: str) -> RunningProcess:
        words = ("--domain", str(ros_domain_id), *options)
        return start_process(*PLAYER, str(bag), *words, ROS_DOMAIN_ID="0")

    return start


def told(estimate: Estimate) -> tuple:
    """What the live message and the replay both hold."""
    e = estimate
    return e.probability, e.clearance, e.verdict, e.reason, e.known_fraction


def replayed(bag: Path) -> dict[int, Estimate]:
    """The estimates that offline replay makes of a bag's scans, by their stamps."""
    estimates = Estimates()
    with Bag(bag) as opened:
        events = opened.events(assign(opened.topics))
        found = [judged for event in events for judged in estimates.see(event)]
    return {f.t_ns: f.estimate for f in found if f.estimate.verdict is not Verdict.BLIND}


def test_the_lidar_node_judges_a_played_bag_as_offline_replay_does(
    start_process: Callable, play: Callable, listener: Listener, bag: Path
) -> None:
    listener.listen(CollisionEstimate, "collision/estimate", raw=False)
    patient = ("-p", "stale:=5.0")  # a busy machine may bring a scan late
    start_process(
        "cfnav_ros.ros.lidar_collision_node", "--ros-args", "-p", "use_sim_time:=true", *patient
    )
    player = play(bag, "--wait-for", "scan", "--rate", "0.5")
    expected = replayed(bag)
    assert len(expected) == TURNS

    def live() -> dict[int, Estimate]:
        stamped = [estimate_from_message(m) for m in listener.heard["collision/estimate"]]
        return {s.stamp_ns: s.estimate for s in stamped if s.estimate.verdict is not Verdict.BLIND}

    listener.wait(lambda: len(live()) >= TURNS, "an estimate of every scan")
    assert player.wait() == 0, player.output
    assert {t: told(e) for t, e in live().items()} == {t: told(e) for t, e in expected.items()}
    probabilities = [estimate.probability for estimate in live().values()]
    assert min(probabilities) < 0.1
    assert max(probabilities) > 0.9


def clock_ns(listener: Listener) -> list[int]:
    return [m.clock.sec * S + m.clock.nanosec for m in listener.heard["/clock"]]


def test_sensors_are_heard_byte_for_byte_and_nothing_else_is(
    play: Callable, listener: Listener, bag: Path
) -> None:
    kinds = {"/scan": LaserScan, "/odom": Odometry, "/oakd/rgb/preview/image_raw": Image}
    for name, kind in kinds.items():
        listener.listen(kind, name)
    listener.listen(TFMessage, "/tf_static", latched=False)
    listener.listen(TwistStamped, "/cmd_vel")
    listener.listen(CollisionEstimate, "/collision/estimate")
    listener.listen(Clock, "/clock", raw=False)
    player = play(bag, "--wait-for", "scan", "--wait-for", "image", "--rate", "1")
    player.wait_for_line("playing")
    listener.wait(lambda: listener.heard["/scan"], "a scan")
    offered = dict(listener.node.get_publisher_names_and_types_by_node("bag_play", "/"))
    sent = {name: [m.cdr for m in drive() if m.topic == name] for name in (*kinds, "/tf_static")}
    recorded = {m.topic for m in drive()}
    names = {f"/{TOPICS[role].name}" for role in SENSORS} & recorded | {"/clock"}
    logged = [m.log_ns for m in drive() if m.topic in names]
    listener.wait(lambda: max(logged) in clock_ns(listener), "the end of the drive")
    listener.wait(lambda: all(len(listener.heard[n]) >= len(m) for n, m in sent.items()), "all")
    assert player.wait() == 0, player.output
    assert {name: listener.heard[name] for name in sent} == sent
    assert not listener.heard["/cmd_vel"]
    assert not listener.heard["/collision/estimate"]
    recorded = {m.topic for m in drive()}
    names = {f"/{TOPICS[role].name}" for role in SENSORS} & recorded | {"/clock"}
    assert {name for name in offered if name != "/parameter_events"} == names

    ticks = clock_ns(listener)
    assert ticks == sorted(ticks)
    assert (ticks[0], ticks[-1]) == (min(logged), max(logged))
    assert set(logged) <= set(ticks)
    assert max(np.diff(ticks)) <= 20_000_000


def test_a_listener_that_comes_late_gets_what_is_latched(
    play: Callable, listener: Listener, tmp_path: Path
) -> None:
    messages = drive()
    with Writer(tmp_path / "bag", version=9) as writer:
        kept, sure = profile(True, True, 1), profile(True, False, 50)
        for message in (messages[0], *(m for m in messages if m.topic in ("/scan", "/odom"))):
            qos = [sure if message.topic == "/scan" else kept]
            found = [c for c in writer.connections if c.topic == message.topic]
            topic = found[0] if found else writer.add_connection(
                message.topic, message.type, typestore=STORE, offered_qos_profiles=qos
            )  # fmt: skip
            writer.write(topic, message.log_ns, message.cdr)
    player = play(tmp_path / "bag", "--start", "2", "--wait", "0", "--rate", "0.1")
    listener.listen(LaserScan, "/r/scan")
    player.wait_for_line("playing")
    listener.listen(TFMessage, "/tf_static", latched=True)
    listener.listen(Odometry, "/odom", latched=True)
    listener.wait(lambda: listener.heard["/tf_static"], "what is latched")
    assert listener.heard["/tf_static"] == [messages[0].cdr]
    listener.wait(lambda: listener.heard["/odom"], "odometry")
    assert not listener.heard["/r/scan"]
    assert player.interrupt() == 0
    assert "told to end" in player.output
    assert "Traceback" not in player.output


def test_it_refuses_to_play_what_somebody_publishes(
    play: Callable, listener: Listener, bag: Path
) -> None:
    publisher = listener.node.create_publisher(Odometry, "/odom", 1)
    player = play(bag, "--wait", "0")
    assert player.wait() == 2
    assert "listener publishes /odom in ROS domain" in player.output
    listener.node.destroy_publisher(publisher)

    second = play(bag, "--wait", "0", "--rate", "0.1")
    second.wait_for_line("playing")
    clock = listener.node.create_publisher(Clock, "/clock", 1)
    assert second.wait() == 1
    assert "listener publishes /clock" in second.output
    listener.node.destroy_publisher(clock)


def test_nobody_who_listens_is_a_sentence(play: Callable, listener: Listener, bag: Path) -> None:
    player = play(bag, "--wait", "0.5", "--wait-for", "scan")
    assert player.wait() == 2
    assert "Nobody listened to any of /scan within 0.5 s" in player.output
    assert "Traceback" not in player.output


def test_the_domain_of_the_shell_is_refused(start_process: Callable, bag: Path) -> None:
    player = start_process(*PLAYER, str(bag), "--domain", os.environ["ROS_DOMAIN_ID"])
    assert player.wait() == 2
    assert "the domain of this shell" in player.output


@pytest.mark.parametrize(
    "options", [["--rate", "-1"], ["--topic", "scan:=/none"], ["--wait-for", "x"]]
)
def test_options_that_make_no_sense_end_it_at_once(
    play: Callable, bag: Path, options: list[str]
) -> None:
    player = play(bag, *options)
    assert player.wait() == 2
    assert player.output.count("\n") == 1


def test_an_empty_bag_is_told_with_its_reason(play: Callable, tmp_path: Path) -> None:
    (tmp_path / "bag.mcap").write_bytes(b"")
    player = play(tmp_path / "bag.mcap")
    assert player.wait() == 2
    assert "bag.mcap" in player.output
    assert "there is nothing to play" in player.output
    assert "Traceback" not in player.output


def test_of_a_damaged_bag_the_rest_is_played_as_fast_as_it_goes(
    play: Callable, tmp_path: Path
) -> None:
    path = files.write_mcap(tmp_path / "bag.mcap", drive())
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    player = play(path, "--wait", "0", "--rate", "0")
    assert player.wait() == 1
    assert "bag.mcap" in player.output
    played = int(player.wait_for_line(r"bag_play: (\d+) messages played")[1])
    assert 0 < played < len(drive())
    assert "Traceback" not in player.output


def test_ctrl_c_ends_it_at_any_time(play: Callable, bag: Path) -> None:
    player = play(bag, "--wait", "60")
    player.wait_for_line("waiting until somebody listens")
    player.process.send_signal(signal.SIGINT)
    assert player.wait() == 0
    assert "Traceback" not in player.output
