"""The LiDAR collision node and the policy node, for a robot that is up.

    ros2 launch cfnav_bringup robot.launch.py robot:=turtlebot4 goal:=Chair

Which nodes there are, and what each is told, says ``cfnav_ros.process.nodes``. The policy node owns
the velocity: it is never started again by itself, and when it ends, so does everything. The LiDAR
node is started again: without it the policy node stands.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_path
from cfnav_ros.process.nodes import NODES, NodeStart, parts
from cfnav_ros.process.parameter_file import parameter_file
from cfnav_ros.process.processes import ENDS_WITH_PARENT
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch_ros.actions import Node

from cfnav_core.robot.robot import Robot, load_robot
from cfnav_core.robot.topics import TOPICS

ARGUMENTS = (
    DeclareLaunchArgument("robot", description="name of a robot that is shipped, or its file"),
    DeclareLaunchArgument(
        "params",
        default_value="robot.yaml",
        description="parameter file: a path, or a name in this package's config folder",
    ),
    DeclareLaunchArgument("namespace", default_value="", description="of the robot, e.g. robot1"),
    DeclareLaunchArgument("bundle", default_value="", description="folder of a bundle"),
    DeclareLaunchArgument("goal", default_value="", description="sought from the start"),
    DeclareLaunchArgument(
        "detector", default_value="", description="ONNX file of one, for a bundle that reads one"
    ),
    DeclareLaunchArgument("labels", default_value="", description="what it learnt, e.g. coco"),
    DeclareLaunchArgument(
        "use_sim_time", default_value="", description="true or false; as in params when empty"
    ),
    DeclareLaunchArgument(
        "drive", default_value="true", choices=["true", "false"], description="with the policy node"
    ),
    DeclareLaunchArgument("bag", default_value="", description="record into this folder"),
    DeclareLaunchArgument("rviz", default_value="false", choices=["true", "false"]),
)

# tf2's own nodes and RViz use absolute names, which a namespace would not move.
TF = [("/tf", "tf"), ("/tf_static", "tf_static")]
SHOWN = ("scan", "odom", "image", "markers")
"""Roles of the topics that the layout of RViz shows."""


def node(part: NodeStart, file: str, common: dict) -> Node:
    """Make a node of the table, which says what its end means."""
    ending = NODES[part.executable].ending
    return Node(
        package=part.package,
        executable=part.executable,
        exec_name=part.executable,
        parameters=[file, dict(part.parameters)],
        **({"respawn": True, "respawn_delay": 2.0} if ending == "it comes back" else {}),
        **({"on_exit": Shutdown()} if ending == "all end" else {}),
        **common,
    )


def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Make the nodes for the arguments given, and say which parameter file they read."""
    given = context.launch_configurations
    common = {
        "namespace": given["namespace"],
        "output": "screen",
        "remappings": TF,
        "prefix": ENDS_WITH_PARENT,
    }
    file = str(parameter_file(given["params"]))
    chosen = {
        "lidar_collision_node": True,
        "policy_node": given["drive"] == "true",
        "detector_node": bool(given["detector"]),
        "recorder_node": bool(given["bag"]),
        "markers_node": given["rviz"] == "true",
    }
    told: dict[str, object] = {n: given[n] or None for n in ("robot", "bundle", "goal")}
    if given["use_sim_time"]:
        told["use_sim_time"] = given["use_sim_time"] == "true"
    if given["detector"]:
        labels = given["labels"] or None
        model = Path(given["detector"]).resolve()
        told |= {"model": model, "labels": labels, "detections.labels": labels}
    if given["bag"]:
        told |= {"bag": Path(given["bag"]).resolve(), "wait_for_recorder": True}
    started = parts([name for name, there in chosen.items() if there], told)
    robot = load_robot(given["robot"])
    made = [*(node(part, file, common) for part in started), *viewers(given, robot, common)]
    return [LogInfo(msg=f"parameters of {file}"), *made]


def viewers(given: dict[str, str], robot: Robot, common: dict) -> list[Node]:
    """Make the nodes that are not ours: the mast's transform where it is real, and RViz."""
    made = []
    if robot.mast_height and given["use_sim_time"] != "true":
        frames = ["--frame-id", robot.base_frame, "--child-frame-id", "mast_camera_link"]
        made.append(
            Node(
                package="tf2_ros",
                executable="static_transform_publisher",
                exec_name="static_transform_publisher",
                name="mast_transform_publisher",
                arguments=["--z", str(robot.mast_height), *frames],
                **common,
            )
        )
    if given["rviz"] == "true":
        layout = get_package_share_path("cfnav_bringup") / "rviz" / "cfnav.rviz"
        topics = robot.topics
        shown = [(f"/{TOPICS[role].name}", topics[role].name) for role in SHOWN if role in topics]
        made.append(
            Node(
                package="rviz2",
                executable="rviz2",
                exec_name="rviz2",
                arguments=["-d", str(layout)],
                **{**common, "remappings": [*TF, *shown]},
            )
        )
    return made


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=nodes)])
