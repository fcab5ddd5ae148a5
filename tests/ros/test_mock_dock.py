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
from irobot_create_msgs.action import Undock  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402

from .mock_listener import (  # noqa: E402
    ROOM,
    SENSORS,
    Listener,
    locked_domain,
    seconds,
    start_mock,
)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    with locked_domain() as domain:
        log = tmp_path_factory.mktemp("mock") / "log"
        process = start_mock(
            log, domain, f"room:={ROOM}", "docked:=true", "clock:=system", "seed:=4"
        )
        listener = Listener(domain)
        try:
            process.wait_for_line("ready")
            listener.wait_connected(without={"/clock", *SENSORS})
            yield listener
            assert process.interrupt() == 0, process.output
            assert "Traceback" not in process.output
        finally:
            listener.close()
            process.end()


def undock(robot, meanwhile=lambda: None):
    """Ask to undock, do something once that is accepted; status and result."""
    client = ActionClient(robot.node, Undock, "undock")
    try:
        robot.wait(client.server_is_ready, "the undock server")
        sent = client.send_goal_async(Undock.Goal())
        robot.wait(sent.done, "the goal's answer")
        assert sent.result().accepted
        meanwhile()
        result = sent.result().get_result_async()
        robot.wait(result.done, "the end of undocking")
        return result.result().status, result.result().result
    finally:
        client.destroy()


def test_stamps_are_system_time_and_there_is_no_clock(robot):
    robot.wait_for(1.0)
    for topic in ("odom", "ground_truth/state", "imu"):
        age = time.time() - seconds(robot.last(topic).header.stamp)
        assert -0.1 < age < 2.0, topic
    assert robot.node.count_publishers("/clock") == 0
    still = robot.last("ground_truth/state").still_since
    assert 0 < time.time() - still < 120


def test_docked_robot_saves_power_and_ignores_commands(robot):
    assert robot.last("dock_status").is_docked
    began = robot.last("ground_truth/state")
    until = seconds(began.header.stamp) + 1.0
    robot.drive(
        0.2, 0.5, lambda: seconds(robot.last("ground_truth/state").header.stamp) > until, "1 s"
    )
    assert not any(robot.heard[topic] for topic in SENSORS)
    truth = robot.last("ground_truth/state")
    assert (truth.x, truth.y, truth.yaw) == (began.x, began.y, began.yaw)


def test_undocking_without_power_is_aborted_and_not_taken_up_again(robot):
    began = robot.last("ground_truth/state")
    assert robot.call(SetFault, fault="e_stop", active=True).ok
    try:
        status, result = undock(robot)
        assert (status, result.is_docked) == (GoalStatus.STATUS_ABORTED, True)
    finally:
        assert robot.call(SetFault, active=False).ok
    robot.wait_for(1.0)
    truth = robot.last("ground_truth/state")
    assert math.dist((truth.x, truth.y), (began.x, began.y)) < 0.001


def test_undock_backs_off_turns_around_and_wakes_the_sensors(robot):
    began = robot.last("ground_truth/state")
    status, result = undock(robot)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert not result.is_docked
    robot.wait(lambda: not robot.last("dock_status").is_docked, "the dock's status")
    robot.wait(lambda: all(robot.heard[topic] for topic in SENSORS), "LiDAR and camera")
    robot.wait_rest()
    truth = robot.last("ground_truth/state")
    assert math.dist((truth.x, truth.y), (began.x, began.y)) == pytest.approx(0.3, abs=0.06)
    assert abs(math.remainder(truth.yaw - began.yaw - math.pi, math.tau)) < 0.15
    ages = [time.time() - seconds(robot.last(topic).header.stamp) for topic in SENSORS]
    assert max(ages) < 2.0


def test_robot_that_is_not_docked_refuses_to_undock(robot):
    if robot.last("dock_status").is_docked:
        undock(robot)
        robot.wait(lambda: not robot.last("dock_status").is_docked, "the dock's status")
    status, result = undock(robot)
    assert status == GoalStatus.STATUS_ABORTED
    assert not result.is_docked


def test_undocking_that_an_episode_cuts_short_is_aborted(robot):
    at = robot.last("ground_truth/state")
    start = [at.x, at.y, at.yaw]
    assert robot.call(SetFault, fault="docked", active=True).ok
    robot.wait(lambda: robot.last("dock_status").is_docked, "the dock")

    def start_episode():
        assert robot.call(SetFault, active=False).ok
        robot.wait(lambda: robot.last("ground_truth/state").v < -0.05, "the way back")
        answer = robot.call(StartEpisode, room=ROOM, start=start)
        assert answer.ok, answer.message

    status, result = undock(robot, start_episode)
    assert (status, result.is_docked) == (GoalStatus.STATUS_ABORTED, False)
