"""A robot as its file tells it: body, limits, LiDAR, topics.

One commented YAML file a robot; those that are shipped lie in ``robots``. The parameters of the
nodes, what is recorded, which topic of a bag plays which role and what the mock publishes follow
from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from cfnav_core.robot.settings import flat, leaves, setting, settled
from cfnav_core.robot.topics import (
    ROBOT_TOPICS,
    STAMPED,
    TOPICS,
    UNSTAMPED,
    Topic,
    camera_info,
    depth_type,
    detections_type,
    picture_type,
)

DEFAULT = "turtlebot4_mast"
"""The paper's robot, and what the mock is unless told otherwise."""

SHIPPED = Path(__file__).with_name("robots")

NEEDED = ("image", "scan", "odom", "cmd_vel")
"""Roles without which nothing can be driven."""

CMD_VEL_TYPES = ("auto", "stamped", "unstamped")
MOUNTS = ("auto", "tf", "parameters")


class UnknownRobotError(ValueError):
    """No robot that is shipped has this name, and no file; the text is one sentence."""


@dataclass(frozen=True)
class Limits:
    """How fast the robot is driven; no more than its base can."""

    v_max: float = setting(0.2, "m/s")
    a_lin: float = setting(0.5, "m/s^2")
    w_max: float = setting(1.0, "rad/s")
    a_ang: float = setting(2.0, "rad/s^2")


@dataclass(frozen=True)
class Lidar:
    """Where the LiDAR sits in ``base_frame`` and where it sees the robot itself."""

    frame: str = setting("rplidar_link", "that scans come from; empty: any")
    mount: str = setting("auto", "tf; parameters, as said here; or auto, where both must agree")
    x: float = setting(-0.04, "forward, m")
    y: float = setting(0.0, "to the left, m")
    yaw_deg: float = setting(90.0, "deg")
    bearing_bias_deg: float = setting(0.6, "its driver announces bearings so far left, deg")
    mask_bearings_deg: str = setting("180", "of its own parts, deg from the front, left positive")
    mask_half_width_deg: float = setting(4.0, "half of what each of them hides, deg")


@dataclass(frozen=True)
class Robot:
    """What a robot is; every setting must stand in its file.

    Attributes:
        name: of the file.
        topics: by role, those of our own nodes too; what the robot lacks is not there.
        said: text of the file.
    """

    name: str = DEFAULT
    topics: Mapping[str, Topic] = field(default_factory=lambda: TOPICS)
    said: str = field(default="", repr=False, compare=False)
    bundle: str = setting(
        "default", "that drives unless told: the name of a shipped one, or a folder"
    )
    camera: str = setting(
        "mast", "that it has in simulation: mast, stock_wide, stock_preview, lite or a JSON file"
    )
    base_frame: str = setting("base_link", "frame of velocities and estimates")
    radius: float = setting(0.175, "hull, m", 0.01, 1.0)
    height: float = setting(0.351, "top of the hull over base_frame, m", 0.01, 3.0)
    mast_height: float = setting(1.3, "of the camera's mast over base_frame, m; 0: none", 0.0, 3.0)
    mast_radius: float = setting(0.03, "of the mast at the middle of the hull, m", 0.0, 1.0)
    tilt_joint: str = setting("camera_tilt", "in joint_states; empty: the camera is fixed")
    cmd_vel_type: str = setting("auto", "stamped, unstamped, or auto: what the base listens to")
    limits: Limits = field(default_factory=Limits)
    lidar: Lidar = field(default_factory=Lidar)

    def __post_init__(self) -> None:
        for name, value, known in (
            ("cmd_vel_type", self.cmd_vel_type, CMD_VEL_TYPES),
            ("lidar.mount", self.lidar.mount, MOUNTS),
        ):
            if value not in known:
                raise ValueError(f"{name} is {value!r}, expected {', '.join(known)}.")

    @property
    def tilts(self) -> bool:
        """Whether the camera tilts on command."""
        return bool(self.tilt_joint)


def robot_setting() -> Any:
    """The setting of a node that names its robot."""
    return setting(DEFAULT, "the robot: the name of one that is shipped, or its file")


def robots() -> list[str]:
    """Names of the robots that are shipped."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def simulated(tilts: bool) -> str:
    """The robot that the mock is under a camera that tilts or not, the Lite's too."""
    return DEFAULT if tilts else "turtlebot4"


def load_robot(given: str | Path = DEFAULT) -> Robot:
    """Read a robot.

    Args:
        given: the name of one that is shipped, or a file.

    Raises:
        UnknownRobotError: there is none.
        ValueError: its file is of no use; one sentence.
    """
    path = SHIPPED / f"{given}.yaml" if given in robots() else Path(given)
    try:
        text = path.read_text()
    except FileNotFoundError:
        known = ", ".join(robots())
        raise UnknownRobotError(
            f"robot is {str(given)!r}, expected a file or one of {known}."
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    try:
        return parse_robot(path.stem, text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_robot(name: str, text: str) -> Robot:
    """Read a robot of a name from the text of its file.

    Raises:
        ValueError: it is of no use; one sentence.
    """
    try:
        said = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"it cannot be read: {' '.join(str(error).split())}") from None
    if not isinstance(said, dict):
        raise ValueError("it describes no robot, expected names and values.")
    renamed = said.pop("topics", None) or {}
    body = dict(flat(said))
    unsaid = {name for name, _ in leaves(Robot())} - body.keys()
    if body.get("lidar.mount") == "tf":
        unsaid -= {"lidar.x", "lidar.y", "lidar.yaw_deg"}
        body = {"lidar.x": 0.0, "lidar.y": 0.0, "lidar.yaw_deg": 0.0} | body
    robot = settled(Robot(name), body)
    if unsaid:
        raise ValueError(f"it does not say {', '.join(sorted(unsaid))}: add that.")
    topics = _topics(renamed, robot.tilts)
    if robot.cmd_vel_type != "auto":
        kind = STAMPED if robot.cmd_vel_type == "stamped" else UNSTAMPED
        topics["cmd_vel"] = replace(topics["cmd_vel"], type=kind, other_type="")
    return replace(robot, topics=topics, said=text)


def _topics(renamed: Any, tilts: bool) -> dict[str, Topic]:
    """The table of topics with a robot's own names, without those that it lacks."""
    if not isinstance(renamed, dict):
        raise ValueError(f"topics is {renamed!r}, expected a name or null for each role.")
    for role, name in renamed.items():
        if role not in ROBOT_TOPICS:
            raise ValueError(f"topics has {role!r}, expected roles: {', '.join(ROBOT_TOPICS)}.")
        if not (name is None or (isinstance(name, str) and name)):
            raise ValueError(f"topics.{role} is {name!r}, expected a name, or null for none.")
    for picture, calibration in (("image", "camera_info"), ("depth", "depth_info")):
        if picture in renamed:
            beside = renamed[picture] and camera_info(renamed[picture])
            renamed = {calibration: beside, **renamed}
    lacking = {role for role, name in renamed.items() if name is None}
    if missing := lacking & {*NEEDED, *["tilt_command", "joint_states"] * tilts}:
        raise ValueError(f"topics.{min(missing)} is null, but nothing can be driven without it.")
    lacking |= set() if tilts else {"tilt_command"}
    named = {role: replace(TOPICS[role], name=name) for role, name in renamed.items() if name}
    types = {"image": picture_type, "depth": depth_type, "detections": detections_type}
    for role, type_of in types.items():
        if role in named:
            named[role] = replace(named[role], type=type_of(named[role].name))
    return {role: topic for role, topic in (TOPICS | named).items() if role not in lacking}
