"""The arrows between the packages, and ROS only at the edge."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {
    "cfnav_core": ROOT / "cfnav_core",
    "cfnav_ros": ROOT / "cfnav_ros/cfnav_ros",
    "sim_bridge": ROOT / "sim_bridge/sim_bridge",
}
MAY_NOT_IMPORT = {
    "cfnav_core": {"cfnav_ros", "sim_bridge", "mujoco"},
    "cfnav_ros": {"sim_bridge", "mujoco", "torch"},
    "sim_bridge": {"cfnav_ros"},
}
ROS = {"rclpy", "cfnav_interfaces", "geometry_msgs", "irobot_create_msgs", "nav_msgs"}
ROS |= {"rosgraph_msgs", "sensor_msgs", "std_msgs", "tf2_msgs", "action_msgs", "rcl_interfaces"}
ROS |= {"diagnostic_msgs", "std_srvs", "visualization_msgs"}
ROS_FILES = {"mock_turtlebot4.py", "conversions.py", "parameters.py", "graph.py", "recorder.py"}
ROS_FILES |= {
    "bag_play.py",
    "bag_player.py",
    "bench.py",
    "goals.py",
    "node_process.py",
    "senses.py",
    "spinning.py",
    "velocity.py",
}
# A robot needs none of these: only what trains or exports may import torch.
TORCH_FREE = (
    "cfnav_core.policy", "cfnav_core.perception", "cfnav_core.bundle", "cfnav_core.cli",
    "cfnav_core.metrics", "cfnav_core.bench_policy", "sim_bridge.world",
)  # fmt: skip

LOAD = """
import importlib, json, sys
forbidden, names = set(sys.argv[1].split(",")), sys.argv[2:]
for name in names:
    importlib.import_module(name)
    found = forbidden & {loaded.split(".")[0] for loaded in sys.modules}
    if found:
        sys.exit(f"importing {name} loads {sorted(found)}")
print(len(names))
"""


def files(package: str) -> list[Path]:
    found = FOLDERS[package].rglob("*.py")
    return sorted(p for p in found if p.name != "setup.py" and "resource" not in p.parts)


def module(package: str, path: Path) -> str:
    inside = path.relative_to(FOLDERS[package]).with_suffix("")
    return ".".join([package, *(part for part in inside.parts if part != "__init__")])


def is_at_the_edge(path: Path) -> bool:
    return path.name.endswith("_node.py") or path.name in ROS_FILES


def imported(path: Path) -> set[str]:
    """Top-level names of every import statement, also of those inside functions."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module.split(".")[0])
    return names


EVERY_FILE = [(package, path) for package in FOLDERS for path in files(package)]
IDS = [module(package, path) for package, path in EVERY_FILE]


def test_every_package_has_modules():
    assert all(len(files(package)) > 3 for package in FOLDERS)


@pytest.mark.parametrize(("package", "path"), EVERY_FILE, ids=IDS)
def test_import_statements_follow_the_arrows(package, path):
    names = imported(path)
    assert not names & MAY_NOT_IMPORT[package]
    if not is_at_the_edge(path):
        assert not names & ROS, "ROS stands at the edge: see the rules in ARCHITECTURE.md"


def load(forbidden: set[str], *names: str) -> subprocess.CompletedProcess[str]:
    """Imports the modules one after the other in a fresh process."""
    command = [sys.executable, "-c", LOAD, ",".join(sorted(forbidden)), *names]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("package", FOLDERS)
def test_importing_what_is_pure_loads_no_ros(package):
    names = [module(package, p) for p in files(package) if not is_at_the_edge(p)]
    done = load({"rclpy"} | MAY_NOT_IMPORT[package], *names)
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) == len(names)


def test_the_check_finds_what_it_looks_for():
    done = load({"numpy"}, "cfnav_core.actions", "cfnav_core.perception")
    assert done.returncode == 1
    assert "loads ['numpy']" in done.stderr


def test_a_robot_loads_no_torch():
    done = load({"torch"}, *TORCH_FREE)
    assert (done.returncode, done.stderr) == (0, "")
