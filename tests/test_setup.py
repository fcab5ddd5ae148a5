"""The set-up: stamps, interruptions, the wheels' CMake files, what the machine lacks."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = ROOT / "scripts"


def wait_until(condition, what, timeout_s=60.0):
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, f"not within {timeout_s:.0f} s: {what}"
        time.sleep(0.02)


@pytest.fixture(scope="module", autouse=True)
def scripts_importable():
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture
def steps():
    return importlib.import_module("steps")


@pytest.fixture
def environment():
    return importlib.import_module("environment")


@pytest.fixture
def system():
    return importlib.import_module("system")


@pytest.fixture
def mend_wheels():
    return importlib.import_module("mend_wheels")


class Counted:
    """A step whose runs are counted; it makes its product from its input."""

    def __init__(self, steps, folder: Path) -> None:
        self.runs = self.undone = 0
        self.source, self.product = folder / "source", folder / "product"
        self.source.write_text("one")
        self.failure: BaseException | None = None
        self.step = steps.Step(
            "copy", "Copying", self.product, [self.source, "word"], self.run, self.undo
        )

    def run(self) -> None:
        self.runs += 1
        self.product.write_text("half")
        if self.failure is not None:
            raise self.failure
        self.product.write_text(self.source.read_text())

    def undo(self) -> None:
        self.undone += 1
        self.product.unlink(missing_ok=True)


@pytest.fixture
def counted(steps, tmp_path):
    return Counted(steps, tmp_path)


def ensure(steps, tmp_path, counted):
    """One run of the set-up: a new process knows nothing but the stamps."""
    stamps = steps.Stamps(tmp_path / "stamps")
    stamps.recover([counted.step])
    return stamps.ensure(counted.step, lambda line: None)


def test_a_step_runs_once(steps, tmp_path, counted):
    assert [ensure(steps, tmp_path, counted) for _ in range(3)] == [True, False, False]
    assert counted.runs == 1


def test_a_changed_input_runs_it_again(steps, tmp_path, counted):
    ensure(steps, tmp_path, counted)
    counted.source.write_text("two")
    assert ensure(steps, tmp_path, counted)
    assert counted.product.read_text() == "two"


def test_a_lost_product_runs_it_again(steps, tmp_path, counted):
    ensure(steps, tmp_path, counted)
    counted.product.unlink()
    assert ensure(steps, tmp_path, counted)


def test_an_interrupted_step_is_undone_and_done_afresh(steps, tmp_path, counted):
    counted.failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        ensure(steps, tmp_path, counted)
    assert counted.product.read_text() == "half"
    counted.failure = None
    assert ensure(steps, tmp_path, counted)
    assert (counted.undone, counted.product.read_text()) == (1, "one")
    assert not ensure(steps, tmp_path, counted)


def test_a_killed_step_with_an_old_stamp_is_not_taken_for_done(steps, tmp_path, counted):
    ensure(steps, tmp_path, counted)
    counted.source.write_text("two")
    counted.failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        ensure(steps, tmp_path, counted)
    counted.source.write_text("one")  # the inputs of the old stamp again
    counted.failure = None
    assert ensure(steps, tmp_path, counted)
    assert counted.product.read_text() == "one"


def test_a_failed_step_is_tried_again_without_undoing(steps, tmp_path, counted):
    counted.failure = steps.SetupError("no network")
    with pytest.raises(steps.SetupError):
        ensure(steps, tmp_path, counted)
    counted.failure = None
    assert ensure(steps, tmp_path, counted)
    assert counted.undone == 0


def test_the_digest_sees_names_and_contents_but_not_caches(steps, tmp_path):
    (tmp_path / "a").write_text("x")
    before = steps.digest([tmp_path])
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__/a.pyc").write_text("compiled")
    assert steps.digest([tmp_path]) == before
    (tmp_path / "a").rename(tmp_path / "b")
    renamed = steps.digest([tmp_path])
    (tmp_path / "b").write_text("y")
    assert len({before, renamed, steps.digest([tmp_path])}) == 3


EXPORT = (
    'INTERFACE_INCLUDE_DIRECTORIES "/opt/python/cp311-cp311/include/python3.11;'
    '/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include"\n'
    'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs__rosidl_generator_c"\n'
)


def test_the_builders_folders_are_replaced_and_nothing_else(mend_wheels):
    mended = mend_wheels.mend_text(EXPORT, "/usr/include/python3.11", "/venv/numpy/include")
    assert mended == (
        'INTERFACE_INCLUDE_DIRECTORIES "/usr/include/python3.11;/venv/numpy/include"\n'
        'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs__rosidl_generator_c"\n'
    )
    assert mend_wheels.mend_text(mended, "/other", "/other") == mended


def test_mending_twice_changes_files_once(mend_wheels, tmp_path):
    cmake = tmp_path / "std_msgs/cmake"
    cmake.mkdir(parents=True)
    (cmake / "export.cmake").write_text(EXPORT)
    (cmake / "other.cmake").write_text("set(x 1)\n")
    assert mend_wheels.mend_files(tmp_path, "/inc", "/np") == 1
    assert mend_wheels.mend_files(tmp_path, "/inc", "/np") == 0
    assert sorted(p.name for p in cmake.iterdir()) == ["export.cmake", "other.cmake"]


def test_an_unknown_folder_of_the_builder_is_said(mend_wheels, tmp_path):
    cmake = tmp_path / "rcl/cmake"
    cmake.mkdir(parents=True)
    (cmake / "export.cmake").write_text('set(LIB "/opt/python/cp311-cp311/lib/libx.so")\n')
    with pytest.raises(ValueError, match=re.escape("(/opt/python/cp311-cp311/lib/libx.so")):
        mend_wheels.mend_files(tmp_path, "/inc", "/np")


@pytest.mark.ros
def test_the_installed_wheels_are_mended(environment):
    if environment.find_ros({}) != environment.WHEELS:
        return  # the ROS of this machine was built on it
    exports = list((environment.VENV / "share").glob("*/cmake/*rosidl_generator_pyExport.cmake"))
    assert exports
    assert not [p for p in exports if "/opt/python/" in p.read_text()]


@pytest.fixture
def bare_machine(system, monkeypatch):
    """A machine with Python only: no compiler, no OpenGL."""
    monkeypatch.setattr(system.shutil, "which", {"apt-get": "/usr/bin/apt-get"}.get)
    monkeypatch.setattr(system, "loads", lambda *libraries: False)
    return monkeypatch


def no_run(command, failure):
    raise AssertionError(f"must not run {command}")


def test_without_root_one_line_says_what_to_install(system, steps, bare_machine):
    bare_machine.setattr(system.os, "geteuid", lambda: 1000)
    with pytest.raises(steps.SetupError) as error:
        system.install_missing(no_run, print)
    line = str(error.value)
    assert "\n" not in line
    assert "a C++ compiler" in line
    assert re.search(r"`sudo apt-get install [^`]*g\+\+[^`]*libosmesa6`", line)


def test_without_apt_one_line_names_the_things(system, steps, bare_machine):
    bare_machine.setattr(system.shutil, "which", lambda name: None)
    with pytest.raises(steps.SetupError, match=r"no apt-get here.*Debian they are g\+\+"):
        system.install_missing(no_run, print)


def test_as_root_apt_installs_exactly_what_is_missing(system, steps, bare_machine):
    bare_machine.setattr(system.os, "geteuid", lambda: 0)
    commands = []

    def install(command, failure):
        commands.append(command)
        if "install" in command:
            bare_machine.setattr(system.shutil, "which", lambda name: f"/usr/bin/{name}")
            bare_machine.setattr(system, "loads", lambda *libraries: True)

    system.install_missing(install, print)
    assert [("update" in c, "install" in c) for c in commands] == [(True, False), (False, True)]
    assert {"g++", "libosmesa6"} <= set(commands[1])
    system.install_missing(no_run, print)


def test_nothing_is_installed_when_apt_did_not_help(system, steps, bare_machine):
    bare_machine.setattr(system.os, "geteuid", lambda: 0)
    with pytest.raises(steps.SetupError, match="Missing on this machine: a C"):
        system.install_missing(lambda command, failure: None, print)


@pytest.mark.parametrize("version", [(3, 10), (3, 13)])
def test_another_python_is_refused(system, steps, version):
    with pytest.raises(steps.SetupError, match=f"Found Python 3.{version[1]}; cfnav needs 3.11"):
        system.check_python(version)


def test_a_sourced_jazzy_is_used_and_another_ros_refused(environment, steps, tmp_path, monkeypatch):
    monkeypatch.setattr(environment, "ROS_FILE", tmp_path / "none")
    package = tmp_path / "ros/share/rclpy/package.xml"
    package.parent.mkdir(parents=True)
    package.write_text("<package/>")
    sourced = {"AMENT_PREFIX_PATH": f"/nowhere:{tmp_path / 'ros'}", "ROS_DISTRO": "jazzy"}
    assert environment.find_ros(sourced) == str(tmp_path / "ros")
    assert environment.find_ros({}) == environment.WHEELS
    with pytest.raises(steps.SetupError, match="Found ROS 'humble' sourced"):
        environment.find_ros({**sourced, "ROS_DISTRO": "humble"})
    (tmp_path / "ros/pyvenv.cfg").write_text("")  # a virtual environment with the wheels
    assert environment.find_ros(sourced) == environment.WHEELS


@pytest.fixture
def checkout(tmp_path):
    """A copy of the set-up files, as after a clone."""
    for name in ("scripts", "requirements"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Makefile", tmp_path)
    return tmp_path


def test_a_shell_in_a_fresh_clone_is_told_to_set_up(checkout):
    done = subprocess.run(
        ["bash", "-c", "source scripts/env.sh; echo code $?"],
        cwd=checkout, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout == "code 1\n"
    assert f"cfnav is not set up in {checkout}: run 'make setup' there first." in done.stderr


def test_a_failing_command_shows_its_output_and_one_sentence(checkout):
    variables = {**os.environ, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(checkout)}
    variables = {k: v for k, v in variables.items() if k not in ("AMENT_PREFIX_PATH", "ROS_DISTRO")}
    done = subprocess.run(
        ["make", "setup", f"PYTHON={sys.executable}"],
        cwd=checkout, env=variables, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "No matching distribution found" in done.stderr
    assert "Set-up failed: pip could not install the packages (all of its output:" in done.stderr
    assert not (checkout / ".venv/cfnav/packages.stamp").exists()
    assert (checkout / ".venv/cfnav/venv.stamp").exists()


def running(folder):
    """Ids of processes that name the folder on their command line."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes()
        except OSError:  # it has just ended
            continue
        found += [path.parent.name] if str(folder).encode() in words else []
    return found


def test_an_ended_set_up_says_so_and_is_taken_up_afresh(checkout):
    variables = {
        k: v for k, v in os.environ.items() if k not in ("AMENT_PREFIX_PATH", "ROS_DISTRO")
    }
    process = subprocess.Popen(
        [sys.executable, "scripts/set_up.py"],
        cwd=checkout, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert "Virtual environment .venv" in process.stdout.readline()
        wait_until((checkout / ".venv/bin").exists, "the virtual environment has begun")
        wait_until(lambda: running(checkout), "a command runs")
        process.terminate()
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    wait_until(lambda: not running(checkout), "nothing goes on alone")
    assert errors == "Set-up interrupted; the next run starts the interrupted step afresh.\n"
    assert (checkout / ".venv/cfnav/in-progress").read_text() == "venv\n"
    assert not (checkout / ".venv/cfnav/venv.stamp").exists()


@pytest.mark.ros
@pytest.mark.parametrize("package", ["cfnav_interfaces", "irobot_create_msgs", "tf2_msgs"])
def test_the_interfaces_are_built(package):
    module = pytest.importorskip(f"{package}.msg", reason="ros_ws is not built: run 'make setup'")
    assert [name for name in dir(module) if name[0].isupper()]


EXECUTABLES = [
    ("cfnav_ros", "policy_node"),
    ("cfnav_ros", "lidar_collision_node"),
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
    interfaces = ROOT / "ros_ws/src/cfnav_interfaces/package.xml"
    assert f"<version>{version}</version>" in interfaces.read_text()


def test_the_sources_come_before_colcons_copies():
    import cfnav_core
    import cfnav_ros
    import sim_bridge

    assert Path(cfnav_core.__file__).parent == ROOT / "cfnav_core"
    assert Path(cfnav_ros.__path__[0]) == ROOT / "cfnav_ros/cfnav_ros"
    assert Path(sim_bridge.__path__[0]) == ROOT / "sim_bridge/sim_bridge"
