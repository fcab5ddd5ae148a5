"""The mock's node: in which order it takes what it is sent."""

from __future__ import annotations

from contextlib import contextmanager

import pytest

pytestmark = pytest.mark.ros

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_interfaces.msg import MomentDone  # noqa: E402
from geometry_msgs.msg import Twist, TwistStamped  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sim_bridge.ros.robot_node import SURE, RobotNode  # noqa: E402

from cfnav_core.robot.robot import Robot  # noqa: E402
from tests.conftest import wait_until  # noqa: E402


def ignore(*_):
    return None


@contextmanager
def robot_in(domain, taken):
    """A robot in lock-step that notes what it takes, and a driver; nothing spins yet."""
    rclpy.init(domain_id=domain)
    try:
        robot = RobotNode(
            on_velocity=lambda v, w: taken.append("velocity"), on_tilt=ignore,
            on_done=lambda done: taken.append("answer"), switch=ignore, on_own=ignore,
        )  # fmt: skip
        robot.connect(Robot(), clock=True, tilts=True, lock_step=True)
        executor = SingleThreadedExecutor()
        executor.add_node(robot)
        yield robot, executor, Node("driver")
        executor.shutdown()
    finally:
        rclpy.shutdown()


def test_a_velocity_is_taken_before_the_answer_that_was_sent_after_it(ros_domain_id):
    taken = []
    with robot_in(ros_domain_id, taken) as (robot, executor, driver):
        velocity = driver.create_publisher(TwistStamped, "cmd_vel", SURE)
        done = driver.create_publisher(MomentDone, "simulator/moment_done", SURE)

        def spin():
            executor.spin_once(timeout_sec=0.1)

        both = (velocity, done)
        wait_until(lambda: all(p.get_subscription_count() for p in both), "both ears", spin)
        # The subscription to velocities is made anew, so it is younger than that to answers.
        robot.take_faults(frozenset({"cmd_deaf"}))
        wait_until(lambda: not velocity.get_subscription_count(), "no ear", spin)
        robot.take_faults(frozenset())
        wait_until(velocity.get_subscription_count, "an ear again", spin)
        for moments in range(1, 21):
            velocity.publish(TwistStamped(twist=Twist()))
            done.publish(MomentDone(idle=False))
            wait_until(lambda n=moments: len(taken) == 2 * n, "both messages", spin)
    assert taken == ["velocity", "answer"] * 20
