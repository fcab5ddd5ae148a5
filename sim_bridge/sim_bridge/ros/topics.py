"""Rows of the table of topics as rclpy takes them."""

from __future__ import annotations

from importlib import import_module

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile

from cfnav_core.robot.topics import Topic


def publisher(node: Node, topic: Topic) -> Publisher:
    """Offer a topic, reliably whatever those want who listen."""
    package, _, kind = topic.type.partition("/msg/")
    latched, volatile = DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE
    qos = QoSProfile(depth=topic.depth, durability=latched if topic.latched else volatile)
    return node.create_publisher(getattr(import_module(f"{package}.msg"), kind), topic.name, qos)
