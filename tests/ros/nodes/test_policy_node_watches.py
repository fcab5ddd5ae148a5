"""The policy node as a process, on inputs and bases that must not be trusted."""

import itertools
import time
from unittest.mock import Mock

import pytest
from cfnav_ros.drive.motion import STOP

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_interfaces.msg import EpisodeStatus  # noqa: E402
from cfnav_ros.drive.fields import stamp_to_ns  # noqa: E402
from geometry_msgs.msg import Twist, TwistStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sensor_msgs.msg import CompressedImage, JointState  # noqa: E402

from tests.ros.policy_graph import policy_graph, standing  # noqa: E402


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    with policy_graph(tmp_path, ros_domain_id) as start:
        yield start


def stops(robot, future):
    """Wait until the goal has ended and the robot stands; returns the reason."""
    _, result = robot.result(future)
    assert result.outcome == "aborted"
    robot.wait(lambda: standing(robot), "the robot to stand")
    return result.message


def test_dock_power_and_another_clock_are_said_before_and_while_driving(graph, make_bundle):
    robot, _, _ = graph(
        make_bundle("MoveAhead"), "episode.preflight_timeout:=4.0", "episode.lost_timeout:=0.5"
    )
    future = robot.send()[1]
    robot.wait_driving()
    robot.say(powered=False)
    assert stops(robot, future).startswith("The wheels have no power")
    _, result = robot.result(robot.send()[1])
    assert (result.outcome, result.steps) == ("refused", 0)
    robot.say(powered=True)

    future = robot.send()[1]
    robot.wait_driving()
    robot.say(docked=True)
    assert stops(robot, future) == "The robot sits on its dock: undock it first."
    robot.say(docked=False)

    future = robot.send()[1]
    robot.wait_driving()
    robot.damage["odometry"] = lambda message: setattr(
        message.pose.pose.orientation, "w", float("nan")
    )
    message = stops(robot, future)
    assert message.startswith("The newest odometry is ")
    assert "quaternion of length nan" in message
    robot.damage.clear()

    robot.skew = 12.3
    _, result = robot.result(robot.send()[1])
    assert result.message.startswith("The clocks of robot and computer differ by 12.")
    assert result.message.endswith("set both with chrony, then start the camera's driver again.")
    robot.skew = 0.0
    robot.node.destroy_subscription(robot.subscription)
    _, result = robot.result(robot.send()[1])
    assert (result.outcome, result.message) == ("refused", "No robot listens on /cmd_vel.")


def test_a_joystick_that_speaks_ends_the_episode_and_its_silence_does_not(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "other_publishers:=joy")
    joystick = Node("joy", context=robot.context)
    stick = joystick.create_publisher(TwistStamped, "cmd_vel", 1)
    old = joystick.create_publisher(Twist, "cmd_vel_unstamped", 1)
    for publisher, topic in ((stick, "/cmd_vel"), (old, "/cmd_vel_unstamped")):
        _, result = robot.result(robot.send(max_steps=1)[1])
        assert result.outcome == "step_limit", result.message
        future = robot.send()[1]
        robot.wait_driving()
        robot.wait(publisher.get_subscription_count, "the node to listen")
        publisher.publish(publisher.msg_type())
        message = stops(robot, future)
        assert message == f"Somebody else drives: a velocity of joy came on {topic}."
    rival = Node("nav", context=robot.context)
    rival.create_publisher(Twist, "cmd_vel_unstamped", 1)
    robot.wait(lambda: robot.node.count_publishers("cmd_vel_unstamped") == 2, "the rival")
    future = robot.send()[1]
    _, result = robot.result(future)
    assert result.outcome in ("refused", "aborted")
    assert result.message.startswith("nav also publishes on /cmd_vel_unstamped: ")
    rival.destroy_node()
    joystick.destroy_node()


def test_a_joystick_s_zeros_are_not_taken_for_ours_where_velocities_bear_no_stamp(
    graph, make_bundle
):
    robot, _, _ = graph(make_bundle("MoveAhead"), "other_publishers:=joy", velocity=Twist)
    joystick = Node("joy", context=robot.context)
    stick = joystick.create_publisher(Twist, "cmd_vel", 1)
    _, result = robot.result(robot.send(max_steps=3)[1])
    assert result.outcome == "step_limit", result.message
    future = robot.send()[1]
    robot.wait_driving()
    robot.wait(stick.get_subscription_count, "the node to listen")
    stick.publish(Twist())  # a button held, and the stick at rest
    assert stops(robot, future) == "Somebody else drives: a velocity of joy came on /cmd_vel."
    joystick.destroy_node()


def test_a_drive_to_be_recorded_needs_its_recorder_from_begin_to_end(graph, make_bundle):
    waits = ("wait_for_recorder:=true", "episode.preflight_timeout:=4.0")
    robot, _, _ = graph(make_bundle("MoveAhead"), *waits)
    _, result = robot.result(robot.send(max_steps=1)[1])
    assert (result.outcome, result.message) == ("refused", "No recorder hears /cmd_vel.")
    assert all(command[1:] == (0.0, 0.0) for command in robot.commands)
    recorder = Node("recorder", context=robot.context)
    recorder.create_subscription(TwistStamped, "cmd_vel", lambda _: None, 1)
    robot.wait(lambda: robot.node.count_subscribers("cmd_vel") == 2, "the recorder")
    _, result = robot.result(robot.send(max_steps=1)[1])
    assert result.outcome == "step_limit", result.message
    future = robot.send()[1]
    robot.wait_driving()
    recorder.destroy_node()  # it died, of a full disk perhaps
    assert stops(robot, future) == "No recorder hears /cmd_vel."


def test_pictures_of_another_type_are_named(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.preflight_timeout:=4.0")
    robot.silent = {"image"}
    robot.node.destroy_publisher(robot.publishers["image"])
    _, result = robot.result(robot.send()[1])
    assert result.message == (
        "No picture has arrived (nobody publishes /oakd/rgb/preview/image_raw)."
    )
    robot.node.create_publisher(CompressedImage, "oakd/rgb/preview/image_raw", 10)
    _, result = robot.result(robot.send()[1])
    assert result.message == (
        "No picture has arrived (mock_turtlebot4 sends sensor_msgs/msg/CompressedImage on "
        "/oakd/rgb/preview/image_raw, expected sensor_msgs/msg/Image)."
    )


def test_joint_states_without_the_tilt_are_named(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.preflight_timeout:=4.0")
    robot.silent = {"joints"}
    robot.node.destroy_publisher(robot.publishers["joints"])
    _, result = robot.result(robot.send()[1])
    assert result.message == "No camera tilt has arrived (nobody publishes /joint_states)."
    robot.publishers["joints"] = robot.node.create_publisher(JointState, "joint_states", 10)
    robot.damage["joints"] = lambda message: setattr(message, "name", ["left_wheel_joint"])
    robot.silent = set()
    _, result = robot.result(robot.send()[1])
    assert result.message == (
        "No camera tilt has arrived (/joint_states gives no position of camera_tilt)."
    )


def test_a_frozen_camera_stops_the_robot(graph, make_bundle):
    robot, _, _ = graph(make_bundle("RotateLeft"))
    future = robot.send(max_steps=100)[1]
    robot.wait(lambda: robot.w > 0.3, "the robot to turn")
    kept = next(reversed(robot.pictures.values())).data
    robot.damage["image"] = lambda message: setattr(message, "data", kept)
    assert stops(robot, future).startswith("The camera is frozen: it has sent one picture for ")


def test_a_clock_that_leaps_ahead_stops_the_robot(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "use_sim_time:=true", clock=True)
    future = robot.send()[1]
    robot.wait_driving()
    robot.clock += 10_000_000_000
    assert stops(robot, future).startswith("Node time leapt ahead by 10.")
    future = robot.send()[1]
    robot.wait_driving()
    robot.clock -= 10_000_000_000
    assert stops(robot, future) == "Node time jumped back."


def test_a_system_clock_set_back_rouses_the_timer_that_stops_the_robot():
    """That timer would be silent until the old time is reached; the guard's runs on another."""
    from cfnav_ros.drive.policy_parameters import PolicyParameters
    from cfnav_ros.ros.real_time import RealTime

    node = Mock()
    episode, timer = node.episode, node.create_timer.return_value
    pace = RealTime(node, PolicyParameters())
    _, guard = (call.args[1] for call in node.create_timer.call_args_list)
    pace.begin()
    timer.reset.reset_mock()
    now = node.get_clock.return_value.now
    for now.return_value.nanoseconds in (50_000_000_000, 50_100_000_000):
        guard()
    assert not timer.reset.called
    now.return_value.nanoseconds = 40_000_000_000
    guard()
    node.velocity.send.assert_called_once_with(STOP)
    episode.fail.assert_called_once_with("Node time jumped back.")
    timer.reset.assert_called_once_with()
    assert not node.end.called


def test_a_live_parameter_takes_hold_in_the_drive_under_way(graph, make_bundle):
    from rclpy.parameter import Parameter
    from rclpy.parameter_client import AsyncParameterClient

    robot, _, _ = graph(make_bundle("MoveAhead"))
    client = AsyncParameterClient(robot.node, "policy_node")
    future = robot.send()[1]
    robot.wait_driving()
    changed = client.set_parameters([Parameter("episode.motion.v_max", value=0.08)])
    robot.wait(changed.done, "the parameter to be set")
    assert changed.result().results[0].successful
    told, begun = time.time(), len(robot.decisions)

    def slow():
        """Speeds from the first on that is no more than was asked for."""
        speeds = [v for t, v, _ in robot.commands if t > told]
        return list(itertools.dropwhile(lambda v: v > 0.081, speeds))

    robot.wait(lambda: len(robot.decisions) > begun + 1, "the next motion to end")
    robot.wait(lambda: any(slow()), "a slow drive")
    assert max(slow()) == pytest.approx(0.08)
    assert not future.done()


def test_goals_by_topic_and_parameter(graph, make_bundle):
    from std_msgs.msg import String

    robot, _, _ = graph(make_bundle("MoveAhead"), "goal:=Mug")
    asked = robot.node.create_publisher(String, "policy/goal", 10)
    robot.wait(lambda: asked.get_subscription_count() == 1, "the node to listen")
    robot.wait_driving()
    asked.publish(String(data="Laptop"))
    asked.publish(String(data="Laptop"))  # as `ros2 topic pub` does, which begins nothing anew
    robot.wait(lambda: len(robot.statuses) == 3, "the newer goal to begin")
    robot.wait_driving()
    asked.publish(String(data=""))
    robot.wait(lambda: len(robot.statuses) == 4, "the goal to end")
    robot.wait(lambda: standing(robot), "the robot to stand")
    told = [(s.goal, s.outcome, s.message) for s in robot.statuses]
    assert told == [
        ("Mug", "", ""),
        ("Mug", "preempted", "A newer goal came."),
        ("Laptop", "", ""),
        ("Laptop", "canceled", "The goal was canceled."),
    ]
    future = robot.send("Laptop")[1]
    robot.wait_driving()
    asked.publish(String(data="Unicorn"))
    _, result = robot.result(future)
    assert result.outcome == "preempted"
    robot.wait(lambda: len(robot.statuses) == 8, "the unknown goal to be refused")
    assert (robot.statuses[-1].outcome, robot.statuses[-1].steps) == ("refused", 0)


def test_a_goal_by_topic_that_never_begins_is_told_and_a_stream_of_one_begins_once(
    graph, make_bundle
):
    from std_msgs.msg import String

    robot, _, log = graph(make_bundle("MoveAhead"))
    robot.silent = {"hazard"}
    robot.node.destroy_publisher(robot.publishers["hazard"])
    asked = robot.node.create_publisher(String, "policy/goal", 10)
    robot.wait(lambda: asked.get_subscription_count() == 1, "the node to listen")
    future = robot.send()[1]
    robot.wait_driving()
    assert "/hazard_detection: not heard. The robot drives without its bumper" in log.read_text()
    for name in ("Mug", "Laptop", ""):  # the first is replaced, the second canceled
        asked.publish(String(data=name))
    assert robot.result(future)[1].outcome == "preempted"
    robot.wait(lambda: len(robot.statuses) == 4, "the ends")
    told = [(s.phase, s.goal, s.outcome) for s in robot.statuses]
    assert told[1:3] == [
        (EpisodeStatus.ENDED, "Mug", "preempted"),
        (EpisodeStatus.ENDED, "Laptop", "canceled"),
    ]

    asked.publish(String(data="Unicorn"))
    robot.wait(lambda: len(robot.statuses) == 6, "the goal to be refused")
    for _ in range(3):
        asked.publish(String(data="Unicorn"))
    asked.publish(String(data="Mug"))
    robot.wait(lambda: len(robot.statuses) == 7, "another goal to begin")
    assert robot.statuses[-1].goal == "Mug"
    assert "Unicorn was asked for before: publish an empty goal first" in log.read_text()
    asked.publish(String(data=""))
    asked.publish(String(data="Mug"))
    robot.wait(lambda: len(robot.statuses) == 9, "it to begin again")
    assert [s.goal for s in robot.statuses[-2:]] == ["Mug", "Mug"]


def test_the_status_counts_and_diagnostics_tell(graph, make_bundle):
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

    robot, _, log = graph(make_bundle("MoveAhead"))
    heard = []
    robot.node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    future = robot.send(max_steps=2)[1]
    robot.wait_driving()
    robot.bumping, robot.probability = True, 0.9
    _, result = robot.result(future)
    robot.wait(lambda: len(robot.statuses) == 2, "the status")
    status = robot.statuses[-1]
    assert (status.vetoes, status.bumps) == (result.vetoes, result.bumps) == (1, 1)

    def well():
        """Whether diagnostics came after the episode, of odometry that has just come."""
        ended = stamp_to_ns(status.header.stamp)
        if not (heard and stamp_to_ns(heard[-1].header.stamp) > ended):
            return False
        (odometry,) = (row for row in heard[-1].status if row.name.endswith(": odometry"))
        return odometry.level == DiagnosticStatus.OK

    robot.wait(well, "diagnostics")
    rows = {row.name: row for row in heard[-1].status}
    assert set(rows) == {
        f"/policy_node: {name}"
        for name in (
            "picture", "odometry", "collision estimate", "camera tilt", "hazards", "wheel status",
            "dock status", "battery", "episode", "inference", "base",
        )
    }  # fmt: skip
    assert rows["/policy_node: hazards"].message == "heard"
    assert "hazard_detection: not heard" not in log.read_text()
    values = {pair.key: pair.value for pair in rows["/policy_node: inference"].values}
    assert 0 < float(values["p50_ms"]) <= float(values["p99_ms"])
    values = {pair.key: pair.value for pair in rows["/policy_node: base"].values}
    assert (values["topic"], values["type"]) == ("/cmd_vel", "geometry_msgs/msg/TwistStamped")
    assert 0 < float(values["largest_gap_s"]) < 60
