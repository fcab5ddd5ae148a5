"""The one publisher on cmd_vel: who listens there, what type it wants, and what was sent when."""

from __future__ import annotations

import os
import time
from collections import deque
from functools import partial

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import qos_profile_sensor_data
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from cfnav_core.robot.robot import Robot
from cfnav_core.robot.topics import STAMPED, UNSTAMPED, unstamped
from cfnav_ros.drive.motion import STOP, Command
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.drive.preflight import (
    BaseCheck,
    Endpoint,
    check_base,
    check_mux,
    check_recorder,
    hidden,
)
from cfnav_ros.ros import conversions

CHECK_S = 0.5
"""Real time between looks at who else is on cmd_vel."""

TO_COME = 50
"""Of what we send so much may be on its way back to us, where we listen to others there: two
seconds and more."""

ACTION = "navigate_to_object"
"""Served by every policy node: two of them would both take a goal and drive."""

MESSAGES = {STAMPED: TwistStamped, UNSTAMPED: Twist}


class VelocityPublisher:
    """Sends velocities to the base that listens, in the type that it understands.

    A TurtleBot 4 is driven by ``cmd_vel_unstamped`` too, so that rivals are looked for on both.
    Where ``cmd_vel_topic`` names the input of a multiplexer, what comes out of it on the base's own
    topic must be what went in.
    """

    def __init__(self, node: Node, settings: PolicyParameters, robot: Robot) -> None:
        self._base_topic = node.resolve_topic_name(robot.topics["cmd_vel"].name)
        asked = settings.cmd_vel_topic
        self.topic = node.resolve_topic_name(asked) if asked else self._base_topic
        self.type = ""
        self.largest_gap = 0.0
        self._node, self._settings = node, settings
        second = unstamped(self._base_topic)
        pair = (second.removesuffix("_unstamped"), second)
        self._topics = tuple(dict.fromkeys((*pair, self.topic)))
        self._goals = node.resolve_service_name(f"{ACTION}/_action/send_goal")
        self._publisher: Publisher | None = None
        self._me = conversions.own_participant(node)
        self._checked_at = self._sent_at = 0.0
        self._to_come: dict[str, deque[Twist | TwistStamped]] = {}
        self._listeners: dict[str, Subscription] = {}
        self._other_driver = ""

    @property
    def speaks(self) -> bool:
        """Whether there is anybody to send to."""
        return self._publisher is not None

    @property
    def matched(self) -> bool:
        """Whether what is sent now arrives at everybody who listens, a recorder included."""
        if self._publisher is None:
            return False
        listeners = [
            info
            for info in self._node.get_subscriptions_info_by_topic(self.topic)
            if info.topic_type == self.type
        ]
        return self._publisher.get_subscription_count() >= len(listeners) > 0

    def restart(self) -> None:
        """Begin an episode: look at the base at once, and forget what was before."""
        self._checked_at = self._sent_at = self.largest_gap = 0.0
        self._other_driver = ""

    def check(self) -> BaseCheck | None:
        """Look who is on cmd_vel and speak its type; None when it was looked at just now."""
        if time.monotonic() - self._checked_at < CHECK_S:
            return None
        self._checked_at = time.monotonic()
        node, settings = self._node, self._settings
        if unseen := hidden(os.environ):
            return BaseCheck(fault=unseen)
        if node.count_services(self._goals) > 1:
            return BaseCheck(fault=f"Another node serves {ACTION} too: end it, one must drive.")
        publishers = {topic: self._others(topic) for topic in self._topics}
        drivers = {topic: [o.node for o in others] for topic, others in publishers.items()}
        base = check_base(
            self._base_topic,
            self._listening(self._base_topic),
            drivers,
            settings.cmd_vel_type,
            settings.allow_robot,
            settings.other_publishers.split(),
            self._namesakes(),
        )
        if base.ready and self.topic != self._base_topic:
            listening = self._listening(self.topic)
            base = check_mux(self.topic, listening, self._base_topic, drivers[self._base_topic])
        if base.ready:
            self._speak(base.type)
            if settings.wait_for_recorder:
                listening = self._listening(self._base_topic)
                base = check_recorder(base, self._base_topic, listening, self.matched)
        self._follow(publishers)
        return BaseCheck(fault=self._other_driver) if self._other_driver else base

    def send(self, command: Command = STOP) -> None:
        """Publish a velocity, if anybody listens."""
        if self._publisher is None:
            return
        now = time.monotonic()
        if self._sent_at:
            self.largest_gap = max(self.largest_gap, now - self._sent_at)
        self._sent_at = now
        message = conversions.twist(command)
        if self._publisher.msg_type is TwistStamped:
            stamp, frame = self._node.get_clock().now().to_msg(), self._settings.base_frame
            message = conversions.twist_stamped(command, stamp, frame)
        for ours in self._to_come.values():
            ours.append(message)
        self._publisher.publish(message)

    def _namesakes(self) -> list[str]:
        """Topics called like that of this base, in whatever namespace, that have listeners."""
        last = self._base_topic.rpartition("/")[2]
        names = [name for name, _ in self._node.get_topic_names_and_types()]
        alike = [name for name in names if name.rpartition("/")[2] == last]
        return [name for name in alike if self._node.count_subscribers(name)]

    def _listening(self, topic: str) -> list[Endpoint]:
        infos = self._node.get_subscriptions_info_by_topic(topic)
        return conversions.endpoints(info for info in infos if not self._is_me(info))

    def _speak(self, kind: str) -> None:
        if kind == self.type:
            return
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
        if self.topic in self._listeners:  # a topic has one type in one process
            self._node.destroy_subscription(self._listeners.pop(self.topic))
        self.type = kind
        message = MESSAGES[kind]
        self._publisher = self._node.create_publisher(message, self.topic, 1)
        self._node.get_logger().info(f"Sending {message.__name__} to {self.topic}.")

    # Others that drive

    def _others(self, topic: str) -> list[Endpoint]:
        infos = self._node.get_publishers_info_by_topic(topic)
        return conversions.endpoints(info for info in infos if not self._is_me(info))

    def _is_me(self, info: TopicEndpointInfo) -> bool:
        return conversions.participant(info) == self._me

    def _follow(self, publishers: dict[str, list[Endpoint]]) -> None:
        """Listen to those that may publish too: when they do, the policy must not drive."""
        allowed = self._settings.other_publishers.split()
        for topic, others in publishers.items():
            types = [other.type for other in others if other.node in allowed]
            heard = (self.type,) if topic == self.topic else tuple(MESSAGES)
            kind = next((kind for kind in types if kind in heard), None)
            if kind is not None and topic not in self._listeners:
                if topic in (self.topic, self._base_topic):
                    self._to_come[topic] = deque(maxlen=TO_COME)
                self._listeners[topic] = self._node.create_subscription(
                    MESSAGES[kind], topic, partial(self._hear, topic), qos_profile_sensor_data
                )

    def _hear(self, topic: str, message: Twist | TwistStamped) -> None:
        if self._comes_back(topic, message):
            return
        allowed = self._settings.other_publishers
        self._other_driver = f"Somebody else drives: a velocity of {allowed} came on {topic}."
        self._checked_at = 0.0  # to be told at the next look

    def _comes_back(self, topic: str, message: Twist | TwistStamped) -> bool:
        """Whether a message is ours, the oldest like it.

        Each comes back once and in its order, so that of two alike one is somebody else's: a Twist
        bears no stamp, and a joystick's zeros look like ours.
        """
        ours = self._to_come.get(topic, deque())
        alike = next((n for n, sent in enumerate(ours) if sent == message), None)
        if alike is None:
            return False
        for _ in range(alike + 1):
            ours.popleft()
        return True
