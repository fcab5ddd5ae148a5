"""The LiDAR collision node and the policy node, for a TurtleBot 4 that is up.

    ros2 launch cfnav_bringup robot.launch.py params:=turtlebot4_stock.yaml goal:=Laptop

The policy node owns the velocity: it is never started again by itself, and when it ends, so does
everything. The LiDAR node is started again: without it the policy node stands.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_path
from cfnav_ros.processes import ENDS_WITH_PARENT
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch_ros.actions import Node

ARGUMENTS = (
    DeclareLaunchArgument(
        "params", description="parameter file: a path, or a name in this package's config folder"
    ),
    DeclareLaunchArgument("namespace", default_value="", description="of the robot, e.g. robot1"),
    DeclareLaunchArgument("bundle", default_value="", description="folder of a bundle"),
    DeclareLaunchArgument("goal", default_value="", description="sought from the start"),
    DeclareLaunchArgument(
        "use_sim_time", default_value="", description="true or false; as in params when empty"
    ),
    DeclareLaunchArgument(
        "drive", default_value="true", choices=["true", "false"], description="with the policy node"
    ),
    DeclareLaunchArgument(
        "mast_height", default_value="", description="m; publishes base_link -> mast_camera_link"
    ),
    DeclareLaunchArgument("bag", default_value="", description="record into this folder"),
    DeclareLaunchArgument("rviz", default_value="false", choices=["true", "false"]),
)

# tf2's own nodes and RViz use absolute names, which a namespace would not move.
TF = [("/tf", "tf"), ("/tf_static", "tf_static")]
SHOWN = ("scan", "odom", "oakd/rgb/preview/image_raw", "policy/markers")


def parameter_file(given: str) -> str:
    """Return a parameter file by its path or by its name in the package."""
    folder = get_package_share_path("cfnav_bringup") / "config"
    for path in (Path(given), folder / given):
        if path.is_file():
            return str(path.resolve())
    shipped = ", ".join(sorted(path.name for path in folder.glob("*.yaml")))
    raise RuntimeError(f"params is {given!r}, expected a file or one of {shipped}.")


def nodes(context: LaunchContext) -> list[Node]:
    """Make the nodes for the arguments given."""
    given = context.launch_configurations
    common = {
        "namespace": given["namespace"],
        "output": "screen",
        "remappings": TF,
        "prefix": ENDS_WITH_PARENT,
    }
    parameters: list = [parameter_file(given["params"])]
    if given["use_sim_time"]:
        parameters.append({"use_sim_time": given["use_sim_time"] == "true"})
    made = [
        Node(
            package="cfnav_ros",
            executable="lidar_collision_node",
            exec_name="lidar_collision_node",
            parameters=parameters,
            respawn=True,
            respawn_delay=2.0,
            **common,
        )
    ]
    if given["drive"] == "true":
        chosen: dict[str, str | bool] = {n: given[n] for n in ("bundle", "goal") if given[n]}
        if given["bag"]:
            chosen["wait_for_recorder"] = True
        made.append(
            Node(
                package="cfnav_ros",
                executable="policy_node",
                exec_name="policy_node",
                parameters=[*parameters, *([chosen] if chosen else [])],
                on_exit=Shutdown(),
                **common,
            )
        )
    if given["bag"]:
        made.insert(
            0,
            Node(
                package="cfnav_ros",
                executable="recorder_node",
                exec_name="recorder_node",
                parameters=[*parameters, {"bag": str(Path(given["bag"]).resolve())}],
                on_exit=Shutdown(),
                **common,
            ),
        )
    return made + viewers(given, common)


def viewers(given: dict[str, str], common: dict) -> list[Node]:
    """Make the optional nodes: the mast's transform, RViz and what draws for it."""
    made = []
    if given["mast_height"]:
        frames = ["--frame-id", "base_link", "--child-frame-id", "mast_camera_link"]
        made.append(
            Node(
                package="tf2_ros",
                executable="static_transform_publisher",
                exec_name="static_transform_publisher",
                name="mast_transform_publisher",
                arguments=["--z", given["mast_height"], *frames],
                **common,
            )
        )
    if given["rviz"] == "true":
        layout = get_package_share_path("cfnav_bringup") / "rviz" / "cfnav.rviz"
        shown = [*TF, *((f"/{topic}", topic) for topic in SHOWN)]
        rviz = {**common, "remappings": shown}
        made += [
            Node(
                package="cfnav_ros",
                executable="markers_node",
                exec_name="markers_node",
                parameters=[parameter_file(given["params"])],
                **common,
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                exec_name="rviz2",
                arguments=["-d", str(layout)],
                **rviz,
            ),
        ]
    return made


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=nodes)])
