"""A docked robot and a goal: it leaves its dock, drives, and goes back, with real nodes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_interfaces.action import NavigateToObject  # noqa: E402
from cfnav_interfaces.msg import EpisodeStatus  # noqa: E402
from cfnav_ros.drive.fields import stamp_to_ns  # noqa: E402
from irobot_create_msgs.msg import DockStatus  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402

from tests.conftest import ROOT  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402

SIMULATION = ROOT / "ros_ws/src/cfnav_bringup/config/simulation.yaml"
PICTURES = "oakd/rgb/preview/image_raw"
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_goals_take_a_robot_from_its_dock_and_back(
    start_process: Callable, eager_bundle: Path, ros_domain_id: int, tmp_path: Path
) -> None:
    params = tmp_path / "docked.yaml"
    own = SIMULATION.read_text().replace("docked: false", "docked: true")
    docks = "  ros__parameters:\n    undock: true\n    dock: true\n"
    params.write_text(
        own.replace("policy_node:\n  ros__parameters:\n", f"policy_node:\n{docks}", 1)
    )
    client = OwnNode(ros_domain_id, "client")
    told, statuses = list[EpisodeStatus](), list[DockStatus]()
    client.node.create_subscription(EpisodeStatus, "policy/episode", told.append, LATCHED)
    client.node.create_subscription(DockStatus, "dock_status", statuses.append, LATCHED)
    asked = ActionClient(client.node, NavigateToObject, "navigate_to_object")
    process = start_process(
        *("cfnav.cli", "simulate", "--params", str(params), "--room", "kitchen:21", "--seed", "4"),
        *("--bundle", str(eager_bundle), "--logs", str(tmp_path / "logs")),
    )
    try:
        process.wait_for_line("^policy_node: .*Bundle eager")
        client.wait(asked.server_is_ready, "the policy node")
        client.wait(lambda: statuses, "the dock's status")
        assert statuses[-1].is_docked

        def drive() -> NavigateToObject.Result:
            silent = partial(client.node.count_publishers, PICTURES)
            client.wait(lambda: silent() == 0, "the camera to be off, its publisher gone")
            sent = asked.send_goal_async(NavigateToObject.Goal(goal="Sink", max_steps=1))
            client.wait(sent.done, "the goal to be accepted")
            future = sent.result().get_result_async()
            client.wait(future.done, "the result")
            return future.result().result

        result = drive()
        assert (result.outcome, result.steps) == ("step_limit", 1), result.message
        assert result.message == "1 decisions were made without Done."
        # The way from the dock and back is no part of the drive.
        assert result.path_length == pytest.approx(0.25, abs=0.1)
        client.wait(lambda: statuses[-1].is_docked, "the dock's status")
        client.wait(lambda: len(told) == 2, "the drive's begin and end")
        begun, ended = told
        assert (begun.phase, ended.phase) == (EpisodeStatus.STARTED, EpisodeStatus.ENDED)
        away = [stamp_to_ns(s.header.stamp) for s in statuses if not s.is_docked]
        assert away[0] < stamp_to_ns(begun.header.stamp) < stamp_to_ns(ended.header.stamp)
        assert stamp_to_ns(ended.header.stamp) < stamp_to_ns(statuses[-1].header.stamp)
        # The camera, off on the dock, has another publisher now.
        again = drive()
        assert (again.outcome, again.steps) == ("step_limit", 1), again.message
    finally:
        client.close()
    assert process.interrupt() == 0, process.output
