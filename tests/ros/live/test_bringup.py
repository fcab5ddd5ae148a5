"""The plain bringup: its parameter files, what it starts, and a drive that it ends in zeros."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

pytestmark = pytest.mark.ros

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.drive.policy_parameters import PolicyParameters  # noqa: E402
from cfnav_ros.lidar.scan_watch import LidarParameters  # noqa: E402
from cfnav_ros.live.bringup import (  # noqa: E402
    RobotBringup,
    SimulationBringup,
    common_arguments,
    parts_of,
    unreachable,
)
from cfnav_ros.process.nodes import NodeStart  # noqa: E402
from cfnav_ros.process.parameter_file import parameter_file  # noqa: E402
from cfnav_ros.process.processes import GraphError  # noqa: E402
from cfnav_ros.ros.parameters import declare, named_robot  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402
from sim_bridge.ros.parameters import read_parameters  # noqa: E402

from cfnav_core.robot.robot import SHIPPED  # noqa: E402
from tests.conftest import ROOT, wait_until  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402

CONFIG = ROOT / "ros_ws/src/cfnav_bringup/config"
STOCK = ("robot", "--robot", "turtlebot4")
FILES = sorted(CONFIG.glob("*.yaml"))
READ = {
    "policy_node": lambda node: declare(node, PolicyParameters.of(named_robot(node))),
    "lidar_collision_node": lambda node: declare(node, LidarParameters.of(named_robot(node))),
    "mock_turtlebot4": read_parameters,
}
STARTED = [
    (file, name) for file in FILES for name in READ
    if name != "mock_turtlebot4" or file.stem == "simulation"
]  # fmt: skip


@pytest.fixture
def read() -> Iterator[Callable]:
    """A function: parameter file, node name -> the parameters as the node itself reads them."""
    context = rclpy.Context()
    nodes = []

    def read(file: Path, name: str) -> tuple[object, Node]:
        rclpy.init(args=["--ros-args", "--params-file", str(file)], context=context)
        node = Node(name, context=context, automatically_declare_parameters_from_overrides=True)
        nodes.append(node)
        return READ[name](node), node

    yield read
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize(("file", "name"), STARTED, ids=[f"{f.stem}-{n}" for f, n in STARTED])
def test_a_parameter_file_fits_its_nodes(read: Callable, file: Path, name: str) -> None:
    values, _ = read(file, name)
    given = yaml.safe_load(file.read_text())[f"/**/{name}"]["ros__parameters"]
    assert given
    if name == "mock_turtlebot4":
        assert values.room == given["room"]
    elif name == "policy_node":
        assert values.allow_robot is (file.stem == "robot")


@pytest.mark.parametrize("file", [*FILES, *SHIPPED.glob("*.yaml")], ids=lambda file: file.stem)
def test_every_parameter_says_why(file: Path) -> None:
    lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    for line in lines:
        if not line.rstrip().endswith(":"):
            assert len(line.partition("  # ")[2]) > 10, line


def test_robot_gets_the_file_the_namespace_and_what_was_given(tmp_path: Path) -> None:
    file = str(FILES[0])
    config = RobotBringup(
        robot="turtlebot4",
        params=file,
        goal="Laptop",
        namespace="robot1",
        bundle=tmp_path / "bundle",
        bag=tmp_path / "bag",
    )
    assert common_arguments(config) == ["-r", "__ns:=/robot1", "--params-file", file]
    recorder, lidar, policy = parts_of(config)
    assert lidar == NodeStart("cfnav_ros", "lidar_collision_node", {"robot": "turtlebot4"})
    assert policy.arguments == (
        "-p", "robot:=turtlebot4", "-p", f"bundle:={tmp_path}/bundle", "-p", "goal:=Laptop",
        "-p", "wait_for_recorder:=true",
    )  # fmt: skip
    assert recorder.parameters == {"robot": "turtlebot4", "bag": f"{tmp_path}/bag"}


def test_a_detector_sees_by_the_policys_robot_and_both_know_what_it_learnt(tmp_path: Path) -> None:
    model = tmp_path / "yolo.onnx"
    config = RobotBringup(robot="turtlebot4", bundle=Path("boxes"), detector=model)
    lidar, detector, policy = parts_of(config)
    assert lidar.executable == "lidar_collision_node"
    assert detector.executable == "detector_node"
    assert detector.parameters == {"robot": "turtlebot4", "model": str(model)}
    assert policy.parameters["robot"] == "turtlebot4"
    assert "detections.labels" not in policy.parameters
    _, detector, policy = parts_of(replace(config, labels="voc"))
    assert detector.parameters["labels"] == policy.parameters["detections.labels"] == "voc"
    with pytest.raises(GraphError, match="found --labels without --detector"):
        parts_of(replace(config, labels="voc", detector=None))
    with pytest.raises(GraphError, match="for the bundle turtlebot4, which sees pictures itself"):
        parts_of(replace(config, bundle=Path("turtlebot4")))


def test_simulation_starts_the_mock_first() -> None:
    file = str(CONFIG / "simulation.yaml")
    config = SimulationBringup(room="kitchen:25", seed=3, speed=2.0, params=file)
    mock, lidar, policy = parts_of(config)
    assert mock.executable == "mock_turtlebot4"
    assert mock.arguments[-6:] == ("-p", "room:=kitchen:25", "-p", "seed:=3", "-p", "speed:=2.0")
    simulated = {"robot": "turtlebot4_mast", "use_sim_time": True}
    assert lidar.parameters == policy.parameters == simulated
    assert common_arguments(config) == ["--params-file", file]


def test_a_shipped_file_is_found_by_its_name(tmp_path: Path) -> None:
    folder = tmp_path / "share/cfnav_bringup/config"
    folder.mkdir(parents=True)
    (folder / "robot.yaml").touch()
    built, none = {"AMENT_PREFIX_PATH": f"/nowhere:{tmp_path}"}, tmp_path / "none"
    assert parameter_file("robot.yaml", built, none) == folder / "robot.yaml"
    with pytest.raises(GraphError, match=r"'ship.yaml', expected a file or one of robot\.yaml"):
        parameter_file("ship.yaml", built, none)
    with pytest.raises(GraphError, match="a name that a built ros_ws brings"):
        parameter_file("ship.yaml", {}, none)
    sources = tmp_path / "sources"
    sources.mkdir()
    (sources / "robot.yaml").touch()  # an edit of the sources takes effect without a build
    assert parameter_file("robot.yaml", built, sources) == sources / "robot.yaml"
    for file in FILES:
        assert parameter_file(file.name) == file


@pytest.mark.parametrize(
    ("settings", "warned"),
    [
        ({}, False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": "10.0.0.2"}, False),
    ],
)
def test_settings_that_hide_a_robot_are_told(settings: dict, warned: bool) -> None:
    assert ("SUBNET" in unreachable(settings)) is warned


STAND_IN = """#!{python}
import json, os, signal, sys, time
def note(event):
    with open({log!r}, "a") as file:
        file.write(json.dumps([event, {name!r}, dict(os.environ)]) + "\\n")
def end(*_):
    note("ended")
    sys.exit(0)
signal.signal(signal.SIGINT, end)
note("started")
print("here is {name}", flush=True)
while True:
    time.sleep(1)
"""


@pytest.fixture
def stand_ins(tmp_path: Path) -> Path:
    """An ament prefix whose nodes only note when they start and end."""
    for package, name in (
        ("cfnav_ros", "recorder_node"),
        ("cfnav_ros", "lidar_collision_node"),
        ("cfnav_ros", "policy_node"),
    ):
        program = tmp_path / "prefix/lib" / package / name
        program.parent.mkdir(parents=True, exist_ok=True)
        log = str(tmp_path / "events")
        program.write_text(STAND_IN.format(python=sys.executable, log=log, name=name))
        program.chmod(0o755)
    return tmp_path / "prefix"


def events(folder: Path, kind: str) -> list[str]:
    log = folder / "events"
    lines = log.read_text().splitlines() if log.exists() else []
    return [name for event, name, _ in map(json.loads, lines) if event == kind]


def test_robot_keeps_the_users_network_and_ends_the_policy_first(
    start_process: Callable, stand_ins: Path, tmp_path: Path
) -> None:
    process = start_process(
        *("cfnav.cli", "robot", "--robot", "turtlebot4", "--params", str(FILES[0])),
        *("--bag", str(tmp_path / "bag")),
        *("--logs", str(tmp_path / "logs")),
        AMENT_PREFIX_PATH=str(stand_ins),
        ROS_AUTOMATIC_DISCOVERY_RANGE="SYSTEM_DEFAULT",
        ROS_STATIC_PEERS="10.0.0.2",
        FASTRTPS_DEFAULT_PROFILES_FILE="/my/profile.xml",
    )
    for name in ("recorder_node", "lidar_collision_node", "policy_node"):
        process.wait_for_line(f"^{name}: here is {name}$")
    assert process.interrupt() == 0
    assert "every process was ended" in process.output
    started, ended = events(tmp_path, "started"), events(tmp_path, "ended")
    assert sorted(started) == sorted(ended)
    assert ended == ["policy_node", "lidar_collision_node", "recorder_node"]
    environment = json.loads((tmp_path / "events").read_text().splitlines()[0])[2]
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    assert environment["ROS_STATIC_PEERS"] == "10.0.0.2"
    assert environment["ROS_DOMAIN_ID"] == os.environ["ROS_DOMAIN_ID"]
    assert environment["FASTRTPS_DEFAULT_PROFILES_FILE"] == "/my/profile.xml"


def velocities(bag: Path) -> list[tuple[float, float]]:
    with AnyReader([bag]) as reader:
        chosen = [c for c in reader.connections if c.topic.endswith("/cmd_vel")]
        messages = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(chosen)]
    return [(m.twist.linear.x, m.twist.angular.z) for m in messages]


def counts(bag: Path) -> dict[str, int]:
    with AnyReader([bag]) as reader:
        return {c.topic: c.msgcount for c in reader.connections}


def test_simulation_drives_in_a_namespace_and_ctrl_c_ends_it_in_zeros(
    start_process: Callable, eager_bundle: Path, tmp_path: Path
) -> None:
    process = start_process(
        *("cfnav.cli", "simulate", "--params", str(CONFIG / "simulation.yaml")),
        *("--room", "bathroom:20", "--goal", "Sink", "--namespace", "robot1"),
        *("--bundle", str(eager_bundle), "--bag", str(tmp_path / "bag")),
        *("--logs", str(tmp_path / "logs")),
    )
    process.wait_for_line("^policy_node: .*Looking for Sink")
    process.wait_for_line("^policy_node: .*Sending TwistStamped to /robot1/cmd_vel")
    process.wait_for_line("^policy_node: .*Sink: done")
    assert process.interrupt() == 0, process.output
    recorded = counts(tmp_path / "bag")
    for topic in ("scan", "odom", "oakd/rgb/preview/image_raw", "collision/estimate"):
        assert recorded[f"/robot1/{topic}"] > 0, topic
    sent = velocities(tmp_path / "bag")
    assert max(v for v, _ in sent) > 0.1
    assert sent[-1] == (0.0, 0.0)


def stock_robot(start_process: Callable, *parameters: str) -> None:
    """Start a TurtleBot 4 as sold: its camera, and system time."""
    given = (
        "robot:=turtlebot4",
        "room:=bathroom:20",
        "camera:=stock_preview",
        "clock:=system",
        *parameters,
    )
    arguments = [word for parameter in given for word in ("-p", parameter)]
    mock = start_process("sim_bridge.ros.mock_turtlebot4", "--ros-args", *arguments)
    mock.wait_for_line("^mock_turtlebot4 ready")


def test_a_docked_robot_is_refused_with_a_sentence(
    start_process: Callable, eager_bundle: Path, tmp_path: Path
) -> None:
    stock_robot(start_process, "docked:=true")
    process = start_process(
        *("cfnav.cli", *STOCK, "--params", str(CONFIG / "robot.yaml")),
        *("--goal", "Sink", "--bundle", str(eager_bundle), "--logs", str(tmp_path / "logs")),
    )
    told = process.wait_for_line("^policy_node: .*Sink: refused after 0 decisions. (.*)$")
    assert told[1] == "The robot sits on its dock: undock it first."
    assert process.interrupt() == 0


@pytest.fixture
def wait_until_turning(ros_domain_id: int) -> Iterator[Callable[[], None]]:
    """A function that returns when the odometry of the test's domain says that it turns."""
    listener, turns = OwnNode(ros_domain_id, "passer_by"), [0.0]
    listener.node.create_subscription(
        Odometry, "odom", lambda m: turns.append(m.twist.twist.angular.z), qos_profile_sensor_data
    )
    yield lambda: listener.wait(lambda: turns[-1] > 0.3, "a robot that turns")
    listener.close()


def test_ctrl_c_while_a_robot_moves_stands_it_still(
    start_process: Callable, make_bundle: Callable, wait_until_turning: Callable, tmp_path: Path
) -> None:
    stock_robot(start_process)
    params = tmp_path / "mine.yaml"
    text = (CONFIG / "robot.yaml").read_text().replace("other_camera: false", "other_camera: true")
    # The robot's clock is the system's: what a busy machine is late with may not end the drive.
    params.write_text(text.replace("odometry: 0.25", "odometry: 2.0"))
    # It turns on and on, which no veto forbids: a late recorder still finds it moving.
    endless = make_bundle("RotateLeft")
    process = start_process(
        *("cfnav.cli", *STOCK, "--params", str(params), "--goal", "Laptop"),
        *("--bundle", str(endless), "--bag", str(tmp_path / "bag")),
        *("--logs", str(tmp_path / "logs")),
    )
    process.wait_for_line("^recorder_node: recording /cmd_vel")
    wait_until_turning()
    assert process.interrupt() == 0, process.output
    assert "Laptop: aborted" in process.output
    assert "The policy node was stopped." in process.output
    sent = velocities(tmp_path / "bag")
    assert "/clock" not in [topic for topic, count in counts(tmp_path / "bag").items() if count]
    # Half a second at 20 Hz, less what a busy machine is late with.
    assert sent[-3:] == [(0.0, 0.0)] * 3


def test_bringup_ends_when_a_node_dies(
    start_process: Callable, eager_bundle: Path, tmp_path: Path
) -> None:
    process = start_process(
        *("cfnav.cli", "simulate", "--params", str(CONFIG / "simulation.yaml")),
        *("--room", "bathroom:20", "--bundle", str(eager_bundle), "--logs", str(tmp_path / "logs")),
    )
    process.wait_for_line("^lidar_collision_node: .*Judging")
    process.wait_for_line("^policy_node: .*Bundle eager")
    os.kill(pid_of("lidar_collision_node", process.process.pid), signal.SIGKILL)
    assert process.wait() == 2
    assert "cfnav: lidar_collision_node ended with code -9" in process.output
    wait_until(lambda: not children(process.process.pid), "the end of all nodes")


def children(parent: int) -> list[int]:
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(stat.read_text().rpartition(")")[2].split()[1]) == parent:
                found.append(int(stat.parent.name))
        except OSError:
            continue
    return found


def pid_of(name: str, parent: int) -> int:
    """The child of a process whose command line names a node."""
    for pid in children(parent):
        if name in Path(f"/proc/{pid}/cmdline").read_text():
            return pid
    raise AssertionError(f"{name} does not run")
