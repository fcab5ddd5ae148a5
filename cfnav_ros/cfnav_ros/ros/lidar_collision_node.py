"""LaserScan, and depth where there is any -> CollisionEstimate: would MoveAhead collide?

Run it with ``cfnav node lidar``; its parameters are those of
``scan_watch.LidarParameters``.
"""

from __future__ import annotations

import sys
import time
from functools import partial

from builtin_interfaces.msg import Time
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.subscription import Subscription
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from cfnav_core.robot.topics import TOPICS, Topic
from cfnav_ros.drive import fields
from cfnav_ros.drive.diagnostics import Level, Report
from cfnav_ros.lidar.depth_watch import DepthWatch
from cfnav_ros.lidar.diagnostics import ScanStats
from cfnav_ros.lidar.estimate import Estimate, Verdict, blind
from cfnav_ros.lidar.mounting import MOUNT, told
from cfnav_ros.lidar.scan_watch import GRAPH_S, LidarParameters, ScanWatch
from cfnav_ros.ros import conversions
from cfnav_ros.ros.depth_listener import DepthListener
from cfnav_ros.ros.listener import Listener
from cfnav_ros.ros.node_process import run_node
from cfnav_ros.ros.parameters import declare, named_robot
from cfnav_ros.ros.topics import publisher, quality

NAME = "lidar_collision_node"

LEVELS = {Verdict.GOOD: Level.OK, Verdict.DEGRADED: Level.WARN, Verdict.BLIND: Level.ERROR}


class LidarCollisionNode(Node):
    """Publishes an estimate on every scan, and BLIND ones while scans stay away."""

    def __init__(self) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        given = any(self.has_parameter(name) for name in MOUNT)
        robot = named_robot(self)
        parameters = declare(self, LidarParameters.of(robot))
        disc, self._base_frame = parameters.disc, parameters.base_frame
        self._mounting = parameters.mounting(given)
        self._watch = ScanWatch(
            parameters.stale, parameters.frozen, self._mounting, disc, parameters.errors
        )
        self._stats, self._last = ScanStats(), blind("No scan has arrived.")
        self._sees: bool | None = None
        self._source = ""
        self._publisher = publisher(self, TOPICS["estimate"])
        self._diagnostics = publisher(self, TOPICS["diagnostics"])
        self._scans = Listener(
            self, LaserScan, robot.topics["scan"].name, self._on_scan, qos_profile_sensor_data
        )
        depth = DepthWatch(
            parameters.depth, parameters.frozen, disc, parameters.errors, self._mounting.tree,
            self._base_frame,
        )  # fmt: skip
        self._frames = robot.topics.get("tf_static"), robot.topics.get("tf")
        self._tf_static: Subscription | None = None
        self._tf: Subscription | None = None
        self._depth = DepthListener(self, robot, depth, self._hear_frames)
        if parameters.mount != "parameters":
            self._hear_frames()
        self.create_timer(1.0 / parameters.stale_rate, self._on_silence)
        # On real time: node time may stand still, and who publishes has nothing to do with it.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(GRAPH_S, self._look_for_rivals, clock=steady)
        self.create_timer(1.0, self._on_second, clock=steady)
        self.get_logger().info(
            f"Judging {self._scans.topic} -> {self._publisher.topic_name}; the "
            f"parameters put the LiDAR at {told(disc.mount)}."
        )
        if not disc.mask_bearings:
            self.get_logger().warning(
                "disc.mask_bearings_deg is empty: without parts of the robot to look for, a LiDAR "
                "that is mounted otherwise than said goes unnoticed."
            )

    def _hear_transforms(self, topic: Topic, fixed: bool) -> Subscription:
        hear = partial(self._on_transforms, fixed)
        return self.create_subscription(TFMessage, topic.name, hear, quality(topic))

    def _hear_frames(self) -> None:
        """Hear where LiDAR and depth camera sit, as far as it is not heard already."""
        still, moving = self._frames
        if still and self._tf_static is None:
            self._tf_static = self._hear_transforms(still, True)
        if moving and self._tf is None:
            self._tf = self._hear_transforms(moving, False)

    def _on_scan(self, message: LaserScan) -> None:
        begun = time.perf_counter()
        self._look_for_rivals()
        now = self.get_clock().now()
        stamp = fields.stamp_to_seconds(message.header.stamp)
        scan = fields.scan_from_message(message)
        estimate, timely = self._watch.scan(now.nanoseconds * 1e-9, stamp, scan)
        if timely:
            estimate = self._depth.joined(now.nanoseconds * 1e-9, stamp, estimate)
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

    def _on_transforms(self, fixed: bool, message: TFMessage) -> None:
        for stamped in message.transforms:
            at, q = stamped.transform.translation, stamped.transform.rotation
            self._mounting.tree.add(
                stamped.header.frame_id,
                stamped.child_frame_id,
                (at.x, at.y, at.z),
                (q.x, q.y, q.z, q.w),
                fixed,
            )

    def _on_source(self, frame: str) -> None:
        """Say once where the mounting comes from."""
        self._source = self._watch.source
        mount, source, _ = self._mounting.choose(frame)
        if mount is not None:
            self.get_logger().info(f"The mounting comes from {source}: {told(mount)}.")
        if self._source == "TF" and self._tf is not None and not self._depth.arrives:
            # The way to the scanner is known; only a depth camera may move on TF.
            self.destroy_subscription(self._tf)
            self._tf = None

    def _look_for_rivals(self) -> None:
        self._watch.publishers(time.monotonic(), self._scans.speakers(), self._scans.met)
        self._scans.begin_anew()
        self._depth.look_for_rivals()

    def _on_second(self) -> None:
        now = self.get_clock().now()
        values = self._stats.values(
            self._last, self._watch.age(now.nanoseconds * 1e-9), self._watch.source
        )
        seen = self._last.reason or "The LiDAR sees."
        lidar = Report("LiDAR", LEVELS[self._last.verdict], seen, values)
        reports = [lidar, *self._depth.reports(now.nanoseconds * 1e-9)]
        name = self.get_fully_qualified_name()
        self._diagnostics.publish(conversions.diagnostics(reports, name, now.to_msg()))

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
