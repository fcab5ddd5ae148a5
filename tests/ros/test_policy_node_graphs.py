"""The policy node in lock-step with a simulator, and twice in one graph."""

import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.conversions import stamp_to_ns  # noqa: E402

from .policy_graph import policy_graph  # noqa: E402

WAY = ("RotateLeft", "MoveAhead", "LookDown", "LookUp", "RotateRight", "Done")


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    with policy_graph(tmp_path, ros_domain_id) as start:
        yield start


def test_episodes_in_lock_step_repeat_themselves(graph, make_bundle):
    robot, _, _ = graph(
        make_bundle(*WAY), "use_sim_time:=true", "lock_step:=true", clock=True, lock_step=True
    )
    needed = [robot.publishers[name] for name in ("odometry", "joints", "image", "estimate")]
    robot.wait(lambda: all(p.get_subscription_count() for p in needed), "the node to listen")
    runs = []
    for _ in range(2):
        robot.wait(lambda: not robot.free, "the robot to stand at a moment")
        robot.put_back()
        robot.wait(lambda: not robot.free, "the robot to stand at the first moment")
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
