"""The one publisher on cmd_vel: who listens there, what type it wants, and what was sent when."""

from __future__ import annotations

import time

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.publisher import Publisher

from cfnav_ros import conversions
from cfnav_ros.motion import STOP, Command
from cfnav_ros.parameters import PolicyParameters
from cfnav_ros.preflight import STAMPED, BaseCheck, check_base

CHECK_S = 0.5
"""Real time between looks at who else is on cmd_vel."""


class Velocity:
    """Sends velocities to the base that listens, in the type that it understands."""

    def __init__(self, node: Node, settings: PolicyParameters) -> None:
        self.topic = node.resolve_topic_name("cmd_vel")
        self.type = ""
        self.sent: Command | None = None
        self.largest_gap = 0.0
        self._node, self._settings = node, settings
        self._publisher: Publisher | None = None
        self._checked_at = self._sent_at = 0.0

    @property
    def speaks(self) -> bool:
        """Whether there is anybody to send to."""
        return self._publisher is not None

    @property
    def matched(self) -> bool:
        """Whether what is sent now arrives."""
        return self._publisher is not None and self._publisher.get_subscription_count() > 0

    def restart(self) -> None:
        """Begin an episode: look at the base at once, and forget how long nothing was sent."""
        self._checked_at = self._sent_at = self.largest_gap = 0.0

    def check(self) -> BaseCheck | None:
        """Look who is on cmd_vel and speak its type; None when it was looked at just now."""
        if time.monotonic() - self._checked_at < CHECK_S:
            return None
        self._checked_at = time.monotonic()
        node, settings = self._node, self._settings
        infos = node.get_publishers_info_by_topic(self.topic)
        publishers = [(info.node_namespace, info.node_name) for info in infos]
        me = (node.get_namespace(), node.get_name())
        if self._publisher is not None and me in publishers:
            publishers.remove(me)
        base = check_base(
            self.topic,
            conversions.endpoints(node.get_subscriptions_info_by_topic(self.topic)),
            [name for _, name in publishers],
            settings.cmd_vel_type,
            settings.allow_robot,
            settings.other_publishers.split(),
        )
        if base.ready:
            self._speak(base.type)
        return base

    def send(self, command: Command = STOP) -> None:
        """Publish a velocity, if anybody listens."""
        if self._publisher is None:
            return
        now = time.monotonic()
        if self._sent_at:
            self.largest_gap = max(self.largest_gap, now - self._sent_at)
        self._sent_at, self.sent = now, command
        if self._publisher.msg_type is Twist:
            self._publisher.publish(conversions.twist(command))
            return
        stamp, frame = self._node.get_clock().now().to_msg(), self._settings.base_frame
        self._publisher.publish(conversions.twist_stamped(command, stamp, frame))

    def _speak(self, kind: str) -> None:
        if kind == self.type:
            return
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
        self.type = kind
        message = TwistStamped if kind == STAMPED else Twist
        self._publisher = self._node.create_publisher(message, "cmd_vel", 1)
        self._node.get_logger().info(f"Sending {message.__name__} to {self.topic}.")
