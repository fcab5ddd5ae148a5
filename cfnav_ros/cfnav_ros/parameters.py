"""ROS parameters from frozen dataclasses: names, defaults and descriptions in one place.

A field that is itself a dataclass gives its name as a prefix: ``motion.v_max``. Of a field's
metadata, ``help`` is the description, ``min`` and ``max`` are the range, and ``live`` says that it
may be changed while the node runs; all others are read once, at its start, and read-only.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from cfnav_ros.limits import EpisodeLimits
from cfnav_ros.preflight import TYPES
from cfnav_ros.scan_watch import LidarParameters
from cfnav_ros.settings import setting

__all__ = ["LidarParameters", "PolicyParameters", "declare"]

T = TypeVar("T")

OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides")


@dataclass(frozen=True)
class PolicyParameters:
    """Parameters of ``policy_node``."""

    bundle: str = setting("", "folder of a bundle; empty: the shipped one")
    allow_robot: bool = setting(False, "drive more than the node named mock_turtlebot4")
    cmd_vel_type: str = setting("auto", "auto, stamped (TwistStamped) or unstamped (Twist)")
    other_publishers: str = setting("", "nodes that may publish on cmd_vel too, by spaces")
    base_frame: str = setting("base_link", "frame of the velocities")
    image_topic: str = setting("oakd/rgb/preview/image_raw", "pictures of the camera")
    backend: str = setting("onnx", "what runs the policy's networks: onnx or torch")
    lock_step: bool = setting(False, "the simulator waits for an answer to each moment")
    goal: str = setting("", "category to look for at once; empty: none")
    tilt_joint: str = setting("camera_tilt", "in joint_states")
    rate: float = setting(
        20.0, "velocities per second; a base stops after 0.5 s without", 4.0, 100.0
    )
    clock_timeout: float = setting(
        2.0, "a node clock that stands this long ends an episode, real s", 0.5, 60.0
    )
    frozen_picture_time: float = setting(
        1.0,
        "one picture under new stamps is frozen, s; 0: never, for simulators without noise",
        0.0,
        60.0,
    )
    episode: EpisodeLimits = field(default_factory=EpisodeLimits)

    def __post_init__(self) -> None:
        if self.cmd_vel_type not in ("auto", *TYPES):
            raise ValueError(
                f"cmd_vel_type is {self.cmd_vel_type!r}, expected auto, stamped or unstamped."
            )
        if self.backend not in ("onnx", "torch"):
            raise ValueError(f"backend is {self.backend!r}, expected onnx or torch.")


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
    known = dict(_leaves(defaults))
    for name in node.get_parameters_by_prefix(""):
        if name not in known and name.split(".")[0] not in OF_RCLPY:
            raise ValueError(f"There is no parameter {name!r}; there are {', '.join(known)}.")
    _typed("use_sim_time", node.get_parameter("use_sim_time").value, False)
    values = {}
    for name, (spec, default) in known.items():
        given = node.get_parameter(name).value if node.has_parameter(name) else default
        values[name] = _checked(name, given, spec, default)
        about = _descriptor(spec, default, fixed=adopt is None or not spec.metadata.get("live"))
        if node.has_parameter(name):
            node.set_descriptor(name, about)
        else:
            node.declare_parameter(name, default, about)
    built = _build(defaults, "", values)
    if adopt is not None:
        _follow(node, defaults, known, values, adopt)
    return built


def _follow(
    node: Node, defaults: T, known: dict, values: dict[str, Any], adopt: Callable[[T], None]
) -> None:
    """Check what is set while the node runs, and hand over what was."""

    def read(changed: Sequence[Parameter]) -> dict[str, Any]:
        ours = [parameter for parameter in changed if parameter.name in known]
        return values | {p.name: _checked(p.name, p.value, *known[p.name]) for p in ours}

    def check(changed: Sequence[Parameter]) -> SetParametersResult:
        try:
            _build(defaults, "", read(changed))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(changed: Sequence[Parameter]) -> None:
        values.update(read(changed))
        adopt(_build(defaults, "", values))

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


def _leaves(value: Any, prefix: str = "") -> Iterator[tuple[str, tuple[Field, Any]]]:
    for spec in fields(value):
        default = getattr(value, spec.name)
        if is_dataclass(default):
            yield from _leaves(default, f"{prefix}{spec.name}.")
        else:
            yield f"{prefix}{spec.name}", (spec, default)


def _checked(name: str, value: Any, spec: Field, default: Any) -> Any:
    """The value in the type of the default and within the field's range, or ValueError."""
    value = _typed(name, value, default)
    low, high = spec.metadata.get("min"), spec.metadata.get("max")
    below, above = low is not None and not value >= low, high is not None and not value <= high
    if not (below or above):
        return value
    if low is None or high is None:
        wanted = f"at most {high:g}" if low is None else f"at least {low:g}"
    else:
        wanted = f"{low:g} to {high:g}"
    raise ValueError(f"{name} is {value}, expected {wanted}.")


def _typed(name: str, value: Any, default: Any) -> Any:
    """The value, or ValueError; a whole number will do for a float."""
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if type(value) is not type(default):
        raise ValueError(
            f"{name} is {value!r}, expected {type(default).__name__}, such as {default!r}."
        )
    return value


def _build(default: Any, prefix: str, values: dict[str, Any]) -> Any:
    arguments = {}
    for spec in fields(default):
        inner = getattr(default, spec.name)
        name = f"{prefix}{spec.name}"
        arguments[spec.name] = (
            _build(inner, f"{name}.", values) if is_dataclass(inner) else values[name]
        )
    return type(default)(**arguments)
