"""The table of topics: name, type and quality of service of each, by the role that it plays.

Nodes, recorder, player, bag evaluation and the mock follow it; types are names, so that it needs no
ROS. Names are those of a TurtleBot 4, relative so that a namespace moves them; the file of another
robot gives its own (``robot.load_robot``).
"""

from __future__ import annotations

from dataclasses import dataclass

STAMPED = "geometry_msgs/msg/TwistStamped"
UNSTAMPED = "geometry_msgs/msg/Twist"
RAW = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"

CLOUD = "sensor_msgs/msg/PointCloud2"

PACKED = "/compressed"
"""How the name of a topic of compressed pictures ends (image_transport)."""

DETECTIONS_2D = "vision_msgs/msg/Detection2DArray"
DETECTIONS_3D = "vision_msgs/msg/Detection3DArray"

SPATIAL = ("spatial_detections", "detections_3d")
"""How the name of a topic of detections with distances ends (depthai_ros_driver, others)."""

POINTS = "points"
"""How the name of a topic of a depth camera's points ends (depth_image_proc, realsense2_camera)."""


@dataclass(frozen=True)
class Topic:
    """A topic as it is offered.

    Attributes:
        name: relative, or from the root.
        type: of its messages.
        depth: messages that its publisher holds.
        latched: the last ones reach those who come later, too.
        reliable: delivered for sure.
        recorded: the recorder listens.
        other_type: that it may have instead; the graph tells which.
    """

    name: str
    type: str
    depth: int = 10
    latched: bool = False
    reliable: bool = True
    recorded: bool = True
    other_type: str = ""


def camera_info(image: str) -> str:
    """Where a driver that keeps to image_transport publishes the calibration of its pictures.

    That of a depth camera's points is there, too (depth_image_proc).
    """
    return "".join((*image.removesuffix(PACKED).rpartition("/")[:2], "camera_info"))


def picture_type(image: str) -> str:
    """The type of the pictures on a topic: its name tells, as image_transport names topics."""
    return COMPRESSED if image.endswith(PACKED) else RAW


def depth_type(depth: str) -> str:
    """The type of what a depth camera says on a topic: its name tells, as drivers name theirs."""
    return CLOUD if depth.endswith(POINTS) else RAW


def detections_type(detections: str) -> str:
    """The type of what a detector says on a topic: its name tells, as depthai's driver names it."""
    return DETECTIONS_3D if detections.endswith(SPATIAL) else DETECTIONS_2D


def unstamped(cmd_vel: str) -> str:
    """A second topic that moves a TurtleBot 4, by Twist."""
    return cmd_vel.removesuffix("_unstamped") + "_unstamped"


ROBOT_TOPICS: dict[str, Topic] = {
    "image": Topic("oakd/rgb/preview/image_raw", RAW),
    "camera_info": Topic("oakd/rgb/preview/camera_info", "sensor_msgs/msg/CameraInfo"),
    # of the camera's own detector, or of detector_node
    "detections": Topic("detections", DETECTIONS_2D, 5),
    # 4 MB/s and more, and nothing judges it again: not recorded
    "depth": Topic("oakd/stereo/image_raw", "sensor_msgs/msg/Image", recorded=False),
    "depth_info": Topic("oakd/stereo/camera_info", "sensor_msgs/msg/CameraInfo", recorded=False),
    "scan": Topic("scan", "sensor_msgs/msg/LaserScan"),
    "odom": Topic("odom", "nav_msgs/msg/Odometry", 1, latched=True),
    # the relay of a TurtleBot 4 listens so: a lost velocity is better than a late one
    "cmd_vel": Topic("cmd_vel", STAMPED, 1, reliable=False, other_type=UNSTAMPED),
    # told only when they change (firmware H.2.5 and later)
    "hazards": Topic(
        "hazard_detection", "irobot_create_msgs/msg/HazardDetectionVector", 1, latched=True
    ),
    "joint_states": Topic("joint_states", "sensor_msgs/msg/JointState"),
    "tf": Topic("tf", "tf2_msgs/msg/TFMessage", 100),
    "tf_static": Topic("tf_static", "tf2_msgs/msg/TFMessage", 100, latched=True),
    "wheel_status": Topic("wheel_status", "irobot_create_msgs/msg/WheelStatus", 1, latched=True),
    "dock_status": Topic("dock_status", "irobot_create_msgs/msg/DockStatus", 1, latched=True),
    "battery": Topic(
        "battery_state", "sensor_msgs/msg/BatteryState", 1, latched=True, recorded=False
    ),
    "imu": Topic("imu", "sensor_msgs/msg/Imu", 1, latched=True, recorded=False),
    "tilt_command": Topic("camera_tilt/command", "std_msgs/msg/Float64"),
}
"""What a robot says and obeys; its file may rename them, or say that it has none."""

OUR_TOPICS: dict[str, Topic] = {
    "estimate": Topic("collision/estimate", "cfnav_interfaces/msg/CollisionEstimate", 5),
    "decision": Topic("policy/decision", "cfnav_interfaces/msg/PolicyDecision", 50),
    "episode": Topic("policy/episode", "cfnav_interfaces/msg/EpisodeStatus", latched=True),
    "goal": Topic("policy/goal", "std_msgs/msg/String", recorded=False),
    "markers": Topic("policy/markers", "visualization_msgs/msg/MarkerArray", 5, recorded=False),
    "diagnostics": Topic("diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
    "rosout": Topic("/rosout", "rcl_interfaces/msg/Log", 1000),
    "truth": Topic("ground_truth/state", "cfnav_interfaces/msg/GroundTruth", 100),
    "map": Topic("ground_truth/map", "nav_msgs/msg/OccupancyGrid", 1, latched=True),
    "fault": Topic(
        "simulator/fault", "cfnav_interfaces/msg/FaultStatus", 100, latched=True, recorded=False
    ),
    "moment": Topic(
        "simulator/moment", "cfnav_interfaces/msg/Moment", 1, latched=True, recorded=False
    ),
    "moment_done": Topic(
        "simulator/moment_done", "cfnav_interfaces/msg/MomentDone", 1, latched=True, recorded=False
    ),
    "clock": Topic("/clock", "rosgraph_msgs/msg/Clock"),
}
"""What our nodes and the simulator say, on every robot."""

TOPICS: dict[str, Topic] = {**ROBOT_TOPICS, **OUR_TOPICS}
