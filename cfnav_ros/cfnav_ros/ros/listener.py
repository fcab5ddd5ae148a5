"""``Listener``: a subscription that knows how many publishers it has ever met."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import QoSSubscriptionEventType, UnsupportedEventTypeError
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from cfnav_ros.robot.speakers import Speaker
from cfnav_ros.ros.conversions import speakers, type_name

FOR_SURE = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Listener:
    """Hears one topic.

    A message does not tell who published it, and a publisher may be gone from the graph before its
    words are read. What the middleware counts is how many it has matched: while that is one, every
    message is of that one.
    """

    def __init__(
        self, node: Node, kind: type, topic: str, hear: Callable[[Any], None],
        qos: QoSProfile | int, state: bool = False,
    ) -> None:  # fmt: skip
        """Listen.

        Args:
            node: owner of the subscriptions.
            kind: type of the messages.
            topic: its name.
            hear: called with each message.
            qos: how it is heard.
            state: whether it is a state that may be told only when it changes. Nothing of it may be
                lost: where the robot offers that, what it said last comes at once and all else for
                sure. A robot that does not is heard all the same.

        Raises:
            RuntimeError: the middleware does not count whom it matches.
        """
        self._node, self._kind, self._topic, self._hear = node, kind, topic, hear
        self._qos, self._state = qos, state
        self._listen()

    def _listen(self) -> None:
        def create(hear: Callable[[Any], None], qos: QoSProfile | int) -> Subscription:
            return self._node.create_subscription(self._kind, self._topic, hear, qos)

        if self._state:
            self._latched = create(self._hear, FOR_SURE)
            self.subscription = create(self._hear_rest, self._qos)
            self._all = [self.subscription, self._latched]
        else:
            self.subscription = create(self._hear, self._qos)
            self._all = [self.subscription]
        self._matched = [_count_of(subscription) for subscription in self._all]

    def _hear_rest(self, message: Any) -> None:
        """What comes for sure is heard there already, where everybody offers that."""
        if self._latched.get_publisher_count() < self.subscription.get_publisher_count():
            self._hear(message)

    @property
    def topic(self) -> str:
        """Its resolved name."""
        return self.subscription.topic_name

    @property
    def type(self) -> str:
        """Of its messages, such as sensor_msgs/msg/Image."""
        return type_name(self.subscription)

    def speakers(self) -> list[Speaker]:
        """Who publishes there now, as the graph knows it."""
        return speakers(self._node.get_publishers_info_by_topic(self.topic), self.type)

    @property
    def met(self) -> int:
        """How many publishers it has ever matched, those that left included."""
        return max(_taken(event) for event in self._matched)

    def begin_anew(self) -> bool:
        """Where others have spoken and at most one is left, forget all that is not read yet.

        Returns:
            Whether that was so.
        """
        if self.met < 2 or len(self.speakers()) > 1:
            return False
        for event in self._matched:
            event.destroy_when_not_in_use()
        for subscription in self._all:
            self._node.destroy_subscription(subscription)
        self._listen()
        return True


def _count_of(subscription: Subscription) -> Any:
    """The middleware's event of matches, to be asked at any time instead of waited for."""
    try:
        with subscription.handle:
            return rclpy_implementation.EventHandle(
                subscription.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED
            )
    except UnsupportedEventTypeError as error:
        raise RuntimeError(
            "This middleware does not tell whom it matches, without which forged messages go "
            "unnoticed: use rmw_fastrtps_cpp or rmw_cyclonedds_cpp."
        ) from error


def _taken(event: Any) -> int:
    with event:
        return event.take_event().total_count
