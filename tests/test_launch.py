"""The launch files: run by the real launch where it can be imported, read where it cannot.

The nodes are stand-ins in an ament prefix of the test: they write down how they were started. That
the nodes understand these arguments is held by tests/ros/live/test_bringup.py.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import tyro
import yaml
from cfnav_ros.bags.files.playing import PlayOptions

from cfnav_core.robot.robot import SHIPPED
from tests.conftest import ROOT, RunningProcess, wait_until

BRINGUP = ROOT / "ros_ws/src/cfnav_bringup"
FILES = sorted((BRINGUP / "launch").glob("*.launch.py"))
DOCUMENTS = ("README.md", "docs/robot.md", *(str(p.relative_to(ROOT)) for p in FILES))

STAND_IN = """#!{python}
import json, os, signal, sys
from pathlib import Path
settings = {{k: v for k, v in os.environ.items() if k.startswith(("ROS_", "FASTRTPS_"))}}
begun = {{"pid": os.getpid(), "arguments": sys.argv[1:], "environment": settings}}
files = [a for a in sys.argv if a.endswith((".yaml", ".yml")) or "launch_params" in a]
begun["files"] = [Path(f).read_text() for f in files]
signal.signal(signal.SIGINT, lambda *_: sys.exit(0))
with open({log!r}, "a") as file:
    file.write(json.dumps(begun) + "\\n")
while True:
    signal.pause()
"""

LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
service = LaunchService()
given = [tuple(argument.split(":=", 1)) for argument in sys.argv[2:]]
service.include_launch_description(
    LaunchDescription([IncludeLaunchDescription(sys.argv[1], launch_arguments=given)])
)
sys.exit(service.run())
"""

EXECUTABLES = {
    "cfnav_ros": (
        *("lidar_collision_node", "policy_node", "recorder_node", "markers_node", "bag_play"),
    ),
    "sim_bridge": ("mock_turtlebot4",),
    "tf2_ros": ("static_transform_publisher",),
    "rviz2": ("rviz2",),
}


def arguments_of(file: Path) -> set[str]:
    """Names of the launch arguments that a file declares."""
    calls = [n for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.Call)]
    names = [c.args[0] for c in calls if getattr(c.func, "id", "") == "DeclareLaunchArgument"]
    return {name.value for name in names if isinstance(name, ast.Constant)}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_launch_file_is_python_with_arguments(file: Path) -> None:
    compile(file.read_text(), str(file), "exec")
    assert {"robot", "params", "namespace", "bundle", "goal", "rviz"} <= arguments_of(file)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_what_documents_launch_has_these_arguments(document: str) -> None:
    text = (ROOT / document).read_text()
    commands = re.findall(r"ros2 launch cfnav_bringup (\S+)([^`\n]*)", text)
    assert commands
    for name, rest in commands:
        file = BRINGUP / "launch" / name
        assert set(re.findall(r"(\w+):=", rest)) <= arguments_of(file), (name, rest)


class Launched:
    """A launch under way and what its stand-ins wrote down."""

    def __init__(self, process: RunningProcess, folder: Path) -> None:
        self.process = process
        self._folder = folder

    def starts(self, name: str) -> list[dict]:
        """How an executable was started, each time."""
        log = self._folder / name
        return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []

    def start(self, name: str, times: int = 1) -> dict:
        """The newest start of an executable; waits for it."""

        def begun() -> bool:
            assert self.process.process.poll() is None, self.process.output
            return len(self.starts(name)) >= times

        wait_until(begun, f"start {times} of {name}")
        return self.starts(name)[-1]


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """An ament prefix with the package under test and stand-ins for every node."""
    index = tmp_path / "prefix/share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    shutil.copytree(BRINGUP, tmp_path / "prefix/share/cfnav_bringup")
    (index / "cfnav_bringup").touch()
    (tmp_path / "starts").mkdir()
    places: list[tuple[str, Path]] = []
    for package, names in EXECUTABLES.items():
        (index / package).touch()
        places += [(name, tmp_path / "prefix/lib" / package / name) for name in names]
    for name, place in places:
        place.parent.mkdir(parents=True, exist_ok=True)
        log = str(tmp_path / "starts" / name)
        place.write_text(STAND_IN.format(python=sys.executable, log=log))
        place.chmod(0o755)
    return tmp_path / "prefix"


@pytest.fixture
def launch(prefix: Path, tmp_path: Path) -> Iterator[Callable[..., Launched]]:
    """A function: launch file, arguments -> the launch under way."""
    if importlib.util.find_spec("launch") is None:
        pytest.skip("launch is not on PyPI: it is here where ROS 2 comes from apt")
    running: list[RunningProcess] = []

    def run(file: str, *arguments: str, **variables: str) -> Launched:
        environment = {
            **os.environ,
            "AMENT_PREFIX_PATH": str(prefix),
            "ROS_LOG_DIR": str(tmp_path / "log"),
            **variables,
        }
        path = prefix / "share/cfnav_bringup/launch" / file
        command = [sys.executable, "-c", LAUNCH, str(path), *arguments]
        running.append(RunningProcess(command, tmp_path / "launch.log", environment))
        return Launched(running[-1], tmp_path / "starts")

    yield run
    for process in running:
        process.process.kill()  # the stand-ins end with it: that is tested below
        process.wait()


def parameters(start: dict, node: str) -> dict:
    """The parameters of a node in the order in which rcl takes them: later files win."""
    found: dict = {}
    for text in start["files"]:
        for name, body in yaml.safe_load(text).items():
            if name in ("/**", f"/**/{node}"):
                found |= body["ros__parameters"]
    return found


def test_robot_starts_both_nodes_with_the_file_and_what_was_given(launch: Callable) -> None:
    run = launch(
        *("robot.launch.py", "robot:=turtlebot4_mast", "namespace:=robot1"),
        *("goal:=Laptop", "bundle:=/somewhere"),
        ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET",
        ROS_DOMAIN_ID="7",
    )
    policy, lidar = run.start("policy_node"), run.start("lidar_collision_node")
    given = parameters(policy, "policy_node")
    assert (given["goal"], given["bundle"]) == ("Laptop", "/somewhere")
    assert (given["robot"], given["allow_robot"]) == ("turtlebot4_mast", True)
    judged = parameters(lidar, "lidar_collision_node")
    assert judged["robot"] == "turtlebot4_mast"
    assert "goal" not in judged
    for start in (policy, lidar):
        assert "__ns:=/robot1" in start["arguments"]
        assert {"/tf:=tf", "/tf_static:=tf_static"} <= set(start["arguments"])
        assert start["environment"]["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"
        assert start["environment"]["ROS_DOMAIN_ID"] == "7"
    mast = run.start("static_transform_publisher")["arguments"]
    assert mast[:2] == ["--z", "1.3"]
    file = Path(run.process.wait_for_line("parameters of (.+)$")[1])
    assert file.read_text() == (BRINGUP / "config/robot.yaml").read_text()
    assert not run.starts("rviz2")


def test_only_what_was_given_overrides_the_file(launch: Callable) -> None:
    robot = SHIPPED / "turtlebot4_lite.yaml"
    run = launch("robot.launch.py", f"robot:={robot}", f"params:={BRINGUP / 'config/robot.yaml'}")
    policy = run.start("policy_node")
    given = parameters(policy, "policy_node")
    assert (given["goal"], given["robot"]) == ("", str(robot))
    assert not {"bundle", "wait_for_recorder", "use_sim_time"} & set(given)
    assert not run.starts("static_transform_publisher")


def test_the_lidar_node_comes_back_and_the_velocity_owner_ends_everything(launch: Callable) -> None:
    run = launch("robot.launch.py", "robot:=turtlebot4_mast")
    policy, lidar = run.start("policy_node"), run.start("lidar_collision_node")
    os.kill(lidar["pid"], signal.SIGKILL)
    run.start("lidar_collision_node", times=2)
    os.kill(policy["pid"], signal.SIGKILL)
    run.process.wait()
    assert re.search(r"policy_node-\d+\] was required", run.process.output)
    assert len(run.starts("policy_node")) == 1


def interrupt(pids: list[int]) -> None:
    for pid in pids:
        os.kill(pid, signal.SIGINT)


def test_ctrl_c_in_a_terminal_ends_it_cleanly(launch: Callable) -> None:
    run = launch("robot.launch.py", "robot:=turtlebot4_mast")
    nodes = [run.start(name)["pid"] for name in ("policy_node", "lidar_collision_node")]
    run.process.wait_for_line("policy_node-.*started")
    interrupt([run.process.process.pid, *nodes])  # as a terminal does: the whole group
    assert run.process.wait() == 0
    assert run.process.output.count("has finished cleanly") == 2


@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGKILL])
def test_nodes_end_with_a_launch_that_is_killed(launch: Callable, sign: int) -> None:
    run = launch("simulation.launch.py")
    names = ("mock_turtlebot4", "policy_node", "lidar_collision_node")
    nodes = [run.start(name)["pid"] for name in names]
    run.process.process.send_signal(sign)
    run.process.wait()
    for pid in nodes:
        wait_until(lambda pid=pid: not Path(f"/proc/{pid}/exe").exists(), "the end of a node")


def test_a_parameter_file_that_is_not_there_is_a_sentence(launch: Callable) -> None:
    run = launch("robot.launch.py", "robot:=turtlebot4", "params:=turtlebot3.yaml")
    assert run.process.wait() == 1
    assert "params is 'turtlebot3.yaml', expected a file or one of robot" in run.process.output


def test_a_robot_that_is_not_there_is_a_sentence(launch: Callable) -> None:
    run = launch("robot.launch.py", "robot:=tank")
    assert run.process.wait() == 1
    assert "robot is 'tank', expected a file or one of differential" in run.process.output


def test_simulation_stays_on_this_machine(launch: Callable) -> None:
    run = launch(
        *("simulation.launch.py", "room:=kitchen:25", "speed:=2", "seed:=3", "goal:=Fridge"),
        *("faults:=/some/faults.yaml", "rviz:=true"),
        ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET",
        ROS_DISCOVERY_SERVER="192.168.0.1:11811",
    )
    mock, policy = run.start("mock_turtlebot4"), run.start("policy_node")
    given = parameters(mock, "mock_turtlebot4")
    assert (given["room"], given["speed"], given["seed"]) == ("kitchen:25", 2.0, 3)
    assert given["faults"] == "/some/faults.yaml"
    assert parameters(policy, "policy_node")["goal"] == "Fridge"
    assert parameters(policy, "policy_node")["allow_robot"] is False
    assert parameters(policy, "policy_node")["use_sim_time"] is True
    for start in (mock, policy, run.start("lidar_collision_node")):
        assert start["environment"]["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
        assert "ROS_DISCOVERY_SERVER" not in start["environment"]
    run.start("markers_node")
    layout = run.start("rviz2")["arguments"][1]
    assert Path(layout).name == "cfnav.rviz"
    assert Path(layout).is_file()


def test_a_recorded_drive_names_its_bag(launch: Callable, tmp_path: Path) -> None:
    run = launch(
        *("evaluation.launch.py", "mode:=record", f"bag:={tmp_path}/drive"),
        *("robot:=turtlebot4", "goal:=Laptop"),
    )
    recorder = run.start("recorder_node")
    assert parameters(recorder, "recorder")["bag"] == f"{tmp_path}/drive"
    given = parameters(run.start("policy_node"), "policy_node")
    assert (given["goal"], given["wait_for_recorder"]) == ("Laptop", True)
    os.kill(recorder["pid"], signal.SIGKILL)
    run.process.wait()
    assert re.search(r"recorder_node-\d+\] was required", run.process.output)


def test_a_replay_commands_nobody(launch: Callable) -> None:
    run = launch(
        *("evaluation.launch.py", "mode:=replay", "bag:=drive", "namespace:=robot1"),
        "robot:=turtlebot4",
        ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET",
        ROS_STATIC_PEERS="10.0.0.2",
        ROS_DOMAIN_ID="7",
    )
    player, lidar = run.start("bag_play"), run.start("lidar_collision_node")
    options = tyro.cli(PlayOptions, args=player["arguments"])
    assert options == PlayOptions(
        Path("drive"), robot="turtlebot4", namespace="robot1", wait_for=("scan",)
    )
    assert "__ns:=/robot1" in lidar["arguments"]
    assert parameters(lidar, "lidar_collision_node")["use_sim_time"] is True
    for start in (player, lidar):
        assert start["environment"]["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
        assert "ROS_STATIC_PEERS" not in start["environment"]
    assert lidar["environment"]["ROS_DOMAIN_ID"] == options.domain == "99"
    assert player["environment"]["ROS_DOMAIN_ID"] == "7"  # so that it keeps away from there, too
    assert not run.starts("policy_node")
    assert not run.starts("recorder_node")


@pytest.mark.parametrize("domain", ["7", "elsewhere", "233"])
def test_a_replay_in_the_domain_of_the_shell_is_refused(launch: Callable, domain: str) -> None:
    run = launch(
        *("evaluation.launch.py", "mode:=replay", "bag:=drive", f"domain:={domain}"),
        "robot:=turtlebot4",
        ROS_DOMAIN_ID="7",
    )
    assert run.process.wait() == 1
    assert f"domain is '{domain}', expected 0 to 101 but not 7" in run.process.output
    assert not run.starts("bag_play")
