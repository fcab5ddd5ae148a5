"""The parameters of ``policy_node``. Pure; ``parameters`` reads them from ROS."""

from __future__ import annotations

from dataclasses import dataclass, field

from cfnav_ros.limits import EpisodeLimits
from cfnav_ros.preflight import TYPES
from cfnav_ros.settings import setting


@dataclass(frozen=True)
class PolicyParameters:
    """Parameters of ``policy_node``."""

    bundle: str = setting(
        "", "folder of a bundle, or the name of a shipped one; empty: the default"
    )
    allow_robot: bool = setting(False, "drive more than the node named mock_turtlebot4")
    cmd_vel_type: str = setting("auto", "auto, stamped (TwistStamped) or unstamped (Twist)")
    other_publishers: str = setting("", "nodes that may publish on cmd_vel too, by spaces")
    wait_for_recorder: bool = setting(False, "drive only once a recorder hears the velocities")
    base_frame: str = setting("base_link", "frame of the velocities")
    image_topic: str = setting("oakd/rgb/preview/image_raw", "pictures of the camera")
    backend: str = setting("onnx", "what runs the policy's networks: onnx or torch")
    sample_seed: int = setting(
        -1, "draw actions by their probabilities with this seed; -1: argmax", -1, 2**31 - 1
    )
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
