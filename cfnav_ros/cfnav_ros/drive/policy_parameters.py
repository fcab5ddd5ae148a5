"""The parameters of ``policy_node``. Pure; ``parameters`` reads them from ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Literal

from cfnav_core.robot.robot import CMD_VEL_TYPES, Robot, robot_setting
from cfnav_core.robot.settings import setting
from cfnav_core.task.p_hat import SOURCES
from cfnav_ros.drive.detection_watch import DetectionSettings
from cfnav_ros.drive.inputs import PICTURE
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import MotionLimits


@dataclass(frozen=True)
class PolicyParameters:
    """Parameters of ``policy_node``."""

    robot: str = robot_setting()
    bundle: str = setting("default", "folder of a bundle, or the name of a shipped one")
    allow_robot: bool = setting(False, "drive more than the node named mock_turtlebot4")
    cmd_vel_type: str = setting("auto", "auto, stamped (TwistStamped) or unstamped (Twist)")
    cmd_vel_topic: str = setting(
        "", "input of a multiplexer to send the velocities to; empty: straight to the robot"
    )
    other_publishers: str = setting("", "nodes that may publish on cmd_vel too, by spaces")
    wait_for_recorder: bool = setting(False, "drive only once a recorder hears the velocities")
    base_frame: str = setting("base_link", "frame of the velocities")
    other_camera: bool = setting(
        False, "drive although camera_info tells of another camera than the bundle learnt from"
    )
    backend: Literal["onnx", "torch"] = setting(
        "onnx", "what runs the policy's networks: onnx or torch"
    )
    sample_seed: int = setting(
        -1, "draw actions by their probabilities with this seed; -1: argmax", -1, 2**31 - 1
    )
    room_type: str = setting(
        "", "where the robot is (kitchen, living_room, ...), for bundles that look it up"
    )
    lock_step: bool = setting(False, "the simulator waits for an answer to each moment")
    undock: bool = setting(False, "a robot on its dock leaves it for a goal, by the base's action")
    dock: bool = setting(False, "after a drive it goes back to a dock in sight, in the same way")
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
    detections: DetectionSettings = field(default_factory=DetectionSettings)
    episode: EpisodeLimits = field(default_factory=EpisodeLimits)

    @classmethod
    def of(cls, robot: Robot) -> PolicyParameters:
        """What holds on a robot unless somebody says otherwise."""
        motion = MotionLimits(**asdict(robot.limits))
        return cls(
            bundle=robot.bundle,
            base_frame=robot.base_frame,
            cmd_vel_type=robot.cmd_vel_type,
            tilt_joint=robot.tilt_joint,
            episode=EpisodeLimits(has_tilt=robot.tilts, motion=motion),
        )

    def __post_init__(self) -> None:
        if self.cmd_vel_type not in CMD_VEL_TYPES:
            raise ValueError(
                f"cmd_vel_type is {self.cmd_vel_type!r}, expected auto, stamped or unstamped."
            )
        if self.backend not in ("onnx", "torch"):
            raise ValueError(f"backend is {self.backend!r}, expected onnx or torch.")

    def check_suits(self, bundle: str, reads_sightings: bool) -> None:
        """Whether a bundle can be driven so.

        Args:
            bundle: its name.
            reads_sightings: and sees no picture.

        Raises:
            ValueError: its own predictor is asked for, and it sees none; one sentence.
        """
        if reads_sightings and "own" in SOURCES[self.episode.p_hat_kind].needs:
            raise ValueError(
                f"episode.p_hat is {self.episode.p_hat!r}, but bundle {bundle} reads detections "
                "and sees no pictures, from which its predictor learnt: set episode.p_hat to lidar."
            )

    def announcement(
        self, bundle: str, goals: Sequence[str], view: str, view_topic: str, velocity_topic: str
    ) -> str:
        """What the node says of itself at its start: which bundle drives, and by what.

        Args:
            bundle: its name.
            goals: names that it can look for.
            view: what it looks at, ``inputs.PICTURE`` or ``DETECTIONS``.
            view_topic: resolved name of their topic.
            velocity_topic: the same of the velocities'.
        """
        probability = SOURCES[self.episode.p_hat_kind].comes_from
        veto = "on" if self.episode.veto else "off"
        drawn = "" if self.sample_seed < 0 else f", actions drawn with seed {self.sample_seed}"
        return (
            f"Bundle {bundle} drives, run by {self.backend}{drawn}. "
            f"{'Pictures' if view == PICTURE else 'Detections'} from {view_topic}, "
            f"collision probability from {probability}, LiDAR veto {veto}, velocities to "
            f"{velocity_topic}. Goals: {', '.join(goals)}."
        )
