"""What running nodes were told: their parameters, asked of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future


class ToldParameters:
    """Asks nodes for parameters once they are there, and again when one was changed.

    Attributes:
        said: values by node and dotted name, of the nodes that have answered.
    """

    def __init__(self, node: Node, asked: Mapping[str, Sequence[str]]) -> None:
        """Ask nobody yet.

        Args:
            node: whose namespace theirs is.
            asked: names of parameters, by name of the node.
        """
        self.said: dict[str, dict[str, Any]] = {}
        self._asked = asked
        self._clients = {
            name: node.create_client(GetParameters, f"{name}/get_parameters") for name in asked
        }
        self._names = {f"{node.get_namespace().rstrip('/')}/{name}": name for name in asked}
        self._open = set(asked)
        node.create_subscription(
            ParameterEvent, "/parameter_events", self._changed, qos_profile_parameter_events
        )

    def ask(self) -> None:
        """Ask those that are there and have not been asked since the last change."""
        for name in [*self._open]:
            if self._clients[name].service_is_ready():
                self._open.remove(name)
                answer = self._clients[name].call_async(
                    GetParameters.Request(names=[*self._asked[name]])
                )
                answer.add_done_callback(partial(self._take, name))

    def _take(self, name: str, answer: Future) -> None:
        values = answer.result().values
        if len(values) < len(self._asked[name]):  # not all of them are declared yet
            self._open.add(name)
            return
        read = map(parameter_value_to_python, values)
        self.said[name] = dict(zip(self._asked[name], read, strict=True))

    def _changed(self, event: ParameterEvent) -> None:
        if event.node in self._names:
            self._open.add(self._names[event.node])
