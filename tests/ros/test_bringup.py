"""The plain bringup: its parameter files, what it starts, and a drive that it ends in zeros."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

pytestmark = pytest.mark.ros

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.bringup import Part, Robot, Simulation, parameter_file, parts, unreachable  # noqa: E402
from cfnav_ros.parameters import declare  # noqa: E402
from cfnav_ros.policy_parameters import PolicyParameters  # noqa: E402
from cfnav_ros.processes import GraphError  # noqa: E402
from cfnav_ros.scan_watch import LidarParameters  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402
from sim_bridge.parameters import read_parameters  # noqa: E402

from tests.conftest import ROOT, wait_until  # noqa: E402

CONFIG = ROOT / "ros_ws/src/cfnav_bringup/config"
FILES = sorted(CONFIG.glob("*.yaml"))
READ = {
    "policy_node": lambda node: declare(node, PolicyParameters),
    "lidar_collision_node": lambda node: declare(node, LidarParameters),
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
    values, node = read(file, name)
    given = yaml.safe_load(file.read_text())[f"/**/{name}"]["ros__parameters"]
    assert given
    simulated = file.stem == "simulation"
    if name == "mock_turtlebot4":
        assert values.room == given["room"]
        return
    assert node.get_parameter("use_sim_time").value is simulated
    if name == "policy_node":
        assert values.allow_robot is not simulated
        assert values.episode.has_tilt is (file.stem in ("simulation", "turtlebot4_mast"))
    else:
        lite = file.stem == "turtlebot4_lite"
        assert values.disc.mount_x == (0.0039 if lite else -0.04)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_parameter_says_why(file: Path) -> None:
    lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    for line in lines:
        if not line.rstrip().endswith(":"):
            assert len(line.partition("  # ")[2]) > 10, line


def test_robot_gets_the_file_the_namespace_and_what_was_given(tmp_path: Path) -> None:
    file = str(FILES[0])
    config = Robot(
        params=file,
        goal="Laptop",
        namespace="robot1",
        bundle=tmp_path / "bundle",
        bag=tmp_path / "bag",
    )
    recorder, lidar, policy = parts(config)
    common = ("-r", "__ns:=/robot1", "--params-file", file)
    assert lidar == Part("cfnav_ros", "lidar_collision_node", common)
    assert policy.arguments == (
        *common, "-p", f"bundle:={tmp_path}/bundle", "-p", "goal:=Laptop",
        "-p", "wait_for_recorder:=true",
    )  # fmt: skip
    assert recorder.arguments == (
        *common, "-p", f"bag:={tmp_path}/bag", "-p", "use_sim_time:=false",
    )  # fmt: skip


def test_simulation_starts_the_mock_first() -> None:
    file = str(CONFIG / "simulation.yaml")
    mock, lidar, policy = parts(Simulation(room="kitchen:25", seed=3, speed=2.0, params=file))
    assert mock.executable == "mock_turtlebot4"
    assert mock.arguments[-6:] == ("-p", "room:=kitchen:25", "-p", "seed:=3", "-p", "speed:=2.0")
    assert lidar.arguments == policy.arguments == ("--params-file", file)


def test_a_shipped_file_is_found_by_its_name(tmp_path: Path) -> None:
    folder = tmp_path / "share/cfnav_bringup/config"
    folder.mkdir(parents=True)
    (folder / "robot.yaml").touch()
    found = parameter_file("robot.yaml", {"AMENT_PREFIX_PATH": f"/nowhere:{tmp_path}"})
    assert found == folder / "robot.yaml"
    with pytest.raises(GraphError, match=r"'ship.yaml', expected a file or one of robot\.yaml"):
        parameter_file("ship.yaml", {"AMENT_PREFIX_PATH": str(tmp_path)})
    with pytest.raises(GraphError, match="a name that a built ros_ws brings"):
        parameter_file("ship.yaml", {})


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
        *("cfnav_ros.bringup", "robot", "--params", str(FILES[0]), "--bag", str(tmp_path / "bag")),
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
        *("cfnav_ros.bringup", "simulation", "--params", str(CONFIG / "simulation.yaml")),
        *("--room", "bathroom:20", "--goal", "Sink", "--namespace", "robot1"),
        *("--bundle", str(eager_bundle), "--bag", str(tmp_path / "bag")),
        *("--logs", str(tmp_path / "logs")),
    )
    process.wait_for_line("^policy_node: .*Looking for Sink", 120)
    process.wait_for_line("^policy_node: .*Sending TwistStamped to /robot1/cmd_vel", 60)
    process.wait_for_line("^policy_node: .*Sink: done", 120)
    assert process.interrupt() == 0, process.output
    recorded = counts(tmp_path / "bag")
    for topic in ("scan", "odom", "oakd/rgb/preview/image_raw", "collision/estimate"):
        assert recorded[f"/robot1/{topic}"] > 0, topic
    sent = velocities(tmp_path / "bag")
    assert max(v for v, _ in sent) > 0.1
    assert sent[-1] == (0.0, 0.0)


def stock_robot(start_process: Callable, *parameters: str) -> None:
    """Start a TurtleBot 4 as sold: its camera, and system time."""
    given = ("room:=bathroom:20", "camera:=preview", "clock:=system", *parameters)
    arguments = [word for parameter in given for word in ("-p", parameter)]
    mock = start_process("sim_bridge.mock_turtlebot4", "--ros-args", *arguments)
    mock.wait_for_line("^mock_turtlebot4 ready", 120)


def test_a_docked_robot_is_refused_with_a_sentence(
    start_process: Callable, eager_bundle: Path, tmp_path: Path
) -> None:
    stock_robot(start_process, "docked:=true")
    process = start_process(
        *("cfnav_ros.bringup", "robot", "--params", str(CONFIG / "turtlebot4_stock.yaml")),
        *("--goal", "Sink", "--bundle", str(eager_bundle), "--logs", str(tmp_path / "logs")),
    )
    told = process.wait_for_line("^policy_node: .*Sink: refused after 0 decisions. (.*)$", 120)
    assert told[1] == "The robot sits on its dock: undock it first."
    assert process.interrupt() == 0


@pytest.fixture
def wait_until_driving(ros_domain_id: int) -> Iterator[Callable[[], None]]:
    """A function that returns when the odometry of the test's domain says that it drives."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    node = Node("passer_by", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    speeds = [0.0]
    node.create_subscription(
        Odometry, "odom", lambda m: speeds.append(m.twist.twist.linear.x), qos_profile_sensor_data
    )

    def driving() -> bool:
        executor.spin_once(timeout_sec=0.1)
        return speeds[-1] > 0.1

    yield lambda: wait_until(driving, "a robot that drives", 120)
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def test_ctrl_c_while_a_robot_drives_stands_it_still(
    start_process: Callable, eager_bundle: Path, wait_until_driving: Callable, tmp_path: Path
) -> None:
    stock_robot(start_process)
    file = str(CONFIG / "turtlebot4_stock.yaml")
    process = start_process(
        *("cfnav_ros.bringup", "robot", "--params", file, "--goal", "Sink"),
        *("--bundle", str(eager_bundle), "--bag", str(tmp_path / "bag")),
        *("--logs", str(tmp_path / "logs")),
    )
    process.wait_for_line("^recorder_node: recording /cmd_vel", 120)
    wait_until_driving()
    assert process.interrupt() == 0, process.output
    assert "Sink: aborted" in process.output
    assert "The policy node was stopped." in process.output
    sent = velocities(tmp_path / "bag")
    assert "/clock" not in [topic for topic, count in counts(tmp_path / "bag").items() if count]
    assert len(sent) >= 8  # half a second at 20 Hz, less what a busy machine loses
    assert set(sent[-8:]) == {(0.0, 0.0)}


def test_bringup_ends_when_a_node_dies(
    start_process: Callable, eager_bundle: Path, tmp_path: Path
) -> None:
    process = start_process(
        *("cfnav_ros.bringup", "simulation", "--params", str(CONFIG / "simulation.yaml")),
        *("--room", "bathroom:20", "--bundle", str(eager_bundle), "--logs", str(tmp_path / "logs")),
    )
    process.wait_for_line("^lidar_collision_node: .*Judging", 120)
    process.wait_for_line("^policy_node: .*Bundle eager", 120)
    os.kill(pid_of("lidar_collision_node", process.process.pid), signal.SIGKILL)
    assert process.wait() == 1
    assert "bringup: lidar_collision_node ended with code -9" in process.output
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
