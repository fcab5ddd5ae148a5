"""The mock TurtleBot 4 and the nodes beside it, on this machine only.

ros2 launch cfnav_bringup simulation.launch.py room:=kitchen:25 goal:=Fridge
"""

from pathlib import Path

from cfnav_ros.process.nodes import parts
from cfnav_ros.process.parameter_file import parameter_file
from cfnav_ros.process.processes import ENDS_WITH_PARENT, keep_local
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch_ros.actions import Node

from cfnav_core.robot.robot import DEFAULT

ARGUMENTS = (
    DeclareLaunchArgument("room", default_value="", description="e.g. kitchen:25; see params"),
    DeclareLaunchArgument("seed", default_value="", description="draws the start pose"),
    DeclareLaunchArgument("speed", default_value="", description="times real time; 0: all it can"),
    DeclareLaunchArgument("faults", default_value="", description="schedule of faults, a file"),
    DeclareLaunchArgument("robot", default_value=DEFAULT, description="played by the mock"),
    DeclareLaunchArgument("params", default_value="simulation.yaml"),
    DeclareLaunchArgument("namespace", default_value=""),
    DeclareLaunchArgument("bundle", default_value=""),
    DeclareLaunchArgument("goal", default_value=""),
    DeclareLaunchArgument("rviz", default_value="false", choices=["true", "false"]),
)

PASSED_ON = ("robot", "params", "namespace", "bundle", "goal", "rviz")
TYPES = {"robot": str, "room": str, "seed": int, "speed": float, "faults": str}


def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Make the mock and what drives it for the arguments given."""
    keep_local(context.environment)  # so that no robot on the network can be moved
    given = context.launch_configurations
    params = parameter_file(given["params"])
    told = {name: kind(given[name]) for name, kind in TYPES.items() if given[name]}
    (part,) = parts(["mock_turtlebot4"], told)
    mock = Node(
        package=part.package,
        executable=part.executable,
        exec_name=part.executable,
        namespace=given["namespace"],
        parameters=[str(params), dict(part.parameters)],
        output="screen",
        prefix=ENDS_WITH_PARENT,
        on_exit=Shutdown(),
    )
    robot = IncludeLaunchDescription(
        str(Path(__file__).with_name("robot.launch.py")),
        launch_arguments=[*((n, given[n]) for n in PASSED_ON), ("use_sim_time", "true")],
    )
    return [mock, robot]


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=nodes)])
