"""Numpy and plain numbers to ROS messages, shaped as a TurtleBot 4's drivers shape them.

Frames and mounting poses: docs/interfaces.md, "Frames and geometry".
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable
from typing import TYPE_CHECKING

import cv2
import numpy as np
from builtin_interfaces.msg import Time
from cfnav_interfaces.msg import CollisionEstimate, GroundTruth
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from irobot_create_msgs.msg import (
    DockStatus,
    HazardDetection,
    HazardDetectionVector,
    WheelStatus,
)
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import (
    BatteryState,
    CameraInfo,
    CompressedImage,
    Image,
    Imu,
    JointState,
    LaserScan,
    PointCloud2,
    PointField,
)
from std_msgs.msg import Header

from cfnav_core.task.actions import STEP_M
from sim_bridge.robot import rplidar
from sim_bridge.robot.packing import pack

if TYPE_CHECKING:
    from cfnav_core.task.camera import CameraSetUp
    from sim_bridge.robot.base import SimulatedOdometry
    from sim_bridge.robot.simulator import Simulator

CAMERA_FRAME = "oakd_rgb_camera_optical_frame"
DEPTH_FRAME = "depth_camera_optical_frame"
"""Of a stereo camera that is fixed; one that tilts with the other has that one's."""

SHELL_Z = 0.0942
"""m; height of ``shell_link`` over ``base_link``."""

_BUMPER_ZONES = (
    ("bump_right", -90.0, -54.0),
    ("bump_front_right", -54.0, -18.0),
    ("bump_front_center", -18.0, 18.0),
    ("bump_front_left", 18.0, 54.0),
    ("bump_left", 54.0, 90.0),
)
"""Zones of the bumper, degrees from the front; the rear half has none."""


def stamp(t: float) -> Time:
    """Simulated time in seconds as a stamp."""
    seconds, nanoseconds = divmod(round(t * 1e9), 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)


def header(t: float, frame: str) -> Header:
    """A header: simulated time in seconds, frame name."""
    return Header(stamp=stamp(t), frame_id=frame)


def quaternion(yaw: float = 0.0, pitch: float = 0.0) -> Quaternion:
    """A rotation about z by ``yaw`` or about y by ``pitch``, rad; never both."""
    return Quaternion(
        y=math.sin(pitch / 2), z=math.sin(yaw / 2), w=math.cos(yaw / 2) * math.cos(pitch / 2)
    )


def image(rgb: np.ndarray, t: float) -> Image:
    """A picture as the OAK-D's driver sends it.

    Args:
        rgb: uint8 [H, W, 3].
        t: simulated s.

    Returns:
        ``bgr8`` with ``is_bigendian`` set, as depthai_bridge does for 8-bit pictures.
    """
    height, width, _ = rgb.shape
    message = Image(header=header(t, CAMERA_FRAME), height=height, width=width)
    message.encoding = "bgr8"
    message.is_bigendian = 1
    message.step = 3 * width
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    # array.array is the one type the message takes over without looking at every byte.
    message.data = array("B")
    message.data.frombytes(bgr.data)
    return message


def compressed_image(rgb: np.ndarray, t: float) -> CompressedImage:
    """A picture as image_transport compresses that of ``image``; arguments as there."""
    message = CompressedImage(header=header(t, CAMERA_FRAME))
    message.format, data = pack(cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), "bgr8")
    message.data = array("B", data)
    return message


def depth(millimetres: np.ndarray, t: float, frame: str) -> Image:
    """A depth picture as the OAK-D's driver sends it.

    Args:
        millimetres: uint16 [H, W], 0 where nothing was measured.
        t: simulated s.
        frame: optical, of the stereo camera.
    """
    height, width = millimetres.shape
    message = Image(header=header(t, frame), height=height, width=width)
    message.encoding, message.step = "16UC1", 2 * width
    message.data = array("B")
    message.data.frombytes(millimetres.astype("<u2", copy=False).tobytes())
    return message


def depth_cloud(millimetres: np.ndarray, set_up: CameraSetUp, t: float, frame: str) -> PointCloud2:
    """The points of a depth picture, ordered as its pixels, as depth_image_proc makes them.

    Args:
        millimetres: uint16 [H, W], 0 where nothing was measured.
        set_up: of the stereo camera.
        t: simulated s.
        frame: optical, of the stereo camera.
    """
    (fx, cx), (fy, cy) = _lens(set_up)
    height, width = millimetres.shape
    depth = np.where(millimetres > 0, millimetres * np.float32(1e-3), np.float32(np.nan))
    points = np.zeros((height, width, 4), "<f4")
    points[..., 0] = (np.arange(width) - cx) / fx * depth
    points[..., 1] = ((np.arange(height) - cy) / fy)[:, None] * depth
    points[..., 2] = depth
    message = PointCloud2(header=header(t, frame), height=height, width=width)
    message.fields = [
        PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
        for k, name in enumerate("xyz")
    ]
    message.point_step, message.row_step = 16, 16 * width
    message.data = array("B")
    message.data.frombytes(points.tobytes())
    return message


def _lens(set_up: CameraSetUp) -> list[tuple[float, float]]:
    """Focal length and principal point across and down, pixels."""
    return [
        (size * share, (size - 1) / 2)
        for size, share in zip(set_up.size, set_up.focal_share, strict=True)
    ]


def camera_info(set_up: CameraSetUp, t: float, frame: str = CAMERA_FRAME) -> CameraInfo:
    """Intrinsics of a picture without distortion."""
    (fx, cx), (fy, cy) = _lens(set_up)
    width, height = set_up.size
    message = CameraInfo(header=header(t, frame), height=height, width=width)
    message.distortion_model = "plumb_bob"
    message.d = [0.0] * 5
    message.k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


def laser_scan(ranges: np.ndarray, t: float, frame: str) -> LaserScan:
    """A turn of the LiDAR.

    Args:
        ranges: float32 [N], metres; see ``rplidar.driver_ranges``.
        t: s, when the turn began.
        frame: of the LiDAR.
    """
    message = LaserScan(header=header(t, frame))
    message.angle_min, message.angle_max = rplidar.ANGLE_MIN, rplidar.ANGLE_MAX
    message.angle_increment = (rplidar.ANGLE_MAX - rplidar.ANGLE_MIN) / (len(ranges) - 1)
    message.scan_time = rplidar.SCAN_PERIOD
    message.time_increment = rplidar.SCAN_PERIOD / (len(ranges) - 1)
    message.range_min, message.range_max = rplidar.RANGE_MIN, rplidar.RANGE_MAX
    message.ranges = array("f", ranges.tobytes())
    # The A1 reports quality 15 for a good return and 0 for none.
    message.intensities = array("f", np.where(np.isfinite(ranges), 15, 0).astype("f").tobytes())
    return message


def odometry(counted: SimulatedOdometry, velocity: tuple[float, float], t: float) -> Odometry:
    """Pose in ``odom``; velocity in ``base_link``: m/s forward, rad/s."""
    message = Odometry(header=header(t, "odom"), child_frame_id="base_link")
    message.pose.pose.position.x, message.pose.pose.position.y = counted.x, counted.y
    message.pose.pose.orientation = quaternion(yaw=counted.yaw)
    message.twist.twist.linear.x, message.twist.twist.angular.z = velocity
    return message


def transform(
    t: float,
    parent: str,
    child: str,
    at: tuple[float, float, float],
    rotation: Quaternion | None = None,
) -> TransformStamped:
    """A transform: position in metres, no rotation unless given."""
    message = TransformStamped(header=header(t, parent), child_frame_id=child)
    message.transform.translation = Vector3(x=at[0], y=at[1], z=at[2])
    if rotation is not None:
        message.transform.rotation = rotation
    return message


def static_transforms(set_up: CameraSetUp, t: float, lidar: str) -> list[TransformStamped]:
    """Where the sensors sit, the LiDAR by its frame; a camera that does not tilt is one of them."""
    optical = Quaternion(x=-0.5, y=0.5, z=-0.5, w=0.5)
    transforms = [
        transform(t, "base_link", "shell_link", (0.0, 0.0, SHELL_Z)),
        transform(t, "shell_link", lidar, (-0.04, 0.0, 0.193 - SHELL_Z), quaternion(math.pi / 2)),
        transform(t, "oakd_link", "oakd_rgb_camera_frame", (0.0, 0.0, 0.0)),
        transform(t, "oakd_rgb_camera_frame", CAMERA_FRAME, (0.0, 0.0, 0.0), optical),
    ]
    if not set_up.tilts:
        mount = (set_up.x, 0.0, set_up.z - SHELL_Z)
        pitch = quaternion(pitch=-set_up.horizons[0])
        transforms.append(transform(t, "shell_link", "oakd_link", mount, pitch))
    return transforms


def depth_transforms(set_up: CameraSetUp, t: float) -> list[TransformStamped]:
    """Where a stereo camera sits that is fixed."""
    optical, mount = Quaternion(x=-0.5, y=0.5, z=-0.5, w=0.5), (set_up.x, 0.0, set_up.z)
    pitch = quaternion(pitch=-set_up.horizons[0])
    return [
        transform(t, "base_link", "depth_camera_frame", mount, pitch),
        transform(t, "depth_camera_frame", DEPTH_FRAME, (0.0, 0.0, 0.0), optical),
    ]


def moving_transforms(
    counted: SimulatedOdometry, set_up: CameraSetUp, tilt: float, t: float
) -> list[TransformStamped]:
    """Where the base is in ``odom``, and the camera on its tilt joint if it has one."""
    at, rotation = (counted.x, counted.y, 0.0), quaternion(yaw=counted.yaw)
    transforms = [
        transform(t, "odom", "base_footprint", at, rotation),
        transform(t, "odom", "base_link", at, rotation),
    ]
    if set_up.tilts:
        mount = (set_up.x, 0.0, set_up.z)
        transforms.append(transform(t, "base_link", "oakd_link", mount, quaternion(pitch=-tilt)))
    return transforms


def joint_state(joint: str, tilt: float, t: float) -> JointState:
    """The camera's tilt joint, rad up positive; without one the wheels, which nobody measures."""
    message = JointState(header=header(t, "base_link"))
    if joint:
        message.name, message.position = [joint], [tilt]
    else:
        message.name, message.position = ["left_wheel_joint", "right_wheel_joint"], [0.0, 0.0]
    return message


def hazards(pressed: Iterable[float], backup_low: bool, t: float) -> HazardDetectionVector:
    """What the base has detected; empty when nothing.

    Args:
        pressed: bearings of what presses the bumper, rad counter-clockwise from the front.
        backup_low: whether little is left of the way that commands may drive backward.
        t: s.

    Returns:
        A BUMP for each zone of the bumper that is pressed, then a BACKUP_LIMIT if there is one.
    """
    message = HazardDetectionVector(header=header(t, "base_link"))
    bearings = [math.degrees(bearing) for bearing in pressed]
    message.detections = [
        HazardDetection(header=header(t, zone), type=HazardDetection.BUMP)
        for zone, right, left in _BUMPER_ZONES
        if any(right <= bearing < left for bearing in bearings)
    ]
    if backup_low:
        limit = HazardDetection(header=header(t, "base_link"), type=HazardDetection.BACKUP_LIMIT)
        message.detections.append(limit)
    return message


def wheel_status(enabled: bool, t: float) -> WheelStatus:
    """Whether the wheels have power; the currents are nobody's concern here."""
    return WheelStatus(header=header(t, "base_link"), wheels_enabled=enabled)


def dock_status(docked: bool, t: float, visible: bool = True) -> DockStatus:
    """Whether the robot sits on its dock, and whether it sees it."""
    return DockStatus(header=header(t, "base_link"), dock_visible=visible, is_docked=docked)


def battery_state(docked: bool, t: float) -> BatteryState:
    """A battery that is nearly full and charges on the dock: 14.4 V, 1.8 Ah as in create3_docs."""
    charging = BatteryState.POWER_SUPPLY_STATUS_CHARGING
    draining = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    return BatteryState(
        header=header(t, "base_link"),
        voltage=16.0,
        current=0.5 if docked else -0.5,
        charge=1.62,
        capacity=1.8,
        design_capacity=1.8,
        percentage=0.9,
        power_supply_status=charging if docked else draining,
        present=True,
    )


def imu(counted: SimulatedOdometry, velocity: tuple[float, float], t: float) -> Imu:
    """The base's gyroscope and accelerometer: yaw and its rate, and gravity.

    Accelerations along the floor are left out: nothing here is quick enough for them to matter.
    """
    message = Imu(header=header(t, "imu_link"), orientation=quaternion(yaw=counted.yaw))
    message.angular_velocity.z = velocity[1]
    message.linear_acceleration.z = 9.81
    return message


def ground_truth(simulator: Simulator, goal_visible: bool, epoch: float = 0.0) -> GroundTruth:
    """What the simulator knows at its present time.

    Args:
        simulator: the robot in its world.
        goal_visible: whether the episode's goal is in view.
        epoch: s of node time at simulated time zero.
    """
    message = GroundTruth(header=header(epoch + simulator.time, "room"))
    pose, collisions, motion = simulator.world.pose, simulator.collisions, simulator.motion
    message.x, message.y, message.tilt = pose.x, pose.y, pose.tilt
    message.yaw = math.remainder(pose.yaw, math.tau)
    message.v, message.w = motion.v, motion.w
    if motion.still_since is not None:
        # A robot that rests from the very beginning does so since the first step: 0 means motion.
        since = max(motion.still_since, simulator.world.timestep)
        message.still_since = epoch + since
    message.in_contact = bool(collisions.contacts)
    message.contact_with = collisions.contacts[0].other if collisions.contacts else ""
    message.impact_speed = collisions.impact_speed
    message.collisions = collisions.count
    message.goal_visible = goal_visible
    message.room = simulator.world.room.name
    message.goal = simulator.goal
    message.shortest_path = simulator.shortest_path
    return message


def true_estimate(free: bool, t: float) -> CollisionEstimate:
    """What a sensor that never errs would say of MoveAhead.

    Args:
        free: whether it touches nothing.
        t: s, stamp of the scan beside which it is said.
    """
    return CollisionEstimate(
        header=header(t, "base_link"), probability=float(not free),
        clearance=STEP_M if free else 0.0, verdict=CollisionEstimate.GOOD, known_fraction=1.0,
    )  # fmt: skip


def occupancy_grid(occupancy: np.ndarray, resolution: float, t: float) -> OccupancyGrid:
    """A map of the room.

    Args:
        occupancy: int8 [H, W], 0 free, 100 occupied, row 0 at y = 0.
        resolution: m per cell.
        t: simulated s.
    """
    message = OccupancyGrid(header=header(t, "room"))
    message.info.map_load_time = stamp(t)
    message.info.resolution = resolution
    message.info.height, message.info.width = occupancy.shape
    message.info.origin.orientation = quaternion()
    message.data = array("b", np.ascontiguousarray(occupancy, dtype=np.int8).tobytes())
    return message
