"""A mock that starts on its dock, on system time."""

from __future__ import annotations

import math
import time

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from action_msgs.msg import GoalStatus  # noqa: E402
from cfnav_interfaces.srv import SetFault, StartEpisode  # noqa: E402
from cfnav_ros.process.domains import Domain  # noqa: E402
from irobot_create_msgs.action import Dock, Undock  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402

from tests.ros.mock_listener import (  # noqa: E402
    ROOM,
    SENSORS,
    Listener,
    seconds,
    start_mock,
)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    began = time.time()
    with Domain() as domain:
        log = tmp_path_factory.mktemp("mock") / "log"
        process = start_mock(
            log, domain, f"room:={ROOM}", "docked:=true", "clock:=system", "seed:=4"
        )
        listener = Listener(domain)
        listener.began = began
        try:
            process.wait_for_line("ready")
            listener.wait_connected(without={"/clock", *SENSORS})
            yield listener
            assert process.interrupt() == 0, process.output
            assert "Traceback" not in process.output
        finally:
            listener.close()
            process.end()


def undock(robot, meanwhile=lambda handle: None, action=Undock):
    """Ask to undock, or to dock, do something once that is accepted; status and result."""
    client = ActionClient(robot.node, action, action.__name__.lower())
    try:
        robot.wait(client.server_is_ready, "the server")
        sent = client.send_goal_async(action.Goal())
        robot.wait(sent.done, "the goal's answer")
        assert sent.result().accepted
        meanwhile(sent.result())
        result = sent.result().get_result_async()
        robot.wait(result.done, "the end of undocking")
        return result.result().status, result.result().result
    finally:
        client.destroy()


def test_stamps_are_system_time_and_there_is_no_clock(robot):
    robot.wait_for(1.0)
    still = robot.truth.still_since
    for t in (still, *(robot.stamps(topic)[-1] for topic in ("odom", "ground_truth/state", "imu"))):
        assert robot.began < t < time.time() + 0.1
    assert robot.node.count_publishers("/clock") == 0


def test_docked_robot_saves_power_and_ignores_commands(robot):
    assert robot.last("dock_status").is_docked
    began = robot.truth
    until = robot.truth_time() + 1.0
    robot.drive(0.2, 0.5, lambda: robot.truth_time() > until, "1 s")
    assert not any(robot.heard[topic] for topic in SENSORS)
    truth = robot.truth
    assert (truth.x, truth.y, truth.yaw) == (began.x, began.y, began.yaw)


def test_undocking_without_power_is_aborted_and_not_taken_up_again(robot):
    began = robot.truth
    assert robot.call(SetFault, fault="e_stop", active=True).ok
    try:
        status, result = undock(robot)
        assert (status, result.is_docked) == (GoalStatus.STATUS_ABORTED, True)
    finally:
        assert robot.call(SetFault, active=False).ok
    robot.wait_for(1.0)
    truth = robot.truth
    assert math.dist((truth.x, truth.y), (began.x, began.y)) < 0.001


def test_undock_backs_off_turns_around_and_wakes_the_sensors(robot):
    began = robot.truth
    status, result = undock(robot)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert not result.is_docked
    robot.wait(lambda: not robot.last("dock_status").is_docked, "the dock's status")
    robot.wait(lambda: all(robot.heard[topic] for topic in SENSORS), "LiDAR and camera")
    robot.wait_rest()
    truth = robot.truth
    assert math.dist((truth.x, truth.y), (began.x, began.y)) == pytest.approx(0.3, abs=0.06)
    assert abs(math.remainder(truth.yaw - began.yaw - math.pi, math.tau)) < 0.15
    for topic in SENSORS:
        assert seconds(began.header.stamp) < robot.stamps(topic)[-1] < time.time() + 0.1


def test_robot_goes_back_to_its_dock_and_stops_on_its_way_when_it_is_canceled(robot):
    robot.wait(lambda: robot.last("dock_status").dock_visible, "the dock to be seen")

    def cancel(handle):
        robot.wait(lambda: abs(robot.truth.w) > 0.2, "the way back")
        handle.cancel_goal_async()

    assert undock(robot, cancel, Dock)[0] == GoalStatus.STATUS_CANCELED
    robot.wait_rest()
    status, result = undock(robot, action=Dock)
    assert (status, result.is_docked) == (GoalStatus.STATUS_SUCCEEDED, True)
    robot.wait(lambda: robot.last("dock_status").is_docked, "the dock's status")


def test_robot_that_is_not_docked_refuses_to_undock(robot):
    if robot.last("dock_status").is_docked:
        undock(robot)
        robot.wait(lambda: not robot.last("dock_status").is_docked, "the dock's status")
    status, result = undock(robot)
    assert status == GoalStatus.STATUS_ABORTED
    assert not result.is_docked


def test_undocking_that_an_episode_cuts_short_is_aborted(robot):
    at = robot.truth
    start = [at.x, at.y, at.yaw]
    assert robot.call(SetFault, fault="docked", active=True).ok
    robot.wait(lambda: robot.last("dock_status").is_docked, "the dock")

    def start_episode(_):
        assert robot.call(SetFault, active=False).ok
        robot.wait(lambda: robot.truth.v < -0.05, "the way back")
        answer = robot.call(StartEpisode, room=ROOM, start=start)
        assert answer.ok, answer.message

    status, result = undock(robot, start_episode)
    assert (status, result.is_docked) == (GoalStatus.STATUS_ABORTED, False)
