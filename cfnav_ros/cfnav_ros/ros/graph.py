"""The whole graph as separate processes, and the client that runs episodes in it.

Starts the mock TurtleBot 4, the LiDAR collision node and the policy node in a ROS domain of their
own that never leaves this machine, so that no robot on the network can be moved.
"""

from __future__ import annotations

import math
import os
import re
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import CollisionEstimate, GroundTruth
from cfnav_interfaces.srv import EndEpisode, StartEpisode
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.task import Future

from cfnav_core.command.interrupt import INTERRUPT
from cfnav_core.robot.robot import load_robot
from cfnav_core.robot.topics import TOPICS
from cfnav_core.task.vocabulary import CATEGORIES
from cfnav_ros.drive.outcome import Outcome
from cfnav_ros.process.domains import Domain
from cfnav_ros.process.graph_config import GraphConfig
from cfnav_ros.process.processes import DISCOVERY_S, Child, GraphError, keep_local, node_command
from cfnav_ros.ros.recorder import Recorder
from cfnav_ros.ros.spinning import join, leave
from cfnav_ros.ros.topics import quality

TRACK_M = 0.02
"""Points of a track are this far apart."""

READY_S = 90.0
"""Patience with the start of all nodes, wall seconds."""

REQUEST_S = 120.0
"""Patience with one answer of the simulator, wall seconds; it searches the room for a start."""

SILENCE_S = 120.0
"""Patience between two decisions of the policy, wall seconds."""

HEARD = ("clock", "image", "scan", "odom", "truth")
"""Roles of topics that the recorder must hear before the first episode."""


@dataclass(frozen=True)
class EpisodeStart:
    """The answer to a request for an episode; ``goals`` are those that the room has."""

    ok: bool
    message: str
    goals: tuple[str, ...] = ()


class RosGraph:
    """The running nodes and a client; use it as a context manager from the main thread."""

    def __init__(self, config: GraphConfig) -> None:
        """Only remember what to start."""
        self.config = config
        self.context = Context()
        self.domain = 0
        self._taken: Domain | None = None
        self.recorder: Recorder | None = None
        self.children: dict[str, Child] = {}
        self._node: Node | None = None
        self.track: list[tuple[float, float, int]] = []
        """Of the last episode: true x and y (m) and collisions so far, every ``TRACK_M``."""
        self.map: OccupancyGrid | None = None
        """Of the room of the last episode, when tracks are followed."""
        self.message = ""
        """Why the last episode ended, one sentence."""
        self._episodes = 0

    def __enter__(self) -> RosGraph:
        """Start everything and wait until it is ready.

        Raises:
            GraphError: a process ended, the domain is in use, or something did not appear in time.
        """
        try:
            self._join()
            if self.config.bag is not None:
                self.recorder = Recorder(
                    self.config.bag, self.context, robot=load_robot(self.config.described)
                )
            self._start_children()
            self._wait_until_ready()
        except BaseException:
            self.close(keep_bag=False)
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End everything; the bag is kept when nothing was raised."""
        self.close(keep_bag=kind is None)

    @property
    def node(self) -> Node:
        """This process's own node, while the graph runs."""
        assert self._node is not None
        return self._node

    def start_episode(
        self, room: str, goal: str, seed: int, start: Sequence[float] = ()
    ) -> EpisodeStart:
        """Place the robot at a start pose: x m, y m, yaw rad, or drawn from the seed."""
        request = StartEpisode.Request(room=room, goal=goal, seed=seed, start=list(start))
        answer = self.call(self._start_client, request, "simulator/start_episode")
        goals = tuple(w for w in re.findall(r"\w+", answer.message) if w in CATEGORIES)
        return EpisodeStart(answer.ok, answer.message, goals)

    def navigate(
        self,
        goal: str,
        max_steps: int = 0,
        on_step: Callable[[NavigateToObject.Feedback], None] = lambda _: None,
    ) -> NavigateToObject.Result:
        """Send a goal and wait for its result; ``on_step`` is called at every decision."""
        steps: deque[NavigateToObject.Feedback] = deque()
        handle = self.send_goal(goal, max_steps, steps.append)
        if not handle.accepted:
            return NavigateToObject.Result(outcome="refused", message="the goal was not accepted")
        result = handle.get_result_async()
        while not result.done():
            self.until(
                lambda: result.done() or bool(steps), SILENCE_S, "next decision of policy_node"
            )
            while steps:
                on_step(steps.popleft())
        return result.result().result

    def send_goal(
        self,
        goal: str,
        max_steps: int = 0,
        on_step: Callable[[NavigateToObject.Feedback], None] = lambda _: None,
    ) -> ClientGoalHandle:
        """Send a goal and return its handle; ``on_step`` is called while ``until`` receives."""
        sent = self._navigate_client.send_goal_async(
            NavigateToObject.Goal(goal=goal, max_steps=max_steps),
            feedback_callback=lambda message: on_step(message.feedback),
        )
        return self._wait(sent, REQUEST_S, "answer of navigate_to_object")

    def end_episode(self) -> EndEpisode.Response:
        """Ask the simulator for its own account of the episode.

        Raises:
            GraphError: the simulator knows of no episode.
        """
        answer = self.call(self._end_client, EndEpisode.Request(), "simulator/end_episode")
        if not answer.ok:
            raise GraphError(f"the simulator gave no account of the episode: {answer.message}")
        return answer

    def run_episode(
        self,
        room: str,
        goal: str,
        max_steps: int = 0,
        on_step: Callable[[NavigateToObject.Feedback], None] = lambda _: None,
    ) -> Outcome:
        """Drive to a goal after ``start_episode`` and return the simulator's own outcome.

        Raises:
            GraphError: the policy refused the goal, or a node failed.
        """
        self.track.clear()
        result = self.navigate(goal, max_steps, on_step)
        self.message = result.message
        if result.outcome == "refused":
            raise GraphError(f"the policy node refused the goal {goal!r}: {result.message}")
        self._episodes += 1
        if self.recorder and not self.recorder.wait_for("episode", 2 * self._episodes):
            raise GraphError("the recorder did not hear the end of the episode within 10 s")
        truth = self.end_episode()
        success = result.outcome == "done" and truth.goal_visible
        return Outcome(
            goal=goal,
            room=room,
            outcome=result.outcome,
            success=success,
            collisions=truth.collisions,
            cf_success=success and truth.collisions == 0,
            steps=result.steps,
            path_length_m=truth.path_length,
            shortest_path_m=truth.shortest_path,
        )

    def call(self, client: Any, request: Any, name: str) -> Any:
        """Ask a service of the graph and return its answer."""
        return self._wait(client.call_async(request), REQUEST_S, f"answer of {name}")

    def until(self, condition: Callable[[], bool], patience_s: float, what: str) -> None:
        """Receive and watch the processes until a condition holds.

        Raises:
            GraphError: a process ended, or the condition did not come true in time.
        """
        end = time.monotonic() + patience_s
        while not condition():
            self.check()
            if time.monotonic() > end:
                raise GraphError(
                    f"no {what} within {patience_s:.0f} s; see the logs in {self.config.logs}"
                )
            self.receive()

    def receive(self) -> None:
        """Take in what comes within a tenth of a second, whatever has become of the processes."""
        self._executor.spin_once(timeout_sec=0.1)

    def check(self) -> None:
        """Raise GraphError when one of the processes has ended, KeyboardInterrupt after Ctrl-C."""
        INTERRUPT.check()
        for child in self.children.values():
            if sentence := child.ended():
                raise GraphError(sentence)

    def close(self, keep_bag: bool) -> None:
        """End all processes, the driving one first so that its last command is zero."""
        for child in reversed(self.children.values()):
            child.stop()
        self.children.clear()
        if self.recorder is not None:
            recorder, self.recorder = self.recorder, None
            recorder.close() if keep_bag else recorder.abort()
        if self._node is not None:
            self._executor.shutdown()
            leave(self._node)
            self._node = None
        self.context.try_shutdown()
        if self._taken is not None:
            self._taken.release()

    def _join(self) -> None:
        """Join a domain in which nobody else answers."""
        keep_local(os.environ, self.config.logs)
        self._taken = Domain(self.config.domain)
        self.domain = self._taken.number
        os.environ["ROS_DOMAIN_ID"] = str(self.domain)
        join(self.domain, self.context)
        self._node = Node("demo", context=self.context)
        self._start_client = self.node.create_client(StartEpisode, "simulator/start_episode")
        self._end_client = self.node.create_client(EndEpisode, "simulator/end_episode")
        self._navigate_client = ActionClient(self.node, NavigateToObject, "navigate_to_object")
        if self.config.track:
            self._listen(GroundTruth, "truth", self._follow)
            self._listen(OccupancyGrid, "map", self._keep_map)
        # Turned by the waits of this thread alone: a second one could take an answer in before
        # rclpy has noted that it was asked for.
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        end = time.monotonic() + DISCOVERY_S
        while time.monotonic() < end:
            others = [n for n in self.node.get_node_names() if n != self.node.get_name()]
            if others:
                raise GraphError(
                    f"ROS domain {self.domain} is in use on this machine by {', '.join(others)}; "
                    "end them or choose another with --domain"
                )
            time.sleep(0.1)

    def _listen(self, kind: Any, role: str, act: Callable[[Any], None]) -> Subscription:
        topic = TOPICS[role]
        return self.node.create_subscription(kind, topic.name, act, quality(topic))

    def _follow(self, truth: GroundTruth) -> None:
        x, y, collisions = self.track[-1] if self.track else (math.inf, math.inf, 0)
        if math.hypot(truth.x - x, truth.y - y) >= TRACK_M or truth.collisions != collisions:
            self.track.append((truth.x, truth.y, truth.collisions))

    def _keep_map(self, message: OccupancyGrid) -> None:
        self.map = message

    def _start_children(self) -> None:
        """Start the nodes in the order in which they are ended in reverse."""
        logs = self.config.logs
        logs.mkdir(parents=True, exist_ok=True)
        for part in self.config.parts:
            name, log = part.executable, logs / f"{part.executable}.log"
            command = [*node_command(part.package, name), "--ros-args", *part.arguments]
            self.children[name] = Child(name, command, log, os.environ)

    def _wait_until_ready(self) -> None:
        """Wait until the services, the action and the first collision estimate are there."""
        estimates: list[CollisionEstimate] = []
        listener = self._listen(CollisionEstimate, "estimate", estimates.append)
        conditions: dict[str, Callable[..., bool]] = {
            "simulator/start_episode of mock_turtlebot4": self._start_client.service_is_ready,
            "simulator/end_episode of mock_turtlebot4": self._end_client.service_is_ready,
            "first collision/estimate": lambda: bool(estimates),
            "navigate_to_object of policy_node": self._navigate_client.server_is_ready,
        }
        if recorder := self.recorder:
            for role in HEARD:
                conditions[f"{role} in the bag"] = lambda role=role: recorder.count(role) > 0
        for name, ready in conditions.items():
            self.until(ready, READY_S, name)
        self.node.destroy_subscription(listener)

    def _wait(self, future: Future, patience_s: float, what: str) -> Any:
        """Return the result of a future."""
        self.until(future.done, patience_s, what)
        return future.result()
