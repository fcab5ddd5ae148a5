"""A TurtleBot 4 that is not there: the process around ``mock_loop.Mock``.

Run it with ``cfnav node mock --ros-args -p room:=kitchen:21``; the
parameters are those of ``parameters.MockParameters``.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import rclpy
import rclpy.utilities
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

if TYPE_CHECKING:
    from sim_bridge.ros.mock_loop import Mock

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def main(args: list[str] | None = None) -> int:
    """Run the mock until SIGINT or SIGTERM.

    Args:
        args: the command line, the program first; that of the process when None.

    Returns:
        0 when it was told to end, 2 when it could not start.
    """
    _on_signal(_interrupt)
    try:
        return _run(sys.argv if args is None else args)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        rclpy.try_shutdown()


def _on_signal(act: Callable[[], object]) -> None:
    """Let the next signal act; those after it must not tear the clean-up in two."""

    def take(number: int, frame: object) -> None:
        for every in SIGNALS:
            signal.signal(every, signal.SIG_IGN)
        act()

    for number in SIGNALS:
        signal.signal(number, take)


def _interrupt() -> NoReturn:
    raise KeyboardInterrupt


@contextmanager
def _signals_wait() -> Iterator[None]:
    """Take signals when the block is over, in place of whatever it raises.

    A GL library whose import is torn in two prints tracebacks of its own, one that a signal
    killed seems to be missing, and ctypes calls an interrupt a wrong argument.
    """
    came: list[bool] = []
    _on_signal(partial(came.append, True))
    try:
        yield
    finally:
        _on_signal(_interrupt)
        if came:
            signal.raise_signal(signal.SIGTERM)


def _run(args: list[str]) -> int:
    """Start, then receive in one thread for each node and simulate in this one."""
    with ExitStack() as cleanup:
        try:
            _join_graph(args)
            with _signals_wait():
                # Here, because without a GL library this import fails with the sentence to print.
                from sim_bridge.ros.mock_loop import Mock

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
        # Between two steps, where no GL call is torn.
        _on_signal(partial(mock.abort, ExternalShutdownException()))
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
