"""A robot behind a Fast DDS discovery server, set up as the TurtleBot 4 manual says.

The robot's services are plain clients of the server, the computer's shells super clients.
"""

from __future__ import annotations

import json
import shutil
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.process.domains import Domain  # noqa: E402

from tests.conftest import DEADLINE_S, ROOT  # noqa: E402

PARAMETERS = ROOT / "ros_ws/src/cfnav_bringup/config/robot.yaml"


@pytest.fixture
def server(start_process: Callable, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of a server on this machine, and this shell as one of its super clients."""
    program = shutil.which("fast-discovery-server")
    if program is None:
        pytest.skip("fast-discovery-server is not installed: run 'make setup'")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    start_process(Path(program), "-i", "0", "-l", "127.0.0.1", "-p", port).wait_for_line("running")
    address = f"127.0.0.1:{port};"
    monkeypatch.setenv("ROS_DISCOVERY_SERVER", address)
    monkeypatch.setenv("ROS_SUPER_CLIENT", "True")
    return address


def test_a_robot_drives_and_plain_clients_of_whatever_domain_are_seen_and_end_the_drive(
    server: str, start_process: Callable, make_bundle: Callable, ros_domain_id: int, tmp_path: Path
) -> None:
    # in lock step, as system time would make a busy machine's late odometry end the drive
    robot = (
        *("robot:=turtlebot4", "room:=bathroom:20", "camera:=stock_preview"),
        *("lock_step:=true", "speed:=0.0"),
    )
    start_process(
        "sim_bridge.ros.mock_turtlebot4",
        *("--ros-args", *(word for parameter in robot for word in ("-p", parameter))),
        ROS_SUPER_CLIENT="False",
    ).wait_for_line("^mock_turtlebot4 ready")
    mine = tmp_path / "mine.yaml"
    settings = yaml.safe_load(PARAMETERS.read_text())
    for node in settings.values():
        node["ros__parameters"]["use_sim_time"] = True
    settings["/**/policy_node"]["ros__parameters"] |= {"lock_step": True, "other_camera": True}
    mine.write_text(yaml.safe_dump(settings))
    bringup = ("--params", str(mine), "--bundle", str(make_bundle("MoveAhead", "RotateLeft")))
    start_process(
        *("cfnav.cli", "robot", "--robot", "turtlebot4", *bringup),
        *("--logs", str(tmp_path / "logs")),
    )
    with Domain() as another:
        people = start_process(
            "tests.ros.live.people_behind_a_server", server, str(ros_domain_id), str(another)
        )
        # each wait of theirs ends within DEADLINE_S and says what for
        assert people.wait(6 * DEADLINE_S) == 0, people.output
    drive, velocity, scan = (
        json.loads(line) for line in people.output.splitlines() if line.startswith('["')
    )
    assert (drive[0], drive[2] > 0.1) == ("step_limit", True), drive
    assert (velocity[0], scan[0]) == ("aborted", "aborted")
    assert velocity[1] == "rival also publishes on /cmd_vel: stop it, one node must drive."
    assert scan[1].startswith("2 nodes publish /scan (")


def test_a_plain_client_refuses_the_goal_and_says_what_cures_it(
    server: str, start_process: Callable, make_bundle: Callable
) -> None:
    policy = start_process(
        "cfnav_ros.ros.policy_node", "--ros-args", "-p", f"bundle:={make_bundle('MoveAhead')}",
        "-p", "goal:=Laptop", ROS_SUPER_CLIENT="False",
    )  # fmt: skip
    told = policy.wait_for_line(r"Laptop: refused after 0 decisions\. (.*)$")
    assert told[1].startswith("ROS_DISCOVERY_SERVER is set without ROS_SUPER_CLIENT, ")
    assert "`export ROS_SUPER_CLIENT=True`" in told[1]
