"""The node ``simulator``: what there is only because the robot is simulated.

Ground truth goes straight out: no fault touches it. Its services wait for the mock's loop, so this
node has a thread of its own and commands to the robot do not wait behind them.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from cfnav_interfaces.srv import EndEpisode, SetFault, StartEpisode
from rclpy.node import Node

from cfnav_core.robot.topics import TOPICS
from sim_bridge.ros.topics import publisher

HandOver = Callable[..., Future]
"""Leaves a function and its arguments for the mock's loop; its value comes with the future."""


class SimulatorNode(Node):
    """Publishers and services of the simulator.

    Args:
        hand_over: leaves work for the loop.
        start_episode, end_episode, set_fault: request and empty response -> response, in the loop;
            or a future that the loop will give it.
        lock_step: whether moments are announced.
        true_estimate: whether it says on ``collision/estimate`` what truly is.
    """

    def __init__(
        self,
        hand_over: HandOver,
        start_episode: Callable[[Any, Any], Any],
        end_episode: Callable[[Any, Any], Any],
        set_fault: Callable[[Any, Any], Any],
        lock_step: bool,
        true_estimate: bool,
    ) -> None:
        super().__init__("simulator")
        self._hand_over = hand_over
        self.truth, self.map, self.fault = (
            publisher(self, TOPICS[role]) for role in ("truth", "map", "fault")
        )
        self.estimate = publisher(self, TOPICS["estimate"]) if true_estimate else None
        self.moment = publisher(self, TOPICS["moment"]) if lock_step else None
        for kind, name, answer in (
            (StartEpisode, "start_episode", start_episode),
            (EndEpisode, "end_episode", end_episode),
            (SetFault, "set_fault", set_fault),
        ):
            self.create_service(kind, f"simulator/{name}", self._in_loop(answer))

    def _in_loop(self, answer: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """A service callback that waits until the loop has answered."""

        def serve(request: Any, response: Any) -> Any:
            given = self._hand_over(answer, request, response).result()
            return given.result() if isinstance(given, Future) else given

        return serve
