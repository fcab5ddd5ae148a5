"""The depth camera's topics -> ``DepthWatch``, for the LiDAR node."""

from __future__ import annotations

from collections.abc import Callable

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from cfnav_core.robot.robot import Robot
from cfnav_core.robot.topics import CLOUD
from cfnav_ros.drive import fields
from cfnav_ros.drive.diagnostics import Level, Report
from cfnav_ros.lidar.depth_watch import DepthWatch
from cfnav_ros.lidar.estimate import Estimate
from cfnav_ros.ros.listener import Listener


class DepthListener:
    """Hears depth where the robot has it, and says what becomes of it.

    Odometry and what moves on TF cost something to hear, so they are heard from the first picture
    on: most robots are driven without depth.
    """

    def __init__(
        self, node: Node, robot: Robot, watch: DepthWatch, on_first: Callable[[], None]
    ) -> None:
        """Listen.

        Args:
            node: owner of the subscriptions.
            robot: names of the topics that there are.
            watch: takes what is heard.
            on_first: called when the first picture comes, before it is taken.
        """
        self._node, self._watch, self._on_first = node, watch, on_first
        self._odometry = robot.topics["odom"].name
        self.arrives = False
        """Whether a picture has ever come."""
        self._told: str | None = None
        depth, info = (robot.topics.get(role) for role in ("depth", "depth_info"))
        kind = PointCloud2 if depth and depth.type == CLOUD else Image
        self._pictures = depth and Listener(
            node, kind, depth.name, self._on_picture, qos_profile_sensor_data
        )
        if depth and info:
            node.create_subscription(
                CameraInfo, info.name, self._on_calibration, qos_profile_sensor_data
            )

    def look_for_rivals(self) -> None:
        """Look who publishes depth."""
        if self.arrives and self._pictures:
            self._watch.publishers(self._pictures.speakers(), self._pictures.met)
            self._pictures.begin_anew()

    def joined(self, now: float, stamp: float, estimate: Estimate) -> Estimate:
        """The LiDAR's estimate with what depth shows, see ``DepthWatch.joined``."""
        if not self._pictures:
            return estimate
        joined = self._watch.joined(now, stamp, estimate)
        self._tell(self._watch.fault(now))
        return joined

    def reports(self, now: float) -> list[Report]:
        """The row of /diagnostics at node time now, seconds; none where the robot has no depth."""
        if not self._pictures:
            return []
        fault = self._watch.fault(now)
        level = Level.WARN if fault and self.arrives else Level.OK
        seen = (fault or "Depth sees.") if self.arrives else "not heard"
        return [Report("depth", level, seen, {"known_fraction": f"{self._watch.known:.3f}"})]

    def _tell(self, fault: str) -> None:
        """Say once when depth begins or ceases to show something new."""
        if self._told is not None and bool(fault) is bool(self._told):
            return
        self._told = fault
        logger = self._node.get_logger()
        if not fault:
            logger.info("Depth sees.")
        elif self.arrives:
            logger.warning(f"The LiDAR guards alone: {fault}")
        else:
            logger.info(f"The LiDAR guards alone: {fault}")

    def _on_picture(self, message: Image | PointCloud2) -> None:
        if not self.arrives:
            self.arrives = True
            self._node.create_subscription(
                Odometry, self._odometry, self._on_odometry, qos_profile_sensor_data
            )
            self._on_first()
        self._watch.picture(fields.stamp_to_seconds(message.header.stamp), message)

    def _on_calibration(self, message: CameraInfo) -> None:
        self._watch.calibration(fields.pinhole_from_message(message))

    def _on_odometry(self, message: Odometry) -> None:
        try:
            odometry = fields.odometry_from_message(message)
        except ValueError:
            return  # the policy node says so, and does not drive
        self._watch.odometry(odometry.stamp, odometry.x, odometry.y, odometry.yaw)
