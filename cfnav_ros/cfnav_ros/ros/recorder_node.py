"""Records a drive of a robot into an MCAP bag until it is told to end.

Run it with ``cfnav node recorder --ros-args -p bag:=FOLDER``. What it
records are the topics of its robot; the demo and the trials record through
the same class without this process.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from cfnav_core.robot.robot import robot_setting
from cfnav_core.robot.settings import setting
from cfnav_ros.process.stop_signal import StopSignal
from cfnav_ros.ros.parameters import declare, named_robot
from cfnav_ros.ros.recorder import NODE_NAME, Recorder

PATIENCE_S = 5.0
"""Recorded before topics are named that somebody publishes and that are not heard."""

LINGER_S = 1.0
"""Recorded after the signal: under launch the policy node gets it too, and ends in zeros."""


@dataclass(frozen=True)
class RecorderParameters:
    """Parameters of the recorder; with ``use_sim_time`` its log times are those of ``/clock``."""

    bag: str = setting("", "folder of the bag to be made")
    robot: str = robot_setting()


def main(args: list[str] | None = None) -> int:
    """Record until SIGINT or SIGTERM, then give the bag its name.

    Returns:
        0 when the bag is whole, 1 when it could not be written, 2 when it could not be begun.
    """
    stop = StopSignal()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        recorder = _begin()
    except (ValueError, RuntimeError, OSError) as error:
        print(f"{NODE_NAME}: {error}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    try:
        heard: set[str] = set()
        told, begun = False, time.monotonic()
        while not stop:
            time.sleep(0.1)
            for topic in sorted(set(recorder.counts) - heard):
                heard.add(topic)
                print(f"recording {topic}", flush=True)
            if not told and time.monotonic() - begun > PATIENCE_S:
                told = True
                for sentence in recorder.unheard():
                    print(sentence, flush=True)
        time.sleep(LINGER_S)
        total = recorder.counts.total()
        recorder.close()
    except Exception as error:
        print(f"{NODE_NAME}: the bag could not be written: {error}", file=sys.stderr)
        print(f"{NODE_NAME}: what was recorded before is in {recorder.leave()}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
        stop.ignore()
    print(f"{total} messages recorded", flush=True)
    return 0


def _begin() -> Recorder:
    node = Node(NODE_NAME, automatically_declare_parameters_from_overrides=True)
    try:
        robot = named_robot(node) if node.has_parameter("robot") else None
        settings = declare(node, RecorderParameters())
        simulated = node.get_parameter("use_sim_time").value
    finally:
        node.destroy_node()
    if not settings.bag:
        raise ValueError("no bag is named, expected -p bag:=FOLDER.")
    context, bag = rclpy.get_default_context(), Path(settings.bag)
    recorder = Recorder(bag, context, not simulated, robot)
    print(f"recording to {bag}", flush=True)
    return recorder


if __name__ == "__main__":
    sys.exit(main())
