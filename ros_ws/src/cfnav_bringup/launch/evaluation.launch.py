"""A drive on a robot with everything recorded, or a recorded drive played back without a robot.

    ros2 launch cfnav_bringup evaluation.launch.py params:=my.yaml mode:=record bag:=drive1
    ros2 launch cfnav_bringup evaluation.launch.py params:=my.yaml mode:=replay bag:=drive1

A replay plays only what sensors said, on this machine only and in a ROS domain of its own: no
velocity leaves the bag, and no node of a robot hears the past. The LiDAR node judges the recorded
scans anew, with the parameters given.
"""

from collections.abc import MutableMapping
from pathlib import Path

from cfnav_ros.processes import ENDS_WITH_PARENT, keep_local
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)

ARGUMENTS = (
    DeclareLaunchArgument("mode", choices=["record", "replay"]),
    DeclareLaunchArgument("bag", description="folder of the bag: made anew, or played"),
    DeclareLaunchArgument("params", description="as for robot.launch.py"),
    DeclareLaunchArgument("namespace", default_value=""),
    DeclareLaunchArgument("bundle", default_value=""),
    DeclareLaunchArgument("goal", default_value=""),
    DeclareLaunchArgument("rate", default_value="1.0", description="of the replay"),
    DeclareLaunchArgument("domain", default_value="99", description="ROS domain of the replay"),
    DeclareLaunchArgument("rviz", default_value="false", choices=["true", "false"]),
)

ROBOT = str(Path(__file__).with_name("robot.launch.py"))

REPLAYED = (
    "scan",
    "oakd/rgb/preview/image_raw",
    "oakd/rgb/preview/camera_info",
    "odom",
    "tf",
    "tf_static",
    "joint_states",
    "hazard_detection",
    "wheel_status",
    "dock_status",
)
"""What the robot said; what it was told, and what was concluded, is left in the bag."""

LAST_DOMAIN = 101
"""Domains beyond it may take ports that Linux gives to others."""

NEVER = ("cmd_vel", "cmd_vel_unstamped", "camera_tilt/command")
"""Commands: named under replay/ should ever one of them be played."""


def record(given: dict[str, str]) -> list[LaunchDescriptionEntity]:
    """Drive, and record it."""
    passed = ("params", "namespace", "bundle", "goal", "bag", "rviz")
    return [IncludeLaunchDescription(ROBOT, launch_arguments=[(n, given[n]) for n in passed])]


def stay_apart(environment: MutableMapping[str, str], domain: str) -> None:
    """Keep a replay away from every robot: on this machine, in a domain of its own.

    Raises:
        RuntimeError: the domain is none, or that of the shell, where a robot may be.
    """
    live = int(environment.get("ROS_DOMAIN_ID") or 0)
    if not domain.isdecimal() or int(domain) > LAST_DOMAIN or int(domain) == live:
        raise RuntimeError(
            f"domain is {domain!r}, expected 0 to {LAST_DOMAIN} but not {live}, the domain of this "
            "shell: nodes of a robot there would take the recording for its sensors."
        )
    environment["ROS_DOMAIN_ID"] = domain
    keep_local(environment)


def replay(given: dict[str, str]) -> list[LaunchDescriptionEntity]:
    """Play what the sensors said to the LiDAR node."""
    space = f"/{given['namespace'].strip('/')}/" if given["namespace"] else "/"
    play = ["ros2", "bag", "play", given["bag"], "--clock", "100", "--rate", given["rate"]]
    play += ["--topics", *(space + name for name in REPLAYED)]
    play += ["--remap", *(f"{space}{name}:={space}replay/{name}" for name in NEVER)]
    arguments = {name: given[name] for name in ("params", "namespace", "rviz")}
    arguments |= {"drive": "false", "bag": "", "use_sim_time": "true"}
    return [
        ExecuteProcess(
            cmd=play,
            name="player",
            output="screen",
            prefix=ENDS_WITH_PARENT,
            on_exit=Shutdown(),
        ),
        IncludeLaunchDescription(ROBOT, launch_arguments=arguments.items()),
    ]


def actions(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Choose by mode."""
    given = context.launch_configurations
    if given["mode"] == "record":
        return record(given)
    stay_apart(context.environment, given["domain"])
    return replay(given)


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=actions)])
