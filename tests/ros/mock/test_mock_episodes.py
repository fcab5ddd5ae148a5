"""Episodes that the mock TurtleBot 4 begins, ends and refuses, and what the truth says of them."""

from __future__ import annotations

import math

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_interfaces.srv import EndEpisode, StartEpisode  # noqa: E402
from cfnav_ros.process.domains import Domain  # noqa: E402
from sim_bridge.room.room import generate_room, parse_room  # noqa: E402

from tests.ros.mock_listener import (  # noqa: E402
    OTHER_ROOM,
    ROOM,
    Listener,
    before_a_wall,
    seconds,
    start_mock,
)


@pytest.fixture(scope="module")
def start():
    return before_a_wall()


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    with Domain() as domain:
        log = tmp_path_factory.mktemp("mock") / "log"
        process = start_mock(log, domain, f"room:={ROOM}", "speed:=2", "noise:=0")
        listener = Listener(domain)
        try:
            process.wait_for_line("ready")
            listener.wait_connected()
            yield listener
            assert process.interrupt() == 0, process.output
        finally:
            listener.close()
            process.end()


def test_episode_of_its_own_room_and_of_another(robot):
    for room in (ROOM, OTHER_ROOM):
        for goal in generate_room(*parse_room(room)).goals:
            answer = robot.call(StartEpisode, room=room, goal=goal, seed=3)
            if answer.ok:
                break
        assert answer.ok, answer.message
        assert answer.shortest_actions >= 6

        at = (room, goal)
        robot.wait(lambda at=at: (robot.truth.room, robot.truth.goal) == at, "the episode")
        truth = robot.truth
        assert (truth.collisions, truth.goal_visible) == (0, False)
        assert (truth.x, truth.y) == pytest.approx((answer.x, answer.y), abs=1e-3)
        assert truth.shortest_path == pytest.approx(answer.shortest_path)
        turned = robot.now() + 1.0
        robot.drive(0.0, 1.0, lambda t=turned: robot.now() > t, "a turn")
        account = robot.call(EndEpisode)
        assert account.ok
        assert account.path_length == pytest.approx(0.0, abs=0.01)
        assert account.shortest_path == pytest.approx(answer.shortest_path)
    robot.wait(lambda: len(robot.heard["ground_truth/map"]) == 2, "the other room's map")
    answer = robot.call(EndEpisode)
    assert not answer.ok
    assert "No episode runs" in answer.message


def test_start_at_a_pose_with_and_without_a_goal(robot, start):
    goal = generate_room(*parse_room(ROOM)).goals[0]
    for wanted in ("", goal):
        answer = robot.call(StartEpisode, room=ROOM, goal=wanted, seed=3, start=start)
        assert answer.ok, answer.message
        assert (answer.x, answer.y, answer.yaw) == pytest.approx(start)
        assert bool(answer.shortest_actions) == bool(wanted)

        def begun(wanted=wanted):
            truth = robot.truth
            pose = (truth.x, truth.y, truth.yaw)
            return truth.goal == wanted and pose == pytest.approx(start, abs=1e-3)

        robot.wait(begun, "the start of the episode")
        assert robot.truth.collisions == 0
    assert robot.call(EndEpisode).ok


def test_truth_tells_velocity_and_standstill(robot, start):
    assert robot.call(StartEpisode, room=ROOM, start=start).ok
    robot.drive(0.0, 0.5, lambda: robot.truth.w > 0.45, "a turn")
    assert robot.truth.still_since == 0.0
    robot.wait_rest()
    truth = robot.truth
    assert (truth.v, truth.w) == pytest.approx((0.0, 0.0), abs=0.01)
    turning = [m for m in robot.heard["ground_truth/state"] if abs(m.w) > 0.05]
    assert seconds(turning[-1].header.stamp) < truth.still_since <= seconds(truth.header.stamp)


@pytest.mark.parametrize(
    ("room", "goal", "pose", "words"),
    [
        (OTHER_ROOM, "Television", [], "it has"),
        ("cellar:1", "Mug", [], "kitchen"),
        (ROOM, "", [], "'' is no known category"),
        (ROOM, "", [1.0, 1.0], "expected [x, y, yaw]"),
        (OTHER_ROOM, "", [0.0, 0.0, 0.0], "is not free"),
        (ROOM, "", [math.nan, 1.0, 0.0], "expected [x, y, yaw]"),
    ],
)
def test_episode_that_cannot_start_says_why(robot, room, goal, pose, words):
    before = robot.truth
    answer = robot.call(StartEpisode, room=room, goal=goal, seed=3, start=pose)
    assert not answer.ok
    assert words in answer.message
    robot.wait(lambda: robot.truth is not before, "the next state")
    assert robot.truth.room == before.room
