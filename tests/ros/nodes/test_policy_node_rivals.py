"""Strangers on the topics that a drive's safety hangs on, over real ROS."""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from action_msgs.msg import GoalStatus  # noqa: E402
from cfnav_interfaces.msg import CollisionEstimate  # noqa: E402
from cfnav_ros.ros.spinning import SpinningThread  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from irobot_create_msgs.msg import HazardDetectionVector  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sensor_msgs.msg import Image, LaserScan  # noqa: E402

from tests.ros.own_node import OwnNode  # noqa: E402
from tests.ros.policy_graph import policy_graph, standing, start_node  # noqa: E402

FORGED = {
    "/collision/estimate": CollisionEstimate(probability=0.0, clearance=9.0),
    "/odom": Odometry(),
    "/oakd/rgb/preview/image_raw": Image(),
    "/hazard_detection": HazardDetectionVector(),
    "/scan": LaserScan(),
}


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    with policy_graph(tmp_path, ros_domain_id) as start:
        yield start


@pytest.fixture
def stranger(ros_domain_id):
    """A node in a participant of its own, which may have any name."""
    joined = []

    def join(name="stranger"):
        joined.append(OwnNode(ros_domain_id, name))
        return joined[-1].node

    yield join
    for node in joined:
        node.close()


def aborted(robot, future):
    status, result = robot.result(future)
    robot.wait(lambda: standing(robot), "the robot to stand")
    assert (status, result.outcome) == (GoalStatus.STATUS_ABORTED, "aborted")
    return result.message


@pytest.mark.parametrize("topic", FORGED)
def test_a_second_voice_ends_the_drive_before_it_is_believed(graph, make_bundle, stranger, topic):
    robot, _, _ = graph(make_bundle("MoveAhead"))
    owner = robot.node.create_publisher(LaserScan, "scan", 1) if topic == "/scan" else None
    future = robot.send()[1]
    robot.wait_driving()
    forger = stranger().create_publisher(type(FORGED[topic]), topic, 10)
    if topic != "/scan":
        robot.wait(forger.get_subscription_count, "the node to listen")
        forger.publish(FORGED[topic])
    message = aborted(robot, future)
    assert message.startswith(f"2 nodes publish {topic} (")
    assert message.endswith("): end all but one.")
    del owner


@pytest.mark.parametrize("topic", [topic for topic in FORGED if topic != "/scan"])
def test_who_speaks_once_and_leaves_ends_the_drive(graph, make_bundle, stranger, topic):
    robot, _, _ = graph(make_bundle("MoveAhead"))
    hidden = stranger()
    for _ in range(3):
        future = robot.send()[1]
        robot.wait_driving()
        forger = hidden.create_publisher(type(FORGED[topic]), topic, 10)
        robot.wait(forger.get_subscription_count, "the node to listen")
        forger.publish(FORGED[topic])
        hidden.destroy_publisher(forger)
        message = aborted(robot, future)
        left = message.startswith(f"Another publisher of {topic} came and went: ")
        assert left or message.startswith(f"2 nodes publish {topic} ("), message


def test_a_second_voice_is_refused_at_the_start(graph, make_bundle, stranger):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.preflight_timeout:=4.0")
    stranger("mock_turtlebot4").create_publisher(CollisionEstimate, "collision/estimate", 10)
    robot.wait(lambda: robot.node.count_publishers("collision/estimate") == 2, "the stranger")
    robot.result(robot.send()[1])  # had the node not heard of the stranger yet, it has by the end
    robot.wait(lambda: standing(robot), "the robot to stand")
    stood = robot.x
    _, result = robot.result(robot.send()[1])
    assert result.outcome == "refused"
    assert "(mock_turtlebot4, mock_turtlebot4): end all but one." in result.message
    assert robot.x == stood


def test_a_driver_of_the_nodes_own_name_is_none_of_it(graph, make_bundle, stranger):
    robot, _, _ = graph(make_bundle("MoveAhead"))
    future = robot.send()[1]
    robot.wait_driving()
    stranger("policy_node").create_publisher(TwistStamped, "cmd_vel", 1)
    message = "policy_node also publishes on /cmd_vel: stop it, one node must drive."
    assert aborted(robot, future) == message


def test_of_two_policy_nodes_none_drives(graph, make_bundle, ros_domain_id, tmp_path):
    robot, _, _ = graph(make_bundle("MoveAhead"))
    future = robot.send()[1]
    robot.wait_driving()
    bundle = make_bundle("MoveAhead")
    second = start_node(ros_domain_id, tmp_path / "second.log", f"bundle:={bundle}")
    try:
        message = "Another node serves navigate_to_object too: end it, one must drive."
        assert aborted(robot, future) == message
    finally:
        second.terminate()
        second.wait(60)


def test_through_a_multiplexer_only_what_went_in_may_come_out(graph, make_bundle):
    robot, _, _ = graph(
        make_bundle("MoveAhead"), "cmd_vel_topic:=cmd_vel_cfnav", "other_publishers:=twist_mux",
        "episode.preflight_timeout:=4.0",
    )  # fmt: skip
    _, result = robot.result(robot.send()[1])
    assert (result.outcome, robot.x) == ("refused", 0.0)
    assert result.message == "No multiplexer listens on /cmd_vel_cfnav."

    mux = Node("twist_mux", context=robot.context)
    out = mux.create_publisher(TwistStamped, "cmd_vel", 1)
    mux.create_subscription(TwistStamped, "cmd_vel_cfnav", out.publish, 1)
    mux.create_timer(0.1, lambda: None)  # a thread that has nothing to do does not end
    thread = SpinningThread(mux)
    thread.start()
    try:
        robot.wait(lambda: robot.node.count_publishers("cmd_vel") == 1, "the multiplexer")
        _, result = robot.result(robot.send(max_steps=1)[1])
        assert result.outcome == "step_limit", result.message
        assert robot.x > 0.1
        future = robot.send()[1]
        robot.wait_driving()
        robot.wait(lambda: out.get_subscription_count() == 2, "the node to listen")
        out.publish(TwistStamped())  # a joystick's, of higher priority
        message = "Somebody else drives: a velocity of twist_mux came on /cmd_vel."
        assert aborted(robot, future) == message
    finally:
        thread.end()
        mux.destroy_node()
