"""The markers for RViz say what the newest estimate and decision say."""

from __future__ import annotations

from collections.abc import Callable

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_interfaces.msg import CollisionEstimate, PolicyDecision  # noqa: E402
from cfnav_ros.ros.markers_node import way_ahead  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

from tests.ros.own_node import OwnNode  # noqa: E402


def test_the_way_ahead_reaches_as_far_as_the_hull_can_advance() -> None:
    free = way_ahead(CollisionEstimate(probability=0.25, clearance=0.6), 0.2)
    assert free.scale.x == pytest.approx(0.6)
    assert free.scale.y == pytest.approx(0.4)
    assert free.pose.position.x - free.scale.x / 2 == pytest.approx(0.2)
    assert (free.color.r, free.color.g) == pytest.approx((0.25, 0.75))
    nothing = CollisionEstimate(probability=1.0, verdict=CollisionEstimate.BLIND)
    blind = way_ahead(nothing, 0.2)
    assert blind.scale.x == pytest.approx(0.25)
    assert (blind.color.r, blind.color.g) == (1.0, 0.0)
    assert way_ahead(CollisionEstimate(clearance=9.0), 0.2).scale.x == pytest.approx(1.5)


def test_the_node_draws_decision_and_estimate(start_process: Callable, ros_domain_id: int) -> None:
    process = start_process("cfnav_ros.ros.markers_node", "--ros-args", "-p", "radius:=0.25")
    robot = OwnNode(ros_domain_id, "robot")
    node, heard = robot.node, []
    node.create_subscription(MarkerArray, "policy/markers", heard.append, 5)
    decisions = node.create_publisher(PolicyDecision, "policy/decision", 5)
    estimates = node.create_publisher(CollisionEstimate, "collision/estimate", 5)
    estimate = CollisionEstimate(probability=0.5, clearance=0.3, verdict=1)
    estimate.header.frame_id = "robot1/base_link"

    def say() -> None:
        decisions.publish(PolicyDecision(goal="Mug", step=7, action=0, vetoed=True))
        estimates.publish(estimate)

    robot.wait(lambda: heard and "Mug" in heard[-1].markers[1].text, "the decision", say)
    strip, said = heard[-1].markers
    assert strip.header.frame_id == "robot1/base_link"
    assert strip.scale.y == pytest.approx(0.5)
    assert said.text == "Mug 0.00, step 7: MoveAhead, vetoed\np 0.50, 0.30 m free, DEGRADED"
    robot.close()
    assert process.interrupt() == 0
    wrong = start_process("cfnav_ros.ros.markers_node", "--ros-args", "-p", "radius:=0.0")
    assert wrong.wait() == 2
    assert "radius is 0.0, expected 0.05 to 1." in wrong.output
