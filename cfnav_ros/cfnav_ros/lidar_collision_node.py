"""LaserScan -> CollisionEstimate: would MoveAhead collide?

Run it with ``python -m cfnav_ros.lidar_collision_node``; its parameters are those of
``parameters.LidarParameters``.
"""

from __future__ import annotations

import sys

import rclpy
from cfnav_interfaces.msg import CollisionEstimate
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import LaserScan

from cfnav_ros import conversions
from cfnav_ros.parameters import LidarParameters, declare
from cfnav_ros.scan_watch import ScanWatch
from cfnav_ros.stop_signal import StopSignal

NAME = "lidar_collision_node"


class LidarCollisionNode(Node):
    """Publishes an estimate on every scan, and BLIND ones while scans stay away."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        parameters = declare(self, LidarParameters)
        self._watch = ScanWatch(parameters.stale, parameters.disc)
        self._verdict = -1
        self._publisher = self.create_publisher(
            CollisionEstimate, "collision/estimate", QoSProfile(depth=5)
        )
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)
        self.create_timer(1.0 / parameters.stale_rate, self._on_silence)
        self.get_logger().info(
            f"Judging {self.resolve_topic_name('scan')} with the LiDAR at "
            f"({parameters.disc.mount_x:g}, {parameters.disc.mount_y:g}) m, yaw "
            f"{parameters.disc.mount_yaw_deg:g} deg -> {self._publisher.topic_name}."
        )

    def _on_scan(self, message: LaserScan) -> None:
        now = self.get_clock().now().nanoseconds * 1e-9
        stamp = conversions.stamp_to_seconds(message.header.stamp)
        estimate = self._watch.scan(now, stamp, conversions.scan_from_message(message))
        if estimate is not None:
            self._publish(conversions.estimate_to_message(estimate, message.header.stamp))

    def _on_silence(self) -> None:
        now = self.get_clock().now()
        estimate = self._watch.silence(now.nanoseconds * 1e-9)
        if estimate is not None:
            # Stamped now: that nothing is seen is news of now, not of the last scan.
            self._publish(conversions.estimate_to_message(estimate, now.to_msg()))

    def _publish(self, message: CollisionEstimate) -> None:
        self._publisher.publish(message)
        if message.verdict != self._verdict:
            self._verdict = message.verdict
            if message.verdict == CollisionEstimate.BLIND:
                self.get_logger().warning(f"Blind: {message.reason}")
            else:
                self.get_logger().info(message.reason or "The LiDAR sees.")


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM.

    Returns:
        0 when told to end, 2 when a parameter cannot be used.
    """
    stop = StopSignal()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = LidarCollisionNode()
    except (ValueError, RuntimeError) as error:
        print(f"{NAME}: {error}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    try:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not stop:
            executor.spin_once(timeout_sec=0.1)
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
