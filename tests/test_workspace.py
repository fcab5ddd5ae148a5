"""The built workspace: interfaces, executables, the transport, versions, whose sources run."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
import tomllib
from pathlib import Path

import pytest

from tests.conftest import ROOT


@pytest.mark.ros
@pytest.mark.parametrize("package", ["cfnav_interfaces", "irobot_create_msgs", "tf2_msgs"])
def test_the_interfaces_are_built(package):
    module = pytest.importorskip(f"{package}.msg", reason="ros_ws is not built: run 'make setup'")
    assert [name for name in dir(module) if name[0].isupper()]


@pytest.mark.ros
@pytest.mark.parametrize(
    "name",
    [
        "launch/robot.launch.py",
        "launch/simulation.launch.py",
        "launch/evaluation.launch.py",
        "config/turtlebot4_stock.yaml",
        "rviz/cfnav.rviz",
        "foxglove/cfnav.json",
    ],
)
def test_colcon_installs_the_bringup_files(name):
    assert (ROOT / "ros_ws/install/cfnav_bringup/share/cfnav_bringup" / name).is_file()


EXECUTABLES = [
    ("cfnav_ros", "policy_node"),
    ("cfnav_ros", "lidar_collision_node"),
    ("cfnav_ros", "recorder_node"),
    ("cfnav_ros", "bringup"),
    ("cfnav_ros", "lidar_mask"),
    ("cfnav_ros", "markers_node"),
    ("cfnav_ros", "bag_eval"),
    ("cfnav_ros", "demo"),
    ("sim_bridge", "mock_turtlebot4"),
    ("sim_bridge", "dataset"),
]


@pytest.mark.ros
@pytest.mark.parametrize(("package", "name"), EXECUTABLES)
def test_colcon_installs_the_executable(package, name):
    program = ROOT / "ros_ws/install" / package / "lib" / package / name
    assert os.access(program, os.X_OK)
    assert importlib.util.find_spec(f"{package}.{name}")


PARTICIPANT = """#!{python}
import rclpy
from rclpy.executors import ExternalShutdownException
rclpy.init()
node = rclpy.create_node("participant")
print("domain", node.context.get_domain_id(), flush=True)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    print("interrupted", flush=True)
"""


@pytest.mark.ros
def test_a_process_gets_the_transport_profile_and_its_own_domain(
    start_process, ros_domain_id, tmp_path
):
    script = tmp_path / "participant"
    script.write_text(PARTICIPANT.format(python=sys.executable))
    script.chmod(0o755)
    process = start_process(script)
    assert process.wait_for_line(r"^domain (\d+)$")[1] == str(ros_domain_id)
    maps = Path(f"/proc/{process.process.pid}/maps").read_text()
    segments = re.findall(r"^(\w+)-(\w+) .* /dev/shm/fastrtps_[0-9a-f]+$", maps, re.MULTILINE)
    assert max(int(end, 16) - int(begin, 16) for begin, end in segments) >= 16 * 2**20
    assert process.interrupt() == 0
    assert "interrupted" in process.output


def test_all_packages_have_the_same_version():
    with (ROOT / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    for package in ("cfnav_core", "cfnav_ros", "sim_bridge"):
        assert f"<version>{version}</version>" in (ROOT / package / "package.xml").read_text()
        assert f'version="{version}"' in (ROOT / package / "setup.py").read_text()
    for package in ("cfnav_interfaces", "cfnav_bringup"):
        about = ROOT / "ros_ws/src" / package / "package.xml"
        assert f"<version>{version}</version>" in about.read_text()


def test_the_sources_come_before_colcons_copies():
    import cfnav_core
    import cfnav_ros
    import sim_bridge

    assert Path(cfnav_core.__file__).parent == ROOT / "cfnav_core"
    assert Path(cfnav_ros.__path__[0]) == ROOT / "cfnav_ros/cfnav_ros"
    assert Path(sim_bridge.__path__[0]) == ROOT / "sim_bridge/sim_bridge"
