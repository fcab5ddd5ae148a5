"""The policy node in lock-step with a simulator, and twice in one graph."""

import math
from contextlib import ExitStack

import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.drive.fields import stamp_to_ns  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402

from tests.ros.policy_graph import LATE_DEG, LATE_M, policy_graph, standing  # noqa: E402

WAY = ("RotateLeft", "MoveAhead", "LookDown", "LookUp", "RotateRight", "Done")


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    with policy_graph(tmp_path, ros_domain_id) as start:
        yield start


def listened_to(robot):
    """Wait until nothing that the robot sends from now on can be lost."""
    needed = [robot.publishers[name] for name in ("odometry", "joints", "image", "estimate")]
    robot.wait(lambda: all(p.get_subscription_count() for p in needed), "the node to listen")
    robot.wait(lambda: not robot.free, "the robot to stand at a moment")
    robot.put_back()


def test_episodes_in_lock_step_repeat_themselves(graph, make_bundle):
    robot, _, _ = graph(
        make_bundle(*WAY), "use_sim_time:=true", "lock_step:=true", clock=True, lock_step=True
    )
    listened_to(robot)
    runs = []
    for _ in range(2):
        robot.wait(lambda: not robot.free, "the robot to stand at a moment")
        robot.put_back()
        stood = robot.clock
        _, result = robot.result(robot.send()[1])
        assert (result.outcome, result.steps) == ("done", 6), result.message
        robot.wait(lambda: len(robot.decisions) == 6, "the decisions")
        stamps = [stamp_to_ns(d.header.stamp) - stood for d in robot.decisions]
        looks = [stamp_to_ns(d.image_stamp) - stood for d in robot.decisions]
        # A zero at the start may find the base's side of the connection not yet open.
        commands = [(v, w) for _, v, w in robot.commands if v or w]
        runs.append((result.path_length, stamps, looks, commands, robot.x, robot.y, robot.yaw))
    assert runs[0] == runs[1]
    assert robot.x > 0.1


def test_in_lock_step_a_simulator_that_falls_silent_ends_the_episode(graph, make_bundle):
    robot, _, _ = graph(
        make_bundle("MoveAhead"), "use_sim_time:=true", "lock_step:=true",
        "episode.preflight_timeout:=6.0", clock=True, lock_step=True,
    )  # fmt: skip
    listened_to(robot)
    none = "No moment of a simulator came whole for 6 s"
    why = {
        "moment": f"{none}: has it ended, or is lock_step set on a robot?",
        "estimate": f"{none}, as /collision/estimate did not come: see what its sender says.",
    }
    for silenced, canceled in (("moment", False), ("estimate", True), ("estimate", False)):
        handle, future = robot.send()
        robot.wait_driving()
        robot.silent = {silenced}
        if canceled:
            handle.cancel_goal_async()
        _, result = robot.result(future)
        if canceled:
            assert (result.outcome, result.message) == ("canceled", "The goal was canceled.")
        else:
            assert result.outcome == "aborted"
            assert result.message.startswith(why[silenced])
        robot.wait(lambda: standing(robot), "the robot to stand")
        robot.silent = set()
        robot.put_back()


def test_two_robots_in_one_graph_do_not_disturb_each_other(tmp_path, ros_domain_id, make_bundle):
    bundles = {"left": make_bundle("RotateLeft"), "right": make_bundle("MoveAhead")}
    diagnosed = {name: [] for name in bundles}
    with ExitStack() as stack:
        robots = {}
        for name, bundle in bundles.items():
            folder = tmp_path / name
            folder.mkdir()
            start = stack.enter_context(policy_graph(folder, ros_domain_id))
            robots[name], _, _ = start(
                bundle, f"base_frame:={name}/base_link", remap=f"__ns:=/{name}", namespace=name
            )
            hear = diagnosed[name].append
            robots[name].node.create_subscription(DiagnosticArray, f"/{name}/diagnostics", hear, 5)
        futures = {name: robot.send(max_steps=3)[1] for name, robot in robots.items()}
        for name, robot in robots.items():
            _, result = robot.result(futures[name])
            assert (result.outcome, result.steps) == ("step_limit", 3), result.message
            robot.wait(lambda robot=robot: len(robot.decisions) == 3, "its own decisions")
            assert (
                robot.frames
                == {d.header.frame_id for d in robot.decisions}
                == {f"{name}/base_link"}
            )
            # where the aggregator of a robot with a namespace listens
            robot.wait(lambda name=name: diagnosed[name], f"diagnostics of {name}")
    left, right = robots["left"], robots["right"]
    assert (left.x, left.y) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert math.degrees(left.yaw) == pytest.approx(135, abs=LATE_DEG)
    assert right.x == pytest.approx(0.75, abs=3 * LATE_M)
    assert math.degrees(right.yaw) == pytest.approx(0.0, abs=LATE_DEG)


def test_a_rival_of_one_robot_is_none_of_another(tmp_path, ros_domain_id, make_bundle):
    with policy_graph(tmp_path, ros_domain_id) as start:
        robot, _, _ = start(make_bundle("RotateLeft"), remap="__ns:=/left", namespace="left")
        elsewhere = robot.node.create_publisher(TwistStamped, "/right/cmd_vel", 1)
        _, result = robot.result(robot.send(max_steps=1)[1])
        assert result.outcome == "step_limit", result.message
        rival = robot.node.create_publisher(TwistStamped, "/left/cmd_vel", 1)
        _, result = robot.result(robot.send(max_steps=1)[1])
        assert (result.outcome, elsewhere.get_subscription_count()) == ("refused", 0)
        assert "also publishes on /left/cmd_vel" in result.message
        robot.node.destroy_publisher(rival)
