"""A process that runs one node until it is told to end."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from typing import TypeVar

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from cfnav_ros.process.stop_signal import StopSignal

Made = TypeVar("Made", bound=Node)


def run_node(
    name: str,
    make: Callable[[], Made],
    args: list[str] | None = None,
    shut_down: Callable[[Made, Executor], None] = lambda node, executor: None,
) -> int:
    """Serve a node's callbacks in this thread until SIGINT or SIGTERM.

    Args:
        name: begins the sentence that says why the node cannot be made.
        make: makes the node; ValueError and RuntimeError say that it cannot be used as asked for.
        args: command line, ``sys.argv`` when None.
        shut_down: called in any case before the context ends, while messages can still be sent.

    Returns:
        0 when told to end, 1 when a callback failed, 2 when the node could not be made.
    """
    stop = StopSignal()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make()
    except (ValueError, RuntimeError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stop:
            executor.spin_once(timeout_sec=0.1)
        return 0
    except Exception:
        traceback.print_exc()
        return 1
    finally:
        shut_down(node, executor)
        rclpy.try_shutdown()
