"""Goals from the action, the topic and the parameter as one queue; the newest preempts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from cfnav_interfaces.action import NavigateToObject
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from std_msgs.msg import String

NEWER = "A newer goal came."


@dataclass(frozen=True, eq=False)
class Goal:
    """What to look for; ``handle`` is None for a goal by topic or parameter."""

    name: str
    max_steps: int = 0
    time_limit: float = 0.0
    handle: ServerGoalHandle | None = None

    def tell(self, feedback: NavigateToObject.Feedback) -> None:
        """Tell the client of the action how it goes."""
        if self.handle is not None:
            self.handle.publish_feedback(feedback)

    def settle(self, result: NavigateToObject.Result) -> None:
        """Tell the client of the action how it ended.

        Executed only now that the result is known: a coroutine that waits for it would keep
        rclpy's executor spinning, a blocking callback would cost a thread.
        """
        if self.handle is not None:
            self.handle.execute(partial(_settle, result=result))


def _settle(handle: ServerGoalHandle, result: NavigateToObject.Result) -> NavigateToObject.Result:
    if result.outcome == "done":
        handle.succeed()
    elif result.outcome == "canceled" and handle.is_cancel_requested:
        handle.canceled()
    else:
        handle.abort()
    return result


class Goals:
    """The goal that is served and the one that waits for its end.

    ``policy/goal`` takes a category by topic; an empty one cancels whatever is served. What the
    topic asked for last is not begun anew by its repetition, even after its end: publishers often
    repeat themselves, and nobody would expect the robot to set off again. Another category or an
    empty one makes it a new goal.
    """

    def __init__(
        self,
        node: Node,
        begin: Callable[[Goal], None],
        preempt: Callable[[str], None],
        tell: Callable[[Goal, NavigateToObject.Result], None],
    ) -> None:
        """Listen for goals.

        Args:
            node: owner of the action server and the subscription.
            begin: called with a goal to serve; ``end`` is called when it has ended.
            preempt: called with a sentence when the goal that is served must end for a newer one.
            tell: called with a goal by topic that was given up before it began, and its result.
        """
        self.current: Goal | None = None
        self.closing = False
        self._next: Goal | None = None
        self._silenced = False
        self._asked = ""
        self._node = node
        self._begin, self._preempt, self._tell = begin, preempt, tell
        self._server = ActionServer(
            node,
            NavigateToObject,
            "navigate_to_object",
            execute_callback=lambda handle: _settle(handle, NavigateToObject.Result()),
            goal_callback=self._admit,
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
        node.create_subscription(String, "policy/goal", self._hear, 10)

    @property
    def canceled(self) -> bool:
        """Whether somebody wants the goal that is served to end."""
        handle = self.current.handle if self.current else None
        return self._silenced or (handle is not None and handle.is_cancel_requested)

    def add(self, goal: Goal) -> None:
        """Serve a goal: now, or as soon as the present one has stopped the robot."""
        if self.current is None:
            self._serve(goal)
            return
        self._drop_next(NavigateToObject.Result(outcome="preempted", message=NEWER))
        self._next = goal
        self._preempt(NEWER)

    def end(self, result: NavigateToObject.Result) -> None:
        """Tell the client of the goal that was served, and take up the next one, if any."""
        goal, self.current = self.current, None
        if goal is not None:
            goal.settle(result)
        goal, self._next = self._next, None
        if goal is not None:
            self._serve(goal)

    def close(self) -> None:
        """Take no further goal, and give up the one that waits."""
        self.closing = True
        message = "The policy node was stopped."
        self._drop_next(NavigateToObject.Result(outcome="refused", message=message))

    def _serve(self, goal: Goal) -> None:
        self.current, self._silenced = goal, False
        self._begin(goal)

    def _drop_next(self, result: NavigateToObject.Result) -> None:
        goal, self._next = self._next, None
        if goal is not None:
            goal.settle(result)
            if goal.handle is None:
                self._tell(goal, result)

    def _admit(self, _: NavigateToObject.Goal) -> GoalResponse:
        # A goal that cannot be met is accepted and then refused: only a result carries a sentence.
        return GoalResponse.REJECT if self.closing else GoalResponse.ACCEPT

    def _accept(self, handle: ServerGoalHandle) -> None:
        asked = handle.request
        self.add(Goal(asked.goal, asked.max_steps, asked.time_limit, handle))

    def _hear(self, message: String) -> None:
        name, asked = message.data.strip(), self._asked
        self._asked = name
        newest = self._next or (None if self._silenced else self.current)
        if not name:
            self._drop_next(
                NavigateToObject.Result(outcome="canceled", message="An empty goal canceled it.")
            )
            self._silenced = self.current is not None
        elif self.closing or (newest and newest.handle is None and newest.name == name):
            return
        elif name == asked:
            self._node.get_logger().warning(
                f"{name} was asked for before: publish an empty goal first to look for it again.",
                throttle_duration_sec=10.0,
            )
        else:
            self.add(Goal(name))
