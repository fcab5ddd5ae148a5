"""Starts of the mock TurtleBot 4 that must fail with one sentence, and its end by signals."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_core.robot.robot import SHIPPED as ROBOTS  # noqa: E402
from tests.conftest import wait_until  # noqa: E402
from tests.ros.mock_listener import OTHER_ROOM, ros_arguments  # noqa: E402


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (["room:=cellar:1"], "kitchen"),
        (["rooms:=kitchen:2"], "There is no parameter 'rooms'"),
        (["speed:=fast"], "expected float"),
        (["start:=[0.0, 0.0, 0.0]"], "is not free"),
        (["goal:=Unicorn"], "Unicorn"),
        (["camera:=periscope"], "expected mast, stock_preview, stock_wide, lite or a JSON file"),
        (["camera_size:=7"], "expected 32 to 1920 pixels"),
        (["camera:=stock_wide", "camera_size:=480"], "40.1 degrees down come with 40.1 across"),
        (["noise:=-1.0"], "expected 0 to 10"),
        (["visual_shift:=1.5"], "expected 0 to 1"),
        (["scan_mode:=Boost"], "scan_mode is 'Boost'; expected Sensitivity or Standard."),
        (["robot:=tank"], "robot is 'tank', expected a file or one of differential"),
        (["robot:=differential", "docked:=true"], "the robot differential has no dock"),
        (["robot:=differential", "depth:=true"], "the robot differential has no depth"),
        (["clock:=sundial"], "expected simulated or system"),
        (["clock:=system", "speed:=2.0"], "expected speed 1 and no lock_step"),
        (["faults:=/nowhere.yaml"], "/nowhere.yaml cannot be read"),
    ],
)
def test_bad_parameter_is_one_sentence_and_exit_code_2(start_process, parameters, words):
    process = start_process("sim_bridge.ros.mock_turtlebot4", *ros_arguments(parameters))
    assert process.wait() == 2
    (line,) = process.output.splitlines()
    assert words in line


def test_a_detector_that_says_places_is_not_in_the_mock(start_process, tmp_path):
    text = (ROBOTS / "turtlebot4.yaml").read_text()
    robot = tmp_path / "spatial.yaml"
    robot.write_text(text.replace("topics:\n", "topics:\n  detections: nn/spatial_detections\n"))
    given = [f"robot:={robot}", "detector:=shipped"]
    process = start_process("sim_bridge.ros.mock_turtlebot4", *ros_arguments(given))
    assert process.wait() == 2
    (line,) = process.output.splitlines()
    assert "the robot spatial says boxes with places, the mock only boxes" in line


@pytest.mark.parametrize(
    ("arguments", "words"), [(["--speed"], "--speed is unknown"), (["--ros-args", "-p"], "read")]
)
def test_bad_command_line_is_exit_code_2(start_process, arguments, words):
    process = start_process("sim_bridge.ros.mock_turtlebot4", *arguments)
    assert process.wait() == 2
    assert words in process.output.splitlines()[-1]


def test_missing_gl_library_is_one_sentence_and_exit_code_2(start_process):
    process = start_process(
        "sim_bridge.ros.mock_turtlebot4", MUJOCO_GL="nothing", CFNAV_GL_CHOSEN=""
    )
    assert process.wait() == 2
    (line,) = process.output.splitlines()
    assert "no GL back end that can draw rooms" in line


def test_second_robot_in_the_domain_is_refused(start_process):
    mock = ("sim_bridge.ros.mock_turtlebot4", *ros_arguments([f"room:={OTHER_ROOM}"]))
    start_process(*mock).wait_for_line("ready")
    second = start_process(*mock)
    assert second.wait() == 2
    assert "choose another ROS_DOMAIN_ID" in second.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_cleanly(start_process, number):
    # As fast as it can, so that a signal often comes while OpenGL draws.
    parameters = [f"room:={OTHER_ROOM}", "speed:=0.0"]
    process = start_process("sim_bridge.ros.mock_turtlebot4", *ros_arguments(parameters))
    process.wait_for_line("ready")
    while process.process.poll() is None:  # the later ones hit the clean-up
        process.process.send_signal(number)
        time.sleep(0.01)
    assert process.process.returncode == 0
    assert "Traceback" not in process.output


@pytest.mark.parametrize("library", ["libmujoco", "libOpenGL", "libEGL", "libOSMesa"])
def test_signal_while_a_library_is_imported_ends_it_cleanly(start_process, library):
    process = start_process(
        "sim_bridge.ros.mock_turtlebot4", *ros_arguments([f"room:={OTHER_ROOM}"])
    )
    maps = Path(f"/proc/{process.process.pid}/maps")
    # Not every machine has every library; without it the signal comes at the end of the start.
    wait_until(lambda: library in maps.read_text() or "ready" in process.output, "the import")
    assert process.interrupt() == 0, process.output
    assert "Traceback" not in process.output
