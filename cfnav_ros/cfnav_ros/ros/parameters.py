"""ROS parameters from frozen dataclasses, and those that other nodes were told.

``cfnav_core.robot.settings`` says names, defaults and what fields tell; those that are not ``live``
are read once, at the node's start, and read-only.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field
from functools import partial
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future

from cfnav_core.robot.robot import DEFAULT, Robot, load_robot
from cfnav_core.robot.settings import build, checked, leaves, settled, typed

T = TypeVar("T")

ASK_AGAIN_S = 2.0
"""Real time between questions to a node that has answered, or will not."""


def named_robot(node: Node) -> Robot:
    """The robot that the parameter ``robot`` of a node names.

    Raises:
        ValueError: there is none, or its file is of no use; one sentence.
    """
    given = node.has_parameter("robot")
    return load_robot(str(node.get_parameter("robot").value) if given else DEFAULT)


def declare(node: Node, defaults: T, adopt: Callable[[T], None] | None = None) -> T:
    """Declare the fields of a dataclass as parameters and read them.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides=True``, so that what was
            given but is no parameter can be told.
        defaults: frozen dataclass of settings.
        adopt: called with a new instance whenever ``live`` fields were changed; without it nothing
            can be changed.

    Returns:
        An instance with the values given to the node.

    Raises:
        ValueError: an unknown name, a wrong type or a value that the range or the dataclass
            refuses; one sentence.
    """
    typed("use_sim_time", node.get_parameter("use_sim_time").value, False)
    given: dict[str, Any] = node.get_parameters_by_prefix("")
    built = settled(defaults, {name: parameter.value for name, parameter in given.items()})
    for name, (spec, default) in leaves(defaults):
        about = _descriptor(spec, default, fixed=adopt is None or not spec.metadata.get("live"))
        if name in given:
            node.set_descriptor(name, about)
        else:
            node.declare_parameter(name, default, about)
    if adopt is not None:
        _follow(node, built, adopt)
    return built


def _follow(node: Node, built: T, adopt: Callable[[T], None]) -> None:
    """Check what is set while the node runs, and hand over what was."""
    known = dict(leaves(built))
    values = {name: value for name, (_, value) in known.items()}

    def read(changed: Sequence[Parameter]) -> dict[str, Any]:
        ours = [parameter for parameter in changed if parameter.name in known]
        return values | {p.name: checked(p.name, p.value, *known[p.name]) for p in ours}

    def check(changed: Sequence[Parameter]) -> SetParametersResult:
        try:
            build(built, read(changed))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(changed: Sequence[Parameter]) -> None:
        values.update(read(changed))
        adopt(build(built, values))

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(apply)


def _descriptor(spec: Field, default: Any, fixed: bool) -> ParameterDescriptor:
    about = ParameterDescriptor(
        description=spec.metadata.get("help", ""), read_only=fixed, dynamic_typing=True
    )
    low, high = spec.metadata.get("min"), spec.metadata.get("max")
    if low is None and high is None:
        return about
    if isinstance(default, float):
        most = sys.float_info.max
        about.floating_point_range = [
            FloatingPointRange(
                from_value=-most if low is None else float(low),
                to_value=most if high is None else float(high),
            )
        ]
    else:
        most = 2**31 - 1
        about.integer_range = [
            IntegerRange(
                from_value=-most if low is None else low, to_value=most if high is None else high
            )
        ]
    return about


class ToldParameters:
    """Asks other nodes for their parameters, time and again: they change, and nodes come anew.

    Attributes:
        said: values by node and dotted name, as each node said them last.
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
        self._next = dict.fromkeys(asked, 0.0)
        self._answers: dict[str, Future] = {}

    def ask(self, real: float) -> None:
        """Ask those that are there, each every ``ASK_AGAIN_S``.

        Args:
            real: monotonic time, seconds.
        """
        for name, client in self._clients.items():
            if real < self._next[name] or not client.service_is_ready():
                continue
            if name in self._answers:  # of a node that ended before it answered
                client.remove_pending_request(self._answers[name])
            self._next[name] = real + ASK_AGAIN_S
            request = GetParameters.Request(names=[*self._asked[name]])
            self._answers[name] = client.call_async(request)
            self._answers[name].add_done_callback(partial(self._take, name))

    def silent(self) -> list[str]:
        """Nodes that are there and have not said all that they were asked."""
        there = [name for name, client in self._clients.items() if client.service_is_ready()]
        return [name for name in there if name not in self.said]

    def _take(self, name: str, answer: Future) -> None:
        values = answer.result().values
        if len(values) == len(self._asked[name]):  # one that is not declared leaves all unsaid
            read = map(parameter_value_to_python, values)
            self.said[name] = dict(zip(self._asked[name], read, strict=True))
