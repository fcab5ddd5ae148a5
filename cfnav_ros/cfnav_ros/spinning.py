"""A node that is served in a thread of its own, and ended from another."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node


class SpinningThread(threading.Thread):
    """Serves a node from ``start`` until ``end``, or until its context is shut down.

    rclpy's ``Executor.shutdown`` takes away what a thread that spins is about to use, so it comes
    after the thread's last turn.
    """

    def __init__(self, node: Node, failed: Callable[[Exception], None] | None = None) -> None:
        """Take the node.

        Args:
            node: its name becomes the thread's.
            failed: told of what a callback raised, which ends the thread; raised in it when absent.
        """
        super().__init__(name=node.get_name())
        self._failed = failed
        self._ending = False
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def run(self) -> None:
        """Serve; ``start`` calls it."""
        try:
            while not self._ending and self._executor.context.ok():
                self._executor.spin_once()
        except ExternalShutdownException:
            return
        except Exception as error:
            if self._failed is None:
                raise
            self._failed(error)

    def end(self) -> None:
        """Serve no more; returns when the callback under way has ended."""
        self._ending = True
        self._executor.wake()
        if self.is_alive():
            self.join()
        self._executor.shutdown()
