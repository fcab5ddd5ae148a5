"""A TurtleBot 4 that is not there: the process around ``mock_node.Mock``.

Run it with ``python -m sim_bridge.mock_turtlebot4 --ros-args -p room:=kitchen:21``; the parameters
are those of ``parameters.MockParameters``.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import rclpy
import rclpy.utilities
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

if TYPE_CHECKING:
    from sim_bridge.mock_node import Mock


def main(args: list[str] | None = None) -> int:
    """Run the mock until SIGINT or SIGTERM.

    Args:
        args: the command line, the program first; that of the process when None.

    Returns:
        0 when it was told to end, 2 when it could not start.
    """
    signal.signal(signal.SIGINT, _end)
    signal.signal(signal.SIGTERM, _end)
    try:
        return _run(sys.argv if args is None else args)
    except KeyboardInterrupt:
        return 0
    finally:
        rclpy.try_shutdown()


def _end(number: int, frame: object) -> None:
    # A second signal must not tear the clean-up in two.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


@contextmanager
def _signals_wait() -> Iterator[None]:
    """Take signals when the block is over, in place of whatever it raises.

    A GL library whose import is torn in two prints tracebacks of its own, and one that a signal
    killed seems to be missing.
    """
    came: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, _end)
        signal.signal(signal.SIGTERM, _end)
        if came:
            _end(came[0], None)


def _run(args: list[str]) -> int:
    """Start, then receive in one thread for each node and simulate in this one."""
    with ExitStack() as cleanup:
        try:
            _join_graph(args)
            # Here, because without a GL library this import fails with the sentence to print.
            with _signals_wait():
                from sim_bridge.mock_node import Mock
            mock = Mock()
            cleanup.callback(mock.close)
            mock.set_up()
        except (ValueError, ImportError) as error:
            print(f"mock_turtlebot4: {error}", file=sys.stderr)
            return 2
        spinners = [threading.Thread(target=_spin, args=(node, mock)) for node in mock.nodes]
        cleanup.callback(_stop, spinners, mock)
        for spinner in spinners:
            spinner.start()
        print(f"mock_turtlebot4 ready: {mock.summary}", flush=True)
        mock.run()


def _join_graph(args: list[str]) -> None:
    """Initialise ROS; raises ValueError for a command line that makes no sense."""
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise ValueError(f"the command line cannot be read: {error}") from error
    other = rclpy.utilities.remove_ros_args(args)[1:]
    if other:
        raise ValueError(
            f"argument {other[0]} is unknown; parameters are given as --ros-args -p name:=value."
        )


def _spin(node: Node, mock: Mock) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (ExternalShutdownException, CancelledError):
        return
    except Exception as error:
        mock.abort(error)


def _stop(spinners: list[threading.Thread], mock: Mock) -> None:
    rclpy.try_shutdown()
    for spinner in spinners:
        while spinner.is_alive():
            mock.refuse_requests()
            spinner.join(timeout=0.05)


if __name__ == "__main__":
    sys.exit(main())
