"""ROS parameters from frozen dataclasses: names, defaults and descriptions in one place.

``cfnav_core.robot.settings`` says what fields tell; those that are not ``live`` are read once, at
the node's start, and read-only.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import Field
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from cfnav_core.robot.robot import DEFAULT, Robot, load_robot
from cfnav_core.robot.settings import build, checked, leaves, settled, typed

T = TypeVar("T")


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
