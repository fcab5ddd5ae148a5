"""Rows of the table of topics as rclpy takes them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)

from cfnav_core.robot.topics import Topic

if TYPE_CHECKING:
    from cfnav_ros.bags.files.sources import Offer


def message_type(name: str) -> Any:
    """The class of messages of a type such as sensor_msgs/msg/Image.

    Raises:
        ImportError, AttributeError: this machine does not have it.
    """
    package, _, kind = name.partition("/msg/")
    return getattr(import_module(f"{package}.msg"), kind)


def quality(topic: Topic | Offer, depth: int = 0) -> QoSProfile:
    """The quality of service of a topic, here or in a bag; another depth than its own if not 0."""
    reliability, durability = ReliabilityPolicy, DurabilityPolicy
    return QoSProfile(
        depth=depth or topic.depth,
        reliability=reliability.RELIABLE if topic.reliable else reliability.BEST_EFFORT,
        durability=durability.TRANSIENT_LOCAL if topic.latched else durability.VOLATILE,
    )


def newest_only(lock_step: bool) -> QoSProfile:
    """To listen to what is looked at: late pictures are dropped.

    In lock-step none may be lost, as the simulator waits for an answer to each.
    """
    if lock_step:
        return QoSProfile(depth=10)
    return QoSProfile(depth=1, reliability=qos_profile_sensor_data.reliability)


def publisher(node: Node, topic: Topic) -> Publisher:
    """Offer a topic."""
    return node.create_publisher(message_type(topic.type), topic.name, quality(topic))
