"""The mock's ROS parameters as one frozen dataclass."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from cfnav_core.detect.errors import SHIPPED, ErrorModel
from cfnav_core.detect.labels import load_labels
from cfnav_core.robot.robot import Robot, load_robot, robot_setting
from cfnav_core.robot.settings import leaves, setting, settled
from cfnav_core.robot.topics import DETECTIONS_2D
from cfnav_core.task.camera import CameraSetUp
from sim_bridge.robot import stereo
from sim_bridge.robot.rplidar import MODES
from sim_bridge.world.world import LARGEST_PICTURE


@dataclass(frozen=True)
class MockParameters:
    """What can be chosen when the mock starts.

    Raises:
        ValueError: with one sentence, when a value cannot be used.
    """

    robot: str = robot_setting()
    room: str = setting("kitchen:21", "room as <type>:<seed>")
    goal: str = setting("", "category of the first episode; empty starts none")
    seed: int = setting(0, "draws the first start pose, and all noise until an episode starts", 0)
    start: tuple[float, ...] = setting((), "x m, y m, yaw rad; only without a goal")
    speed: float = setting(1.0, "times real time; 0 is as fast as it can", 0.0, 1000.0)
    camera: str = setting(
        "",
        "mast (1.3 m, 90 deg, tilts), stock_wide (as sold, 66 deg), stock_preview (40 deg), lite "
        "(the Lite's, 64 deg) or a JSON file of another; empty: the robot's",
    )
    camera_size: int = setting(0, "width and height of the picture, pixels; 0: the camera's own")
    scan_mode: str = setting(
        "Sensitivity", "of the LiDAR: Sensitivity (8 kHz, a TurtleBot 4's) or Standard (2 kHz)"
    )
    depth: bool = setting(False, "publish the depth of a stereo camera that sits where it does")
    depth_down_deg: float = setting(
        0.0, "by which that camera looks down and is fixed; 0: it tilts with the other", 0.0, 90.0
    )
    detector: str = setting(
        "",
        "errors of a detector that is on board: shipped, or a file of them; empty: there is none",
    )
    detector_labels: str = setting("coco", "by whose numbers it says what it knows")
    reflexes: bool = setting(True, "the base backs off by itself when it bumps into something")
    docked: bool = setting(False, "the robot starts on its dock, LiDAR and camera stopped")
    noise: float = setting(1.0, "scales the noise of sensors and wheels; 0 is none", 0.0, 10.0)
    visual_shift: float = setting(
        0.0, "another light and lens than in training; 1 is an evening", 0.0, 1.0
    )
    clock: str = setting("simulated", "simulated (publishes /clock) or system (stamps only)")
    lock_step: bool = setting(False, "stand at every moment until the policy has answered")
    true_estimate: bool = setting(
        False, "publish collision/estimate, of what truly is, with every scan; no LiDAR node then"
    )
    faults: str = setting("", "YAML file with a list of {fault, at | when, duration}")
    domain_guard: bool = setting(True, "refuse to start where another robot publishes")

    def __post_init__(self) -> None:
        if self.docked and "dock_status" not in self.described.topics:
            raise ValueError(f"docked is true, but the robot {self.described.name} has no dock.")
        if len(self.start) not in (0, 3) or not all(map(math.isfinite, self.start)):
            raise ValueError(f"start is {list(self.start)}; expected [x, y, yaw] in m, m, rad.")
        if self.depth and "depth" not in self.described.topics:
            raise ValueError(f"depth is true, but the robot {self.described.name} has no depth.")
        if self.detector and "detections" not in self.described.topics:
            raise ValueError(f"detector is given, but the robot {self.described.name} has none.")
        if self.detector and self.described.topics["detections"].type != DETECTIONS_2D:
            raise ValueError(
                f"detector is given, but the robot {self.described.name} says boxes with places, "
                "the mock only boxes; give topics.detections another name."
            )
        if self.detector:
            self.errors, load_labels(self.detector_labels)
        if self.start and self.goal:
            raise ValueError("start and goal are both given; a goal draws its start from seed.")
        if self.clock not in ("simulated", "system"):
            raise ValueError(f"clock is {self.clock!r}; expected simulated or system.")
        if self.clock == "system" and (self.speed != 1 or self.lock_step):
            raise ValueError("clock is system; expected speed 1 and no lock_step with it.")
        if max(self._chosen.size) > LARGEST_PICTURE:
            raise ValueError(
                f"camera is {self._named}; expected pictures of at most {LARGEST_PICTURE} pixels "
                "along each side."
            )
        if self.scan_mode not in MODES:
            raise ValueError(f"scan_mode is {self.scan_mode!r}; expected {' or '.join(MODES)}.")
        if self.camera_size and not 32 <= self.camera_size <= LARGEST_PICTURE:
            raise ValueError(
                f"camera_size is {self.camera_size}; expected 32 to {LARGEST_PICTURE} pixels, or 0."
            )
        _ = self.set_up  # refuses a square picture of a view that is none

    @property
    def described(self) -> Robot:
        """The robot that it plays: its topics, frames and joints."""
        return load_robot(self.robot)

    @property
    def errors(self) -> ErrorModel:
        """Of the detector that is on board."""
        return ErrorModel.load(SHIPPED if self.detector == "shipped" else Path(self.detector))

    @property
    def stereo_set_up(self) -> CameraSetUp:
        """The stereo camera."""
        return stereo.set_up_of(self.set_up, self.depth_down_deg)

    @property
    def set_up(self) -> CameraSetUp:
        """The camera, with the size asked for."""
        size = (self.camera_size, self.camera_size) if self.camera_size else self._chosen.size
        return replace(self._chosen, size=size)

    @property
    def _named(self) -> str:
        return self.camera or self.described.camera

    @property
    def _chosen(self) -> CameraSetUp:
        return CameraSetUp.read(self._named)


def read_parameters(node: Node) -> MockParameters:
    """Declare the parameters on a node and read what was given.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides=True``, so that
            misspelt names can be told.

    Raises:
        ValueError: with one sentence, for an unknown name, a wrong type or an unusable value.
    """
    given: dict[str, Any] = node.get_parameters_by_prefix("")
    chosen = settled(MockParameters(), {name: p.value for name, p in given.items()})
    for name, (spec, value) in leaves(chosen):
        if name not in given:
            about = ParameterDescriptor(
                description=spec.metadata["help"], dynamic_typing=True, read_only=True
            )
            node.declare_parameter(name, value, about)
    return chosen
