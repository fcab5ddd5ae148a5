"""The mock's ROS parameters as one frozen dataclass."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from sim_bridge.camera import SET_UPS, CameraSetUp
from sim_bridge.world import LARGEST_PICTURE

_OWNED_BY_RCLPY = {"use_sim_time", "start_type_description_service"}


def _parameter(default: Any, description: str) -> Any:
    return field(default=default, metadata={"description": description})


@dataclass(frozen=True)
class MockParameters:
    """What can be chosen when the mock starts.

    Raises:
        ValueError: with one sentence, when a value cannot be used.
    """

    room: str = _parameter("kitchen:21", "room as <type>:<seed>")
    goal: str = _parameter("", "category of the first episode; empty starts none")
    seed: int = _parameter(0, "draws the first start pose, and all noise until an episode starts")
    start: tuple[float, ...] = _parameter((), "x m, y m, yaw rad; only without a goal")
    speed: float = _parameter(1.0, "times real time; 0 is as fast as it can")
    camera: str = _parameter("mast", "mast (1.3 m, 90 deg, tilts) or preview (as sold, 40 deg)")
    camera_size: int = _parameter(0, "width and height of the picture, pixels; 0: the camera's own")
    reflexes: bool = _parameter(True, "the base backs off by itself when it bumps into something")
    docked: bool = _parameter(False, "the robot starts on its dock, LiDAR and camera stopped")
    noise: float = _parameter(1.0, "scales the noise of sensors and wheels; 0 is none")
    visual_shift: float = _parameter(
        0.0, "another light and lens than in training; 1 is an evening"
    )
    clock: str = _parameter("simulated", "simulated (publishes /clock) or system (stamps only)")
    lock_step: bool = _parameter(False, "stand at every moment until the policy has answered")
    true_estimate: bool = _parameter(
        False, "publish collision/estimate, of what truly is, with every scan; no LiDAR node then"
    )
    faults: str = _parameter("", "YAML file with a list of {fault, at | when, duration}")
    domain_guard: bool = _parameter(True, "refuse to start where another robot publishes")

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}; expected 0 or more.")
        if len(self.start) not in (0, 3) or not all(map(math.isfinite, self.start)):
            raise ValueError(f"start is {list(self.start)}; expected [x, y, yaw] in m, m, rad.")
        if self.start and self.goal:
            raise ValueError("start and goal are both given; a goal draws its start from seed.")
        if not (self.speed >= 0 and math.isfinite(self.speed)):
            raise ValueError(f"speed is {self.speed}; expected 0 or more times real time.")
        if self.clock not in ("simulated", "system"):
            raise ValueError(f"clock is {self.clock!r}; expected simulated or system.")
        if self.clock == "system" and (self.speed != 1 or self.lock_step):
            raise ValueError("clock is system; expected speed 1 and no lock_step with it.")
        if self.camera not in SET_UPS:
            raise ValueError(f"camera is {self.camera!r}; expected {' or '.join(SET_UPS)}.")
        if self.camera_size and not 32 <= self.camera_size <= LARGEST_PICTURE:
            raise ValueError(
                f"camera_size is {self.camera_size}; expected 32 to {LARGEST_PICTURE} pixels, or 0."
            )
        if not 0 <= self.noise <= 10:
            raise ValueError(f"noise is {self.noise}; expected 0 to 10 times the nominal noise.")
        if not 0 <= self.visual_shift <= 1:
            raise ValueError(f"visual_shift is {self.visual_shift}; expected 0 (none) to 1.")

    @property
    def set_up(self) -> CameraSetUp:
        """The camera, with the size asked for."""
        chosen = SET_UPS[self.camera]
        return replace(chosen, size=self.camera_size or chosen.size)


def read_parameters(node: Node) -> MockParameters:
    """Declare the parameters on a node and read what was given.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides=True``, so that
            misspelt names can be told.

    Raises:
        ValueError: with one sentence, for an unknown name, a wrong type or an unusable value.
    """
    known = {f.name: f for f in fields(MockParameters)}
    unknown = sorted(set(node.get_parameters_by_prefix("")) - set(known) - _OWNED_BY_RCLPY)
    if unknown:
        raise ValueError(f"parameter '{unknown[0]}' is unknown; known are {', '.join(known)}.")
    values: dict[str, Any] = {}
    for name, f in known.items():
        if not node.has_parameter(name):
            descriptor = ParameterDescriptor(
                description=f.metadata["description"], dynamic_typing=True, read_only=True
            )
            node.declare_parameter(name, f.default, descriptor)
        values[name] = _typed(name, node.get_parameter(name).value, f.default)
    return MockParameters(**values)


def _typed(name: str, value: Any, default: Any) -> Any:
    """The value in the type of the default; YAML writes 2 where a float 2.0 is meant."""
    if isinstance(default, tuple) and not isinstance(value, (str, bool, int, float)):
        return tuple(value)
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if type(value) is not type(default):
        raise ValueError(
            f"{name} is {value!r}; expected {type(default).__name__}, such as {default!r}."
        )
    return value
