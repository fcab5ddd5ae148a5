"""The mock TurtleBot 4 and the two nodes beside it, on this machine only.

ros2 launch cfnav_bringup simulation.launch.py room:=kitchen:25 goal:=Fridge
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_path
from cfnav_ros.processes import ENDS_WITH_PARENT, keep_local
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch_ros.actions import Node

ARGUMENTS = (
    DeclareLaunchArgument("room", default_value="", description="e.g. kitchen:25; see params"),
    DeclareLaunchArgument("seed", default_value="", description="draws the start pose"),
    DeclareLaunchArgument("speed", default_value="", description="times real time; 0: all it can"),
    DeclareLaunchArgument("faults", default_value="", description="schedule of faults, a file"),
    DeclareLaunchArgument("params", default_value="simulation.yaml"),
    DeclareLaunchArgument("namespace", default_value=""),
    DeclareLaunchArgument("bundle", default_value=""),
    DeclareLaunchArgument("goal", default_value=""),
    DeclareLaunchArgument("rviz", default_value="false", choices=["true", "false"]),
)

PASSED_ON = ("params", "namespace", "bundle", "goal", "rviz")
TYPES = {"room": str, "seed": int, "speed": float, "faults": str}


def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Make the mock and what drives it for the arguments given."""
    keep_local(context.environment)  # so that no robot on the network can be moved
    given = context.launch_configurations
    folder = get_package_share_path("cfnav_bringup")
    params = folder / "config" / given["params"]  # an absolute path stays itself
    chosen = {name: kind(given[name]) for name, kind in TYPES.items() if given[name]}
    mock = Node(
        package="sim_bridge",
        executable="mock_turtlebot4",
        exec_name="mock_turtlebot4",
        namespace=given["namespace"],
        parameters=[str(params), *([chosen] if chosen else [])],
        output="screen",
        prefix=ENDS_WITH_PARENT,
        on_exit=Shutdown(),
    )
    robot = IncludeLaunchDescription(
        str(Path(__file__).with_name("robot.launch.py")),
        launch_arguments=[(name, given[name]) for name in PASSED_ON],
    )
    return [mock, robot]


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=nodes)])
