"""The policy node stops its robot whatever happens, and refuses what it cannot drive or start."""

import shutil
import signal

import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from action_msgs.msg import GoalStatus  # noqa: E402
from cfnav_ros.drive.fields import stamp_to_ns  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402

from tests.conftest import DEADLINE_S  # noqa: E402
from tests.ros.policy_graph import end_with, policy_graph, standing, start_node  # noqa: E402

FAILING_TWICE = """
import sys
from cfnav_ros.drive import fields
from cfnav_ros.ros.policy_node import main
take = fields.odometry_from_message
def fail_while_driving(message):
    if message.pose.pose.position.x > 0.05:
        raise RuntimeError("broken")
    return take(message)
fields.odometry_from_message = fail_while_driving
sys.exit(main())
"""

FAILING = """
import sys
from cfnav_ros.drive.episode import Episode
from cfnav_ros.ros.policy_node import main
update = Episode.update
def fail_while_driving(self, t, inputs):
    if self.track.path_length > 0.05:
        raise RuntimeError("broken")
    return update(self, t, inputs)
Episode.update = fail_while_driving
sys.exit(main())
"""


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    with policy_graph(tmp_path, ros_domain_id) as start:
        yield start


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_robot_first(graph, make_bundle, number):
    robot, process, log = graph(make_bundle("MoveAhead"))
    future = robot.send()[1]
    robot.wait_driving()
    assert end_with(process, number) == 0
    robot.wait_zeros(lasting=0.3)
    _, result = robot.result(future)
    assert (result.outcome, result.message) == ("aborted", "The policy node was stopped.")
    assert "Traceback" not in log.read_text()


@pytest.mark.parametrize("program", [FAILING, FAILING_TWICE])
def test_a_failing_callback_stops_the_robot_first(graph, make_bundle, program):
    robot, process, log = graph(make_bundle("MoveAhead"), program=("-c", program))
    future = robot.send()[1]
    assert process.wait(DEADLINE_S) == 1
    if program is FAILING:  # what fails twice cannot tell
        assert robot.result(future)[1].message == "The policy node was stopped."
    robot.wait_zeros(lasting=0.3)
    assert robot.x > 0.04
    assert "RuntimeError: broken" in log.read_text()


def test_a_canceled_goal_sends_zeros_for_its_time_to_stop(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.stop_time:=2.0")
    handle, future = robot.send()
    robot.wait_driving()
    handle.cancel_goal_async()
    assert robot.result(future)[1].outcome == "canceled"
    robot.wait_zeros(lasting=1.9, count=8)


def test_lost_odometry_stops_the_robot_and_then_the_episode(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.ages.odometry:=0.25")
    future = robot.send()[1]
    robot.wait_driving()
    robot.silent = {"odometry"}
    lost = stamp_to_ns(robot.newest["odometry"]) * 1e-9
    robot.wait(lambda: standing(robot), "the robot to stand")
    _, result = robot.result(future)
    assert max(t for t, v, w in robot.commands if v or w) < lost + 0.5
    assert result.outcome == "aborted"
    assert result.message.startswith("The newest odometry is ")


def test_a_clock_that_stops_stops_the_robot(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "use_sim_time:=true", clock=True)
    future = robot.send()[1]
    robot.wait_driving()
    robot.silent = {"clock"}
    robot.wait(lambda: standing(robot), "the robot to stand")
    _, result = robot.result(future)
    assert (result.outcome, result.message) == (
        "aborted",
        "Node time stands still: is /clock published?",
    )
    robot.silent = set()
    _, result = robot.result(robot.send(max_steps=1)[1])
    assert result.outcome == "step_limit"


def test_a_real_robot_is_not_driven_without_leave(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), name="create3_repub")
    status, result = robot.result(robot.send()[1])
    assert (status, result.outcome) == (GoalStatus.STATUS_ABORTED, "refused")
    assert result.message.startswith("create3_repub listens on /cmd_vel and may be a real robot")
    assert robot.commands == []


def test_a_second_publisher_is_a_refusal_and_a_missing_robot_too(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.preflight_timeout:=3.0", velocity=None)
    _, result = robot.result(robot.send()[1])
    assert (result.outcome, result.message) == ("refused", "No robot listens on /cmd_vel.")
    rival = robot.node.create_publisher(TwistStamped, "cmd_vel", 1)
    _, result = robot.result(robot.send()[1])
    assert result.outcome == "refused"
    assert result.message.startswith("mock_turtlebot4 also publishes on /cmd_vel")
    robot.node.destroy_publisher(rival)


def test_a_signal_before_any_robot_was_found_still_tells_the_client(graph, make_bundle):
    robot, process, _ = graph(make_bundle("MoveAhead"), velocity=None)
    future = robot.send()[1]
    robot.wait(lambda: robot.statuses, "the episode to begin")
    assert end_with(process, signal.SIGTERM) == 0
    status, result = robot.result(future)
    assert (status, result.outcome) == (GoalStatus.STATUS_ABORTED, "refused")
    assert result.message == "The policy node was stopped."


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ("bundle:=/nowhere", "found no readable bundle in /nowhere"),
        ("cmd_vel_type:=both", "cmd_vel_type is 'both', expected auto, stamped or unstamped."),
        ("episode.motion.v_max:=0.01", "v_min is 0.05, expected a number in (0, v_max = 0.01]."),
    ],
)
def test_what_cannot_start_says_so_and_exits_with_2(tmp_path, ros_domain_id, parameter, sentence):
    process = start_node(ros_domain_id, tmp_path / "log", parameter)
    assert process.wait(DEADLINE_S) == 2
    lines = (tmp_path / "log").read_text().strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"policy_node: {sentence}")


def test_a_bundle_without_weights_is_not_run_by_torch(tmp_path, ros_domain_id, make_bundle):
    parameters = (f"bundle:={make_bundle('MoveAhead')}", "backend:=torch")
    process = start_node(ros_domain_id, tmp_path / "log", *parameters)
    assert process.wait(DEADLINE_S) == 2
    assert "weights.safetensors" in (tmp_path / "log").read_text().splitlines()[-1]


def test_a_damaged_bundle_says_so_and_exits_with_2(tmp_path, ros_domain_id, make_bundle):
    bundle = shutil.copytree(make_bundle("MoveAhead"), tmp_path / "bundle")
    with (bundle / "policy.onnx").open("ab") as file:
        file.write(b"x")
    process = start_node(ros_domain_id, tmp_path / "log", f"bundle:={bundle}")
    assert process.wait(DEADLINE_S) == 2
    assert "the bundle is damaged" in (tmp_path / "log").read_text().splitlines()[-1]
