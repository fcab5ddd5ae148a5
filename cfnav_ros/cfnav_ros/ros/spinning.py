"""How a node joins a domain, is served in a thread of its own, and leaves."""

from __future__ import annotations

import threading
from collections.abc import Callable

import rclpy
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


class SpinningThread(threading.Thread):
    """Serves a node from ``start`` until ``end``, or until its context is shut down.

    rclpy's ``Executor.shutdown`` takes away what a thread that spins is about to use, so it comes
    after the thread's last turn.

    Attributes:
        executor: serves; what must not meet a callback goes in as its task. rclpy's action client
            raises when an answer is taken while another thread still notes that it was asked for.
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
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)

    def run(self) -> None:
        """Serve; ``start`` calls it."""
        try:
            while not self._ending and self.executor.context.ok():
                self.executor.spin_once()
        except ExternalShutdownException:
            return
        except Exception as error:
            if self._failed is None:
                raise
            self._failed(error)

    def end(self) -> None:
        """Serve no more; returns when the callback under way has ended."""
        self._ending = True
        # Its turn ends when something was done; to be woken is not enough for a node at rest.
        self.executor.create_task(lambda: None)
        if self.is_alive():
            self.join()
        self.executor.shutdown()


def join(domain: int, context: Context | None = None) -> Context:
    """A context in a ROS domain, a new one if none is given; signals stay with those who had them.

    Args:
        domain: the environment says how far it reaches.
        context: which has not joined any yet.
    """
    context = context or Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    return context


def leave(node: Node) -> None:
    """Destroy a node so that nobody in its domain sees it any longer, and shut its context down.

    ``Node.destroy_node`` forgets action clients, and one of them keeps the node in its domain
    until Python's collector finds it.
    """
    for waitable in list(node.waitables):
        if isinstance(waitable, ActionClient):
            waitable.destroy()
    node.destroy_node()
    node.context.try_shutdown()
