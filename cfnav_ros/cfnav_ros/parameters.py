"""ROS parameters from frozen dataclasses: names, defaults and descriptions in one place.

A field that is itself a dataclass gives its name as a prefix: ``motion.v_max``. Of a field's
metadata, ``help`` is the description, ``min`` and ``max`` are the range, and ``live`` says that it
may be changed while the node runs; all others are read once, at its start, and read-only.
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

from cfnav_ros.settings import OF_RCLPY, build, checked, leaves, typed, unknown

T = TypeVar("T")


def declare(node: Node, kind: type[T], adopt: Callable[[T], None] | None = None) -> T:
    """Declare the fields of a dataclass as parameters and read them.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides=True``, so that what was
            given but is no parameter can be told.
        kind: frozen dataclass with a default for every field.
        adopt: called with a new instance whenever ``live`` fields were changed; without it nothing
            can be changed.

    Returns:
        An instance with the values given to the node.

    Raises:
        ValueError: an unknown name, a wrong type or a value that the range or the dataclass
            refuses; one sentence.
    """
    defaults = kind()
    known = dict(leaves(defaults))
    for name in node.get_parameters_by_prefix(""):
        if name not in known and name.split(".")[0] not in OF_RCLPY:
            raise unknown(name, known)
    typed("use_sim_time", node.get_parameter("use_sim_time").value, False)
    values = {}
    for name, (spec, default) in known.items():
        given = node.get_parameter(name).value if node.has_parameter(name) else default
        values[name] = checked(name, given, spec, default)
        about = _descriptor(spec, default, fixed=adopt is None or not spec.metadata.get("live"))
        if node.has_parameter(name):
            node.set_descriptor(name, about)
        else:
            node.declare_parameter(name, default, about)
    built = build(defaults, values)
    if adopt is not None:
        _follow(node, defaults, known, values, adopt)
    return built


def _follow(
    node: Node, defaults: T, known: dict, values: dict[str, Any], adopt: Callable[[T], None]
) -> None:
    """Check what is set while the node runs, and hand over what was."""

    def read(changed: Sequence[Parameter]) -> dict[str, Any]:
        ours = [parameter for parameter in changed if parameter.name in known]
        return values | {p.name: checked(p.name, p.value, *known[p.name]) for p in ours}

    def check(changed: Sequence[Parameter]) -> SetParametersResult:
        try:
            build(defaults, read(changed))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(changed: Sequence[Parameter]) -> None:
        values.update(read(changed))
        adopt(build(defaults, values))

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
