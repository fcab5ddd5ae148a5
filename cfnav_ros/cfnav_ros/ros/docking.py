"""The base's own actions ``undock`` and ``dock``, as futures of what became of them."""

from __future__ import annotations

from concurrent.futures import Future
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from irobot_create_msgs.action import Dock, Undock
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node

from cfnav_core.robot.robot import Robot
from cfnav_ros.drive.own_motion import Begin
from cfnav_ros.drive.policy_parameters import PolicyParameters

REFUSED, GAVE_UP = "the base refused", "the base gave up"


class Docking:
    """Has a Create 3 leave its dock, or go back to it, where that is asked.

    Attributes:
        undock, dock: begin that, see ``drive.own_motion``; None where it is not asked.
    """

    def __init__(self, node: Node, robot: Robot, settings: PolicyParameters) -> None:
        """Find the base's actions.

        Raises:
            ValueError: the robot has no dock; one sentence.
        """
        if (settings.undock or settings.dock) and "dock_status" not in robot.topics:
            raise ValueError(
                f"undock or dock is true, but the robot {robot.name} has no dock: set both false."
            )
        self.undock = _beginning(node, Undock, "undock") if settings.undock else None
        self.dock = _beginning(node, Dock, "dock") if settings.dock else None


def _beginning(node: Node, kind: Any, name: str) -> Begin:
    return partial(_ask, ActionClient(node, kind, name), kind.Goal())


def _ask(client: ActionClient, goal: Any) -> Future[str] | None:
    """See ``Begin``."""
    if not client.server_is_ready():
        return None
    answer: Future[str] = Future()
    client.send_goal_async(goal).add_done_callback(partial(_accepted, answer))
    return answer


def _accepted(answer: Future[str], sent: Any) -> None:
    """The base has taken the goal, or refused it."""
    handle: ClientGoalHandle = sent.result()
    if not handle.accepted:
        _tell(answer, REFUSED)
        return
    answer.add_done_callback(partial(_stop, handle))
    handle.get_result_async().add_done_callback(partial(_ended, answer))


def _stop(handle: ClientGoalHandle, answer: Future[str]) -> None:
    if answer.cancelled():
        handle.cancel_goal_async()


def _ended(answer: Future[str], result: Any) -> None:
    _tell(answer, "" if result.result().status == GoalStatus.STATUS_SUCCEEDED else GAVE_UP)


def _tell(answer: Future[str], why: str) -> None:
    if not answer.cancelled():
        answer.set_result(why)
