"""A drive on a robot with everything recorded, or a recorded drive played back without a robot.

    ros2 launch cfnav_bringup evaluation.launch.py robot:=my.yaml mode:=record bag:=drive1
    ros2 launch cfnav_bringup evaluation.launch.py robot:=my.yaml mode:=replay bag:=drive1

A replay plays only what sensors said, on this machine only and in a ROS domain of its own: no
velocity leaves the bag, and no node of a robot hears the past. The LiDAR node judges the recorded
scans anew, with the robot and parameters given; the play begins when it listens.
"""

from pathlib import Path

from cfnav_ros.process.domains import stay_apart
from cfnav_ros.process.processes import ENDS_WITH_PARENT, node_command
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
    DeclareLaunchArgument("robot", description="as for robot.launch.py"),
    DeclareLaunchArgument("params", default_value="robot.yaml"),
    DeclareLaunchArgument("namespace", default_value=""),
    DeclareLaunchArgument("bundle", default_value=""),
    DeclareLaunchArgument("goal", default_value=""),
    DeclareLaunchArgument("rate", default_value="1.0", description="of the replay"),
    DeclareLaunchArgument("domain", default_value="99", description="ROS domain of the replay"),
    DeclareLaunchArgument("rviz", default_value="false", choices=["true", "false"]),
)

ROBOT = str(Path(__file__).with_name("robot.launch.py"))


def record(given: dict[str, str]) -> list[LaunchDescriptionEntity]:
    """Drive, and record it."""
    passed = ("robot", "params", "namespace", "bundle", "goal", "bag", "rviz")
    return [IncludeLaunchDescription(ROBOT, launch_arguments=[(n, given[n]) for n in passed])]


def replay(given: dict[str, str], live: str) -> list[LaunchDescriptionEntity]:
    """Play what the sensors said to the LiDAR node; ``live`` is the domain of the shell."""
    play = [*node_command("cfnav_ros", "bag_play"), given["bag"], "--wait-for", "scan"]
    play += ["--rate", given["rate"], "--domain", given["domain"], "--robot", given["robot"]]
    play += ["--namespace", given["namespace"]] if given["namespace"] else []
    arguments = {name: given[name] for name in ("robot", "params", "namespace", "rviz")}
    arguments |= {"drive": "false", "bag": "", "use_sim_time": "true"}
    return [
        ExecuteProcess(
            cmd=play,
            name="bag_play",
            additional_env={"ROS_DOMAIN_ID": live},  # it keeps away from there by itself
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
    live = context.environment.get("ROS_DOMAIN_ID") or "0"
    stay_apart(context.environment, given["domain"])
    return replay(given, live)


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=actions)])
