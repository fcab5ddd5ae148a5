"""LaserScan -> CollisionEstimate: would MoveAhead collide?

Run it with ``python -m cfnav_ros.lidar_collision_node``; its parameters are those of
``scan_watch.LidarParameters``.
"""

from __future__ import annotations

import sys
import time

from builtin_interfaces.msg import Time
from cfnav_interfaces.msg import CollisionEstimate
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from cfnav_ros import conversions
from cfnav_ros.lidar import Estimate, Verdict, blind
from cfnav_ros.lidar_diagnostics import ScanStats
from cfnav_ros.mounting import MOUNT, Mounting, told
from cfnav_ros.node_process import run_node
from cfnav_ros.parameters import declare
from cfnav_ros.scan_watch import GRAPH_S, LidarParameters, ScanWatch

NAME = "lidar_collision_node"

LEVELS = {
    Verdict.GOOD: DiagnosticStatus.OK,
    Verdict.DEGRADED: DiagnosticStatus.WARN,
    Verdict.BLIND: DiagnosticStatus.ERROR,
}

LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class LidarCollisionNode(Node):
    """Publishes an estimate on every scan, and BLIND ones while scans stay away."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        given = any(self.has_parameter(name) for name in MOUNT)
        parameters = declare(self, LidarParameters)
        disc, self._base_frame = parameters.disc, parameters.base_frame
        self._mounting = Mounting(
            parameters.mount, disc.mount, given, parameters.base_frame, parameters.frame
        )
        self._watch = ScanWatch(
            parameters.stale, parameters.frozen, self._mounting, disc, parameters.errors
        )
        self._stats, self._last = ScanStats(), blind("No scan has arrived.")
        self._sees: bool | None = None
        self._source = ""
        self._publisher = self.create_publisher(
            CollisionEstimate, "collision/estimate", QoSProfile(depth=5)
        )
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)
        self._tf = None
        if parameters.mount != "parameters":
            self.create_subscription(TFMessage, "tf_static", self._on_transforms, LATCHED)
            self._tf = self.create_subscription(TFMessage, "tf", self._on_transforms, 100)
        self.create_timer(1.0 / parameters.stale_rate, self._on_silence)
        # On real time: node time may stand still, and who publishes has nothing to do with it.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(GRAPH_S, self._look_for_rivals, clock=steady)
        self.create_timer(1.0, self._on_second, clock=steady)
        self.get_logger().info(
            f"Judging {self.resolve_topic_name('scan')} -> {self._publisher.topic_name}; the "
            f"parameters put the LiDAR at {told(disc.mount)}."
        )
        if not disc.mask_bearings:
            self.get_logger().warning(
                "disc.mask_bearings_deg is empty: without parts of the robot to look for, a LiDAR "
                "that is mounted otherwise than said goes unnoticed."
            )

    def _on_scan(self, message: LaserScan) -> None:
        begun = time.perf_counter()
        now = self.get_clock().now()
        stamp = conversions.stamp_to_seconds(message.header.stamp)
        scan = conversions.scan_from_message(message)
        estimate, timely = self._watch.scan(now.nanoseconds * 1e-9, stamp, scan)
        self._publish(estimate, message.header.stamp if timely else now.to_msg())
        if self._watch.source != self._source:
            self._on_source(scan.frame)
        self._stats.add(stamp, time.perf_counter() - begun)

    def _on_silence(self) -> None:
        now = self.get_clock().now()
        estimate = self._watch.silence(now.nanoseconds * 1e-9)
        if estimate is not None:
            # Stamped now: that nothing is seen is news of now, not of the last scan.
            self._publish(estimate, now.to_msg())

    def _on_transforms(self, message: TFMessage) -> None:
        for stamped in message.transforms:
            at, q = stamped.transform.translation, stamped.transform.rotation
            self._mounting.tree.add(
                stamped.header.frame_id,
                stamped.child_frame_id,
                (at.x, at.y, at.z),
                (q.x, q.y, q.z, q.w),
            )

    def _on_source(self, frame: str) -> None:
        """Say once where the mounting comes from."""
        self._source = self._watch.source
        mount, source, _ = self._mounting.choose(frame)
        if mount is not None:
            self.get_logger().info(f"The mounting comes from {source}: {told(mount)}.")
        if self._source == "TF" and self._tf is not None:
            # The way to the scanner is known; what moves on TF is of no use here.
            self.destroy_subscription(self._tf)
            self._tf = None

    def _look_for_rivals(self) -> None:
        infos = self.get_publishers_info_by_topic(self.resolve_topic_name("scan"))
        self._watch.publishers([info.node_name for info in infos])

    def _on_second(self) -> None:
        now = self.get_clock().now()
        values = self._stats.values(
            self._last, self._watch.age(now.nanoseconds * 1e-9), self._watch.source
        )
        status = DiagnosticStatus(
            level=LEVELS[self._last.verdict],
            name=f"{self.get_fully_qualified_name()}: LiDAR",
            message=self._last.reason or "The LiDAR sees.",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = now.to_msg()
        self._diagnostics.publish(array)

    def _publish(self, estimate: Estimate, stamp: Time) -> None:
        self._publisher.publish(conversions.estimate_to_message(estimate, stamp, self._base_frame))
        self._last = estimate
        sees = estimate.verdict is not Verdict.BLIND
        if sees is not self._sees:
            self._sees = sees
            if sees:
                self.get_logger().info("The LiDAR sees.")
            else:
                self.get_logger().warning(f"Blind: {estimate.reason}")


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; the exit code is that of ``run_node``."""
    return run_node(NAME, LidarCollisionNode, args)


if __name__ == "__main__":
    sys.exit(main())
