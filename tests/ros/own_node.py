"""A node in the test's own process, which hears while the test waits."""

from __future__ import annotations

from collections.abc import Callable

import rclpy
from cfnav_ros.ros.spinning import leave
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from tests.conftest import wait_until


class OwnNode:
    """A node with a context and an executor of its own, in a ROS domain."""

    def __init__(self, domain: int, name: str) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def wait(
        self, condition: Callable[[], object], what: str, each: Callable[[], object] = lambda: None
    ) -> None:
        """Hears one message at a time until a condition holds.

        Args:
            condition: Looked at after every message.
            what: The condition in words, for the failure.
            each: Called between two messages.
        """

        def hear() -> None:
            each()
            self.executor.spin_once(timeout_sec=0.05)

        wait_until(condition, what, hear)

    def close(self) -> None:
        """Leaves the domain."""
        self.executor.shutdown()
        leave(self.node)
