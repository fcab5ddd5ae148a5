"""A TurtleBot 4 that is not there: the process around ``mock_node.MockTurtleBot4``.

Run it with ``python -m sim_bridge.mock_turtlebot4 --ros-args -p room:=kitchen:21``; the parameters
are those of ``parameters.MockParameters``.
"""

from __future__ import annotations

import signal
import sys
import threading
from concurrent.futures import CancelledError

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


def main(args: list[str] | None = None) -> int:
    """Run the mock until SIGINT or SIGTERM.

    Returns:
        0 when it was told to end, 2 when it could not start.
    """
    signal.signal(signal.SIGINT, _end)
    signal.signal(signal.SIGTERM, _end)
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        return _run()
    except KeyboardInterrupt:
        return 0
    finally:
        rclpy.try_shutdown()


def _end(number: int, frame: object) -> None:
    # A second signal must not tear the clean-up in two.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def _run() -> int:
    """Receive in one thread, simulate in this one."""
    node = None
    try:
        # Here, because without a GL library this import fails with the sentence to print.
        from sim_bridge.mock_node import MockTurtleBot4

        node = MockTurtleBot4()
        node.set_up()
    except (ValueError, ImportError) as error:
        print(f"mock_turtlebot4: {error}", file=sys.stderr)
        if node is not None:
            node.close()
        return 2
    spinner = threading.Thread(target=_spin, args=(node,))
    spinner.start()
    try:
        print(f"mock_turtlebot4 ready: {node.summary}", flush=True)
        node.run()
    finally:
        rclpy.try_shutdown()
        while spinner.is_alive():
            node.refuse_requests()
            spinner.join(timeout=0.05)
        node.close()


def _spin(node: Node) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (ExternalShutdownException, CancelledError):
        return


if __name__ == "__main__":
    sys.exit(main())
