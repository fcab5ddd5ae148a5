"""The live graph, measured: ``python -m studies.bench.live --out out/bench``.

Drives episodes over the real graph, at real time and then as fast as the machine can, listens
from a process of its own, prints a table and writes ``live.json``. It judges nothing: the figures
are those of this machine at this moment, and its load stands beside them.
"""

from __future__ import annotations

import os
import platform
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cfnav_interfaces.msg import PolicyDecision
from cfnav_ros.drive import fields
from cfnav_ros.live.demo import DemoConfig, known_goals, plan
from cfnav_ros.live.plan import Trial, parse_list
from cfnav_ros.process.graph_config import GraphConfig
from cfnav_ros.process.processes import GraphError
from cfnav_ros.ros.graph import RosGraph
from cfnav_ros.ros.spinning import SpinningThread
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, LaserScan

from cfnav_core.command import run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.provenance import commit
from cfnav_core.policy.bundle import BundleHead, find_bundle
from cfnav_core.robot.topics import TOPICS
from studies.bench.live_figures import (
    NOMINAL_HZ,
    Heard,
    HeardDecision,
    HeardEpisode,
    figures,
    spans_s,
    stamp_ns,
    table,
)

HEAR_S = 30.0
"""Patience with messages that must come, real seconds."""

MAX_FAILED = 3
"""Drives in a row that the graph may fail to hold before no more are tried."""

MAX_REFUSED = 100
"""Goals without a start far enough away that may be passed over."""

CLOCK = TOPICS["clock"].name
SENSORS = {
    "camera_hz": (Image, TOPICS["image"].name),
    "scan_hz": (LaserScan, TOPICS["scan"].name),
    "odom_hz": (Odometry, TOPICS["odom"].name),
}

# As the policy node listens: what the transport loses is not sent again. Deep, so that a listener
# that waits for its turn loses nothing of its own.
_SENSOR_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


@dataclass(frozen=True)
class BenchConfig:
    """Measure rates, delays, losses and the speed of the live ROS 2 graph on this machine."""

    out: Path = Path("out/bench")
    """Folder of the results: live.json, and the logs of the nodes."""
    seconds: float = 120.0
    """Least driving time at speed 1, real seconds."""
    fast_seconds: float = 30.0
    """Least driving time at speed 0, real seconds."""
    room: str = "kitchen:25,living_room:22"
    """Rooms to drive in, comma-separated, each <type>:<seed>."""
    seed: int = 1
    """Draws goals and start poses."""
    max_steps: int = 20
    """Most decisions of one drive."""
    bundle: Path | None = None
    """Bundle that drives, a folder or the name of a shipped one; the default when not given."""
    domain: int | None = None
    """ROS domain; one that is free when not given."""

    def check(self) -> None:
        """Raise GraphError for values that make no sense."""
        if not parse_list(self.room):
            raise GraphError("--room is empty; expected rooms such as kitchen:25")
        for name in ("seconds", "fast_seconds", "max_steps"):
            if not getattr(self, name) > 0:
                raise GraphError(f"--{name.replace('_', '-')} is {getattr(self, name)}; "
                                 "expected more than 0")  # fmt: skip


class Listener:
    """A node with its own thread that notes when each message came; use as a context manager."""

    def __init__(self, context: Context) -> None:
        """Subscribe.

        Args:
            context: an initialised rclpy context; the caller shuts it down afterwards.
        """
        self._heard: dict[str, list[Heard]] = {CLOCK: []}
        self._decisions: list[HeardDecision] = []
        self._node = Node("bench", context=context)
        self._note(CLOCK, Clock, CLOCK, QoSProfile(depth=100))
        for name, (kind, topic) in SENSORS.items():
            self._note(name, kind, topic, _SENSOR_QOS)
        self._node.create_subscription(PolicyDecision, "policy/decision", self._on_decision, 50)
        self._thread = SpinningThread(self._node)

    def __enter__(self) -> Listener:
        """Begin to listen."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop listening."""
        self._thread.end()
        self._node.destroy_node()

    @property
    def hears_all(self) -> bool:
        """Whether every topic that always has messages was heard."""
        return all(self._heard.values())

    def decisions(self, begin: float) -> tuple[HeardDecision, ...]:
        """Return the decisions that arrived since a moment of the steady clock."""
        return tuple(d for d in list(self._decisions) if d.arrived >= begin)

    def messages(self, name: str, begin: float, end: float) -> tuple[Heard, ...]:
        """Return what arrived between two moments on a sensor or the clock."""
        return tuple(h for h in list(self._heard[name]) if begin <= h.arrived <= end)

    def _note(self, name: str, kind: type, topic: str, qos: QoSProfile) -> None:
        heard: list[Heard] = []
        self._heard[name] = heard

        def note(cdr: bytes) -> None:
            heard.append(Heard(time.monotonic(), stamp_ns(cdr)))

        self._node.create_subscription(
            kind,
            topic,
            note,
            qos,
            # Decoding, and handlers of events that nobody reads, would load what is measured.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )

    def _on_decision(self, message: PolicyDecision) -> None:
        arrived = time.monotonic()
        decided = fields.stamp_to_ns(message.header.stamp)
        image = fields.stamp_to_ns(message.image_stamp)
        self._decisions.append(HeardDecision(arrived, decided, image))


def wait_for(graph: RosGraph, condition: Callable[[], bool], what: str) -> None:
    """Wait for a condition while the graph runs.

    Raises:
        GraphError: a node ended, or the condition did not come true in time.
    """
    end = time.monotonic() + HEAR_S
    while not condition():
        graph.check()
        if time.monotonic() > end:
            raise GraphError(f"the bench did not hear {what} within {HEAR_S:.0f} s")
        time.sleep(0.02)


def drive(graph: RosGraph, listener: Listener, trial: Trial, max_steps: int) -> HeardEpisode:
    """Drive one episode whose start was set, and return what was heard of it.

    A drive that ends because the graph cannot keep up is a measurement too.

    Raises:
        GraphError: a node failed, or the decisions were not heard.
    """
    begin = time.monotonic()
    result = graph.navigate(trial.goal, max_steps)
    end = time.monotonic()
    wait_for(graph, lambda: len(listener.decisions(begin)) >= result.steps, "every decision")
    graph.end_episode()
    return HeardEpisode(
        room=trial.room,
        goal=trial.goal,
        speed=graph.config.speed,
        outcome=result.outcome,
        message=result.message,
        clock=listener.messages(CLOCK, begin, end),
        sensors={name: listener.messages(name, begin, end) for name in NOMINAL_HZ},
        decisions=listener.decisions(begin),
    )


def measure(config: BenchConfig, speed: float, seconds: float) -> list[HeardEpisode]:
    """Start the graph at a speed and drive for at least so many real seconds.

    Raises:
        BundleError: the bundle cannot be used.
        GraphError: the graph did not run.
    """
    trials_of = DemoConfig(room=config.room, seed=config.seed, bundle=config.bundle)
    known = known_goals(trials_of)
    graph_config = GraphConfig(
        room=parse_list(config.room)[0],
        room_type=trials_of.room_type,
        logs=config.out / "logs" / f"speed{speed:g}",
        speed=speed,
        bundle=config.bundle,
        domain=config.domain,
    )
    drives: list[HeardEpisode] = []
    refused, failed, driven_s = 0, 0, 0.0
    print(f"speed {speed:g}: starting the graph, logs in {graph_config.logs}", flush=True)
    with RosGraph(graph_config) as graph, Listener(graph.context) as listener:
        wait_for(graph, lambda: listener.hears_all, "clock, camera, scan and odometry")
        print(f"speed {speed:g}: driving in ROS domain {graph.domain}", flush=True)
        trials, _ = plan(graph, trials_of, known)
        while driven_s < seconds and failed < MAX_FAILED:
            trial = next(trials)
            start = graph.start_episode(trial.room, trial.goal, trial.seed)
            if not start.ok:
                refused += 1
                if refused > MAX_REFUSED:
                    raise GraphError(start.message)
                continue
            drives.append(last := drive(graph, listener, trial, config.max_steps))
            failed = 0 if last.held else failed + 1
            driven_s += spans_s(last)[1]
            why = "" if last.held else f" ({last.message})"
            print(
                f"  {trial.room} {trial.goal}: {last.outcome}{why}, {driven_s:.0f} s driven",
                flush=True,
            )
    return drives


def machine_load() -> dict[str, Any]:
    """Return the 1-minute load average now, the cores this process may use, and their model."""
    names = [
        line.partition(":")[2].strip()
        for line in Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    return {
        "average_1min": round(os.getloadavg()[0], 2),
        "cores": len(os.sched_getaffinity(0)),
        "cpu": names[0] if names else platform.machine(),
    }


def run_bench(config: BenchConfig, arguments: Sequence[str]) -> dict[str, Any]:
    """Measure, write ``live.json`` and return its content.

    Args:
        config: what to run.
        arguments: the command line, kept beside the figures.

    Raises:
        BundleError: the bundle cannot be used.
        GraphError: the graph did not run.
        OSError: the results cannot be written.
    """
    config.check()
    load = machine_load()
    head = BundleHead.load(find_bundle(config.bundle))
    real_time = measure(config, 1.0, config.seconds)
    fast = measure(config, 0.0, config.fast_seconds)
    try:
        measured = figures(real_time, fast)
    except ValueError as error:
        raise GraphError(f"too little was heard to measure: {error}") from None
    report = {
        **measured,
        "load": load,
        "bundle": head.name,
        "commit": commit(),
        "command": shlex.join(["python", "-m", "studies.bench.live", *arguments]),
    }
    write_json(config.out / "live.json", report)
    return report


def main(config: BenchConfig) -> None:
    """Measure and print."""
    report = run_bench(config, sys.argv[1:])
    print(f"\n{table(report)}\n\nfigures in {config.out / 'live.json'}")


if __name__ == "__main__":
    sys.exit(run_options("bench", BenchConfig, main))
