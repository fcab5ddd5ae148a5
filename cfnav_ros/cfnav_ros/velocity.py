"""The one publisher on cmd_vel: who listens there, what type it wants, and what was sent when."""

from __future__ import annotations

import time
from collections import deque
from functools import partial

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import qos_profile_sensor_data
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from cfnav_ros import conversions
from cfnav_ros.motion import STOP, Command
from cfnav_ros.policy_parameters import PolicyParameters
from cfnav_ros.preflight import (
    RECORDERS,
    STAMPED,
    UNSTAMPED,
    BaseCheck,
    Endpoint,
    check_base,
)

CHECK_S = 0.5
"""Real time between looks at who else is on cmd_vel."""

KEPT = 50
"""Newest messages sent, by which ours are told from those of others: two seconds at 20 Hz."""

MESSAGES = {STAMPED: TwistStamped, UNSTAMPED: Twist}


class Velocity:
    """Sends velocities to the base that listens, in the type that it understands.

    A TurtleBot 4 is driven by ``cmd_vel_unstamped`` too, so that rivals are looked for on both.
    """

    def __init__(self, node: Node, settings: PolicyParameters) -> None:
        self.topic = node.resolve_topic_name("cmd_vel")
        self.type = ""
        self.sent: Command | None = None
        self.largest_gap = 0.0
        self._node, self._settings = node, settings
        stem = self.topic.removesuffix("_unstamped")
        self._topics = (stem, f"{stem}_unstamped")
        self._publisher: Publisher | None = None
        self._checked_at = self._sent_at = 0.0
        self._newest: deque[Twist | TwistStamped] = deque(maxlen=KEPT)
        self._ears: dict[str, Subscription] = {}
        self._somebody = ""

    @property
    def speaks(self) -> bool:
        """Whether there is anybody to send to."""
        return self._publisher is not None

    @property
    def matched(self) -> bool:
        """Whether what is sent now arrives at everybody who listens, a recorder included."""
        if self._publisher is None:
            return False
        ears = [
            info
            for info in self._node.get_subscriptions_info_by_topic(self.topic)
            if info.topic_type == self.type
        ]
        return self._publisher.get_subscription_count() >= len(ears) > 0

    def restart(self) -> None:
        """Begin an episode: look at the base at once, and forget what was before."""
        self._checked_at = self._sent_at = self.largest_gap = 0.0
        self._somebody = ""

    def check(self) -> BaseCheck | None:
        """Look who is on cmd_vel and speak its type; None when it was looked at just now."""
        if time.monotonic() - self._checked_at < CHECK_S:
            return None
        self._checked_at = time.monotonic()
        node, settings = self._node, self._settings
        publishers = {topic: self._others(topic) for topic in self._topics}
        subscribers = node.get_subscriptions_info_by_topic(self.topic)
        base = check_base(
            self.topic,
            conversions.endpoints(info for info in subscribers if not self._is_me(info)),
            {topic: [other.node for other in others] for topic, others in publishers.items()},
            settings.cmd_vel_type,
            settings.allow_robot,
            settings.other_publishers.split(),
        )
        if base.ready:
            self._speak(base.type)
            if settings.wait_for_recorder and not self._recorded():
                base = BaseCheck(waiting=f"No recorder hears {self.topic}.")
        self._follow(publishers)
        return BaseCheck(fault=self._somebody) if self._somebody else base

    def send(self, command: Command = STOP) -> None:
        """Publish a velocity, if anybody listens."""
        if self._publisher is None:
            return
        now = time.monotonic()
        if self._sent_at:
            self.largest_gap = max(self.largest_gap, now - self._sent_at)
        self._sent_at, self.sent = now, command
        message = conversions.twist(command)
        if self._publisher.msg_type is TwistStamped:
            stamp, frame = self._node.get_clock().now().to_msg(), self._settings.base_frame
            message = conversions.twist_stamped(command, stamp, frame)
        self._newest.appendleft(message)
        self._publisher.publish(message)

    def _recorded(self) -> bool:
        listeners = self._node.get_subscriptions_info_by_topic(self.topic)
        return self.matched and any(info.node_name in RECORDERS for info in listeners)

    def _speak(self, kind: str) -> None:
        if kind == self.type:
            return
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
        if self.topic in self._ears:  # a topic has one type in one process
            self._node.destroy_subscription(self._ears.pop(self.topic))
        self.type = kind
        message = MESSAGES[kind]
        self._publisher = self._node.create_publisher(message, "cmd_vel", 1)
        self._node.get_logger().info(f"Sending {message.__name__} to {self.topic}.")

    # Others that drive

    def _others(self, topic: str) -> list[Endpoint]:
        infos = self._node.get_publishers_info_by_topic(topic)
        return conversions.endpoints(info for info in infos if not self._is_me(info))

    def _is_me(self, info: TopicEndpointInfo) -> bool:
        me = (self._node.get_namespace(), self._node.get_name())
        return (info.node_namespace, info.node_name) == me

    def _follow(self, publishers: dict[str, list[Endpoint]]) -> None:
        """Listen to those that may publish too: when they do, the policy must not drive."""
        allowed = self._settings.other_publishers.split()
        for topic, others in publishers.items():
            types = [other.type for other in others if other.node in allowed]
            heard = (self.type,) if topic == self.topic else tuple(MESSAGES)
            kind = next((kind for kind in types if kind in heard), None)
            if kind is not None and topic not in self._ears:
                self._ears[topic] = self._node.create_subscription(
                    MESSAGES[kind], topic, partial(self._hear, topic), qos_profile_sensor_data
                )

    def _hear(self, topic: str, message: Twist | TwistStamped) -> None:
        if topic == self.topic and message in self._newest:
            return
        allowed = self._settings.other_publishers
        self._somebody = f"Somebody else drives: a velocity of {allowed} came on {topic}."
        self._checked_at = 0.0  # to be told at the next look
