"""What becomes of the base's own actions where it refuses, gives up, hangs or is gone."""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.drive.policy_parameters import PolicyParameters  # noqa: E402
from cfnav_ros.ros.docking import GAVE_UP, REFUSED, Docking  # noqa: E402
from irobot_create_msgs.action import Undock  # noqa: E402
from rclpy.action import ActionServer, CancelResponse, GoalResponse  # noqa: E402

from cfnav_core.robot.robot import load_robot  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402


class Base:
    """A base whose action ``undock`` takes a goal and goes no further by itself."""

    def __init__(self, domain: int, answer: GoalResponse = GoalResponse.ACCEPT) -> None:
        self.ear = OwnNode(domain, "base")
        self.goals, self.canceled, self.carried_out = [], [], False
        self.server = ActionServer(
            self.ear.node, Undock, "undock", execute_callback=self.end,
            goal_callback=lambda _: answer, handle_accepted_callback=self.goals.append,
            cancel_callback=self.cancel,
        )  # fmt: skip
        settings = PolicyParameters(undock=True)
        self.begin = Docking(self.ear.node, load_robot("turtlebot4"), settings).undock

    def ask(self):
        """Ask until somebody is there."""
        answers = []

        def taken():
            answers.append(self.begin())
            return answers[-1]

        self.ear.wait(taken, "somebody who undocks")
        return answers[-1]

    def cancel(self, goal):
        self.canceled.append(goal)
        return CancelResponse.ACCEPT

    def end(self, goal):
        goal.succeed() if self.carried_out else goal.abort()
        return Undock.Result()


@pytest.fixture
def base(ros_domain_id):
    made = []

    def make(*args):
        made.append(Base(ros_domain_id, *args))
        return made[-1]

    yield make
    for one in made:
        one.ear.close()


def test_a_base_that_refuses_is_told_at_once(base):
    robot = base(GoalResponse.REJECT)
    answer = robot.ask()
    robot.ear.wait(answer.done, "the refusal")
    assert answer.result() == REFUSED


@pytest.mark.parametrize(("carried_out", "why"), [(True, ""), (False, GAVE_UP)])
def test_what_the_base_says_at_the_end_is_the_answer(base, carried_out, why):
    robot = base()
    robot.carried_out = carried_out
    answer = robot.ask()
    robot.ear.wait(lambda: robot.goals, "the goal")
    assert not answer.done()
    robot.goals[0].execute()
    robot.ear.wait(answer.done, "the end")
    assert answer.result() == why


@pytest.mark.parametrize("accepted", [False, True], ids=["before it is accepted", "while it hangs"])
def test_a_base_that_hangs_is_told_to_stop_when_nobody_waits_any_more(base, accepted):
    robot = base()
    answer = robot.ask()
    if accepted:
        robot.ear.wait(lambda: robot.goals, "the goal")
    answer.cancel()
    robot.ear.wait(lambda: robot.canceled, "the base to be told")
    assert answer.cancelled()


def test_a_base_that_is_gone_leaves_the_answer_open_and_is_not_asked_again(base):
    robot = base()
    answer = robot.ask()
    robot.ear.wait(lambda: robot.goals, "the goal")
    robot.server.destroy()
    robot.ear.wait(lambda: robot.begin() is None, "nobody who undocks")
    assert not answer.done()
    answer.cancel()  # as the episode does when its time is over; nobody hears it


def test_a_robot_without_a_dock_cannot_be_asked(base):
    with pytest.raises(ValueError, match="differential has no dock"):
        Docking(base().ear.node, load_robot("differential"), PolicyParameters(dock=True))
