"""ROS parameters from frozen dataclasses: names, defaults and descriptions in one place.

A field that is itself a dataclass gives its name as a prefix: ``motion.v_max``. Parameters are read
once, at the start of a node.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from cfnav_ros.lidar import SweptDisc
from cfnav_ros.limits import EpisodeLimits
from cfnav_ros.mounting import SOURCES
from cfnav_ros.preflight import TYPES
from cfnav_ros.sweep import ErrorModel

T = TypeVar("T")

OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides")


@dataclass(frozen=True)
class PolicyParameters:
    """Parameters of ``policy_node``."""

    bundle: str = field(default="", metadata={"help": "folder of a bundle; empty: the shipped one"})
    allow_robot: bool = field(
        default=False, metadata={"help": "drive more than the node named mock_turtlebot4"}
    )
    cmd_vel_type: str = field(
        default="auto", metadata={"help": "auto, stamped (TwistStamped) or unstamped (Twist)"}
    )
    other_publishers: str = field(
        default="", metadata={"help": "nodes that may publish on cmd_vel too, by spaces"}
    )
    base_frame: str = field(default="base_link", metadata={"help": "frame of the velocities"})
    image_topic: str = field(
        default="oakd/rgb/preview/image_raw", metadata={"help": "pictures of the camera"}
    )
    backend: str = field(
        default="onnx", metadata={"help": "what runs the policy's networks: onnx or torch"}
    )
    lock_step: bool = field(
        default=False, metadata={"help": "the simulator waits for an answer to each moment"}
    )
    goal: str = field(default="", metadata={"help": "category to look for at once; empty: none"})
    tilt_joint: str = field(default="camera_tilt", metadata={"help": "in joint_states"})
    rate: float = field(default=20.0, metadata={"help": "velocities per second of node time"})
    clock_timeout: float = field(
        default=2.0, metadata={"help": "a node clock that stands this long ends an episode, real s"}
    )
    frozen_picture_time: float = field(
        default=1.0, metadata={"help": "one picture under new stamps is frozen, s; 0: never"}
    )
    episode: EpisodeLimits = field(default_factory=EpisodeLimits)

    def __post_init__(self) -> None:
        if self.cmd_vel_type not in ("auto", *TYPES):
            raise ValueError(
                f"cmd_vel_type is {self.cmd_vel_type!r}, expected auto, stamped or unstamped."
            )
        if self.backend not in ("onnx", "torch"):
            raise ValueError(f"backend is {self.backend!r}, expected onnx or torch.")
        if not 4.0 <= self.rate <= 100.0:
            raise ValueError(f"rate is {self.rate}, expected 4 to 100 (a base stops after 0.5 s).")


@dataclass(frozen=True)
class LidarParameters:
    """Parameters of ``lidar_collision_node``."""

    stale: float = field(
        default=0.4,
        metadata={"help": "age of a scan that is no sight, s", "min": 0.05, "max": 10.0},
    )
    stale_rate: float = field(
        default=10.0, metadata={"help": "BLIND per second while stale", "min": 1.0, "max": 100.0}
    )
    frozen: float = field(
        default=1.0,
        metadata={
            "help": "ranges that stay the same this long are no sight, s; 0: a noiseless simulator",
            "min": 0.0,
            "max": 3600.0,
        },
    )
    mount: str = field(
        default="auto", metadata={"help": "mounting: auto (TF where it is there), tf or parameters"}
    )
    base_frame: str = field(default="base_link", metadata={"help": "frame of the robot in TF"})
    frame: str = field(
        default="rplidar_link", metadata={"help": "frame that scans must come from; empty: any"}
    )
    disc: SweptDisc = field(default_factory=SweptDisc)
    errors: ErrorModel = field(default_factory=ErrorModel)

    def __post_init__(self) -> None:
        for name in ("stale", "stale_rate"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected a positive number.")
        if self.frozen < 0:
            raise ValueError(f"frozen is {self.frozen}, expected 0 or more.")
        if self.mount not in SOURCES:
            raise ValueError(f"mount is {self.mount!r}, expected {', '.join(SOURCES)}.")


def declare(node: Node, kind: type[T]) -> T:
    """Declare the fields of a dataclass as read-only parameters and read them.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides=True``, so that what was
            given but is no parameter can be told.
        kind: frozen dataclass with a default for every field.

    Returns:
        An instance with the values given to the node.

    Raises:
        ValueError: an unknown name, a wrong type or a value that the dataclass refuses; one
            sentence.
    """
    defaults = kind()
    known = dict(_leaves(defaults))
    for name in node.get_parameters_by_prefix(""):
        if name not in known and name.split(".")[0] not in OF_RCLPY:
            raise ValueError(f"There is no parameter {name!r}; there are {', '.join(known)}.")
    _typed("use_sim_time", node.get_parameter("use_sim_time").value, False)
    values = {}
    for name, (spec, default) in known.items():
        if not node.has_parameter(name):
            about = ParameterDescriptor(
                description=spec.metadata.get("help", ""), read_only=True, dynamic_typing=True
            )
            node.declare_parameter(name, default, about)
        values[name] = _typed(name, node.get_parameter(name).value, default)
    return _build(defaults, "", values)


def _leaves(value: Any, prefix: str = "") -> Iterator[tuple[str, tuple[Field, Any]]]:
    for spec in fields(value):
        default = getattr(value, spec.name)
        if is_dataclass(default):
            yield from _leaves(default, f"{prefix}{spec.name}.")
        else:
            yield f"{prefix}{spec.name}", (spec, default)


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
