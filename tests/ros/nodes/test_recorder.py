"""The recorder on a real graph: another process publishes, the bag holds all of it."""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.bags.files.events import OccupancyMap, Picture, Told, Truth  # noqa: E402
from cfnav_ros.bags.files.parameters_file import read_parameters  # noqa: E402
from cfnav_ros.bags.files.reading import Bag  # noqa: E402
from cfnav_ros.bags.files.roles import assign  # noqa: E402
from cfnav_ros.ros.recorder import CLOCK, Recorder  # noqa: E402
from geometry_msgs.msg import Twist  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.parameter_client import AsyncParameterClient  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image, JointState  # noqa: E402

from cfnav_core.robot.robot import SHIPPED, load_robot  # noqa: E402
from cfnav_core.robot.topics import TOPICS  # noqa: E402
from tests.conftest import (  # noqa: E402
    DEADLINE_S,
    RunningProcess,
    wait_until,
)

IMAGE = "oakd/rgb/preview/image_raw"
PICTURES = 60
PERIOD_NS = 66_666_667

PUBLISHER = f"""
import array, random, time, rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from builtin_interfaces.msg import Time
from cfnav_interfaces.msg import EpisodeStatus, GroundTruth, PolicyDecision
from nav_msgs.msg import OccupancyGrid
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Header

rclpy.init()
node = rclpy.create_node("robot")
latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
grid_pub = node.create_publisher(OccupancyGrid, "ground_truth/map", latched)
grid = OccupancyGrid()
grid.info.width, grid.info.height, grid.info.resolution = 3, 2, 0.5
grid.data = array.array("b", [100, 0, 0, 0, 0, 100])
grid_pub.publish(grid)
print("latched", flush=True)
images = node.create_publisher(Image, "{IMAGE}", {PICTURES})
clocks = node.create_publisher(Clock, "{CLOCK}", {PICTURES})
truths = node.create_publisher(GroundTruth, "ground_truth/state", 100)
status = node.create_publisher(EpisodeStatus, "policy/episode", latched)
decisions = node.create_publisher(PolicyDecision, "policy/decision", 50)
pubs = (images, clocks, truths, status, decisions)
while any(p.get_subscription_count() == 0 for p in pubs):
    time.sleep(0.02)
pixels = array.array("B", bytes(range(250)) + random.Random(1).randbytes(270000 - 250))
for i in range({PICTURES}):
    ns = (i + 1) * {PERIOD_NS}
    stamp = Time(sec=ns // 10**9, nanosec=ns % 10**9)
    header = Header(stamp=stamp)
    clocks.publish(Clock(clock=stamp))
    images.publish(Image(
        header=header, height=300, width=300, encoding="bgr8", step=900, data=pixels))
    truths.publish(GroundTruth(header=header, x=0.25 * i, goal="Mug", room="kitchen:25"))
    if i in (0, {PICTURES} - 1):
        status.publish(EpisodeStatus(header=header, phase=int(i > 0), goal="Mug", outcome="done"))
    time.sleep(0.03)
decisions.publish(PolicyDecision(header=header, goal="Mug", step=1, action=5))
while True:
    time.sleep(1)
"""


@pytest.fixture
def domain(ros_domain_id: int) -> int:
    return ros_domain_id


@pytest.fixture
def publisher(domain: int, tmp_path: Path) -> object:
    """Another process that publishes a latched map, then pictures at 30 Hz; it keeps all."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    command = [sys.executable, "-c", PUBLISHER]
    process = RunningProcess(command, tmp_path / "publisher.log", environment)
    process.wait_for_line("latched")
    yield process
    process.end()


@pytest.fixture
def context(domain: int) -> Context:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    yield context
    context.try_shutdown()


def test_every_message_is_in_the_bag(publisher: object, context: Context, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    recorder = Recorder(bag, context)
    assert recorder.wait_for("decision", 1, DEADLINE_S)
    assert recorder.wait_for("image", PICTURES, DEADLINE_S)
    assert recorder.wait_for("truth", PICTURES, DEADLINE_S)
    assert not bag.exists()
    recorder.close()

    stamps = [(i + 1) * PERIOD_NS for i in range(PICTURES)]
    with Bag(bag) as recorded:
        events = list(recorded.events(assign(recorded.topics)))
        assert list(recorded.notes) == []
    pictures = [e for e in events if isinstance(e, Picture)]
    assert sorted(p.t_ns for p in pictures) == stamps
    assert pictures[0].decode()[0, 0].tolist() == [2, 1, 0]
    truths = sorted((e for e in events if isinstance(e, Truth)), key=lambda e: e.t_ns)
    assert [t.x for t in truths] == [0.25 * i for i in range(PICTURES)]
    statuses = [(e.started, e.t_ns) for e in events if isinstance(e, Told)]
    assert statuses == [(True, stamps[0]), (False, stamps[-1])]
    (room,) = [e for e in events if isinstance(e, OccupancyMap)]
    assert room.occupied.tolist() == [[True, False, False], [False, False, True]]
    with AnyReader([bag]) as reader:
        assert {c.topic for c in reader.connections} == {
            "/" + t.name.strip("/") for t in TOPICS.values() if t.recorded
        }
        log_times = {t for c, t, _ in reader.messages() if c.topic == "/" + IMAGE}
        # The log time is the newest clock heard, at most a few pictures away from the stamp.
        assert log_times <= {0, *stamps}
        assert len(log_times) > PICTURES // 2


def test_a_recording_given_up_leaves_nothing(context: Context, tmp_path: Path) -> None:
    Recorder(tmp_path / "bag", context).abort()
    assert list(tmp_path.iterdir()) == []


def test_an_old_bag_is_not_written_over(context: Context, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(FileExistsError, match="exists already"):
        Recorder(tmp_path / "bag", context)


@pytest.fixture
def small_files() -> None:
    """Let no file of this process grow beyond 100 kB, as on a disk that is nearly full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.usefixtures("publisher", "small_files")
def test_a_full_disk_is_told_and_leaves_what_was_written(context: Context, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "bag", context)
    with pytest.raises(OSError, match="File too large"):
        recorder.wait_for("decision", 1, DEADLINE_S)
    with pytest.raises(OSError, match="File too large"):
        recorder.close()
    assert [path.name for path in tmp_path.glob("bag*")] == ["bag.partial"]
    (file,) = (tmp_path / "bag.partial").rglob("*.mcap")
    assert file.stat().st_size > 1000


def test_the_node_takes_topic_and_type_from_the_robot_and_names_what_it_cannot_hear(
    ros_domain_id: int, start_process: Callable, tmp_path: Path
) -> None:
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    node = rclpy.create_node("robot", context=context)
    pictures = node.create_publisher(Image, "front/image_rect", 10)
    infos = node.create_publisher(CameraInfo, "front/camera_info", 10)
    velocities = node.create_publisher(Twist, "cmd_vel", 10)
    # what asks for more than is offered hears nothing: best effort, and nothing kept for the late
    joints = node.create_publisher(JointState, "joint_states", qos_profile_sensor_data)
    odometry = node.create_publisher(Odometry, "odom", 10)
    node.create_publisher(CameraInfo, "scan", 10)
    bag, robot = tmp_path / "drive", tmp_path / "robot.yaml"
    shipped = (SHIPPED / "turtlebot4.yaml").read_text()
    robot.write_text(f"{shipped}topics: {{image: front/image_rect}}")
    recorder = start_process(
        "cfnav_ros.ros.recorder_node", "--ros-args", "-p", f"bag:={bag}",
        "-p", f"robot:={robot}",
    )  # fmt: skip
    publishers = (pictures, infos, velocities, joints, odometry)
    wait_until(lambda: all(p.get_subscription_count() for p in publishers), "the recorder")
    for publisher in publishers:
        publisher.publish(publisher.msg_type())

    def joints_are_heard() -> bool:  # best effort may lose some
        joints.publish(JointState())
        return "recording /joint_states\n" in recorder.output

    wait_until(joints_are_heard, "the joints to be recorded")
    for topic in ("front/image_rect", "front/camera_info", "cmd_vel", "odom"):
        recorder.wait_for_line(f"^recording /{topic}$")
    recorder.wait_for_line("^/scan was not heard so far: robot sends .*CameraInfo on /scan, ex")
    assert recorder.interrupt() == 0
    # A busy machine may bring the velocity only after the recorder named what is silent.
    assert "cmd_vel was not heard" not in recorder.output.partition("recording /cmd_vel\n")[2]
    node.destroy_node()
    context.try_shutdown()
    with AnyReader([bag]) as reader:
        counts = {c.topic: (c.msgtype, c.msgcount) for c in reader.connections}
    assert counts["/cmd_vel"] == ("geometry_msgs/msg/Twist", 1)
    for topic in ("front/image_rect", "front/camera_info", "odom"):
        assert counts[f"/{topic}"][1] == 1
    assert counts["/joint_states"][1] >= 1
    assert "/oakd/rgb/preview/image_raw" not in counts


def test_a_bag_says_what_the_nodes_were_told_at_last(
    context: Context, domain: int, start_process: Callable, tmp_path: Path
) -> None:
    recorder = Recorder(tmp_path / "bag", context, robot=load_robot("turtlebot4"))
    command = (
        "cfnav_ros.ros.policy_node", "--ros-args", "-p", "robot:=turtlebot4", "-p", "bundle:=boxes"
    )  # fmt: skip
    first = start_process(*command, ROS_DOMAIN_ID=str(domain))
    wait_until(lambda: "policy_node" in recorder.told, "the policy node's parameters")
    assert recorder.told["policy_node"]["detections.labels"] == "coco"
    assert first.interrupt() == 0
    start_process(*command, "-p", "detections.labels:=voc", ROS_DOMAIN_ID=str(domain))
    wait_until(
        lambda: recorder.told["policy_node"]["detections.labels"] == "voc", "the node that came"
    )
    assert recorder.told["policy_node"]["episode.motion.v_max"] == 0.2

    node, executor = Node("operator", context=context), SingleThreadedExecutor(context=context)
    client = AsyncParameterClient(node, "policy_node")
    assert client.wait_for_services(DEADLINE_S)
    slower = client.set_parameters([Parameter("episode.motion.v_max", value=0.1)])
    executor.add_node(node)
    executor.spin_until_future_complete(slower, DEADLINE_S)
    assert slower.result().results[0].successful
    wait_until(lambda: recorder.told["policy_node"]["episode.motion.v_max"] == 0.1, "the change")
    node.destroy_node()
    recorder.close()

    told = read_parameters(None, bag=tmp_path / "bag")
    assert (told.robot.name, told.policy.bundle) == ("turtlebot4", "boxes")
    assert told.policy.detections.labels == "voc"
    assert told.policy.episode.motion.v_max == 0.1


def test_a_node_of_another_cfnav_is_named(context: Context, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "bag", context)
    node, executor = Node("policy_node", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(node)
    said = "policy_node does not say what it was told"

    def named() -> bool:
        executor.spin_once(0.05)
        return any(sentence.startswith(said) for sentence in recorder.unheard())

    wait_until(named, "the sentence about a node without our parameters")
    node.destroy_node()
    recorder.abort()


@pytest.mark.usefixtures("publisher", "small_files")
def test_the_node_keeps_what_it_wrote_before_the_disk_was_full(
    domain: int, start_process: Callable, tmp_path: Path
) -> None:
    arguments = ("cfnav_ros.ros.recorder_node", "--ros-args", "-p", f"bag:={tmp_path}/drive")
    recorder = start_process(*arguments, ROS_DOMAIN_ID=str(domain))
    assert recorder.wait() == 1
    assert f"what was recorded before is in {tmp_path}/drive.partial" in recorder.output
    assert list((tmp_path / "drive.partial").rglob("*.mcap"))
    again = start_process(*arguments, ROS_DOMAIN_ID=str(domain))
    assert again.wait() == 2
    assert "drive.partial exists already" in again.output


def test_the_recorder_of_a_robot_stamps_system_time_and_keeps_a_bag(
    start_process: Callable, tmp_path: Path
) -> None:
    bag = tmp_path / "drive"
    arguments = ("cfnav_ros.ros.recorder_node", "--ros-args", "-p", f"bag:={bag}")
    before = time.time_ns()
    recorder = start_process(*arguments, "-r", "__ns:=/robot1")
    recorder.wait_for_line("^recording to")
    talker = start_process(
        "cfnav_ros.ros.lidar_collision_node", "--ros-args", "-r", "__ns:=/robot1"
    )  # blind, and says so ten times a second
    recorder.wait_for_line("^recording /robot1/collision/estimate$")
    assert talker.interrupt() == 0

    def ended() -> bool:  # under a hail of interrupts, as launch may send
        recorder.process.send_signal(signal.SIGINT)
        return recorder.process.poll() is not None

    wait_until(ended, "the end of the recorder")
    assert recorder.wait() == 0
    assert int(recorder.wait_for_line(r"^(\d+) messages recorded$")[1]) > 0
    with AnyReader([bag]) as reader:
        estimates = [c for c in reader.connections if c.topic == "/robot1/collision/estimate"]
        times = [t for _, t, _ in reader.messages(estimates)]
    assert times
    assert all(before < t < time.time_ns() for t in times)

    again = start_process(*arguments)
    assert again.wait() == 2
    assert "exists already" in again.output
    nameless = start_process("cfnav_ros.ros.recorder_node")
    assert nameless.wait() == 2
    assert "expected -p bag:=FOLDER" in nameless.output
