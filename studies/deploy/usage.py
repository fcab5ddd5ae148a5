"""What the nodes cost: ``python -m studies.deploy.usage --out out/bench``.

CPU of each node at real time, idle and while driving, and its memory over half an hour of goals in
simulated time, which passes as fast as the machine can.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cfnav_interfaces.msg import GroundTruth
from cfnav_ros.drive.fields import stamp_to_seconds
from cfnav_ros.process.graph_config import GraphConfig
from cfnav_ros.process.processes import GraphError
from cfnav_ros.ros.graph import RosGraph

from cfnav_core.command import run_options
from cfnav_core.files.json_file import write_json

SAMPLE_S = 3.0
"""Real seconds between two looks at the memory."""

WARM_UP = 0.2
"""Share of the samples before the slope is fitted: caches and allocators fill."""

MAX_STEPS = 20
"""Decisions of one goal."""

TICKS = os.sysconf("SC_CLK_TCK")
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


@dataclass(frozen=True)
class UsageConfig:
    """Measure CPU and memory of the nodes."""

    out: Path = Path("out/bench")
    """Folder of the results: usage.json, and the logs of the nodes."""
    room: str = "kitchen:25"
    """Room to drive in."""
    seconds: float = 60.0
    """Real seconds of idling and of driving at speed 1, each."""
    minutes: float = 30.0
    """Simulated minutes of goals over which the memory is watched."""


class MemoryLog:
    """Notes resident memory of processes every few seconds; use as a context manager."""

    def __init__(self, pids: Mapping[str, int], now: Callable[[], float]) -> None:
        """Only remember what to watch; ``now`` gives simulated seconds."""
        self._pids, self._now = pids, now
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="memory")
        self.times_s: list[float] = []
        self.rss_mb: dict[str, list[float]] = {name: [] for name in pids}

    def __enter__(self) -> MemoryLog:
        """Begin."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._over.wait(SAMPLE_S):
            self.times_s.append(self._now())
            for name, pid in self._pids.items():
                pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
                self.rss_mb[name].append(pages * PAGE_MB)

    def slopes(self) -> dict[str, float]:
        """Growth of each process after the warm-up, MB per simulated hour."""
        begin = int(WARM_UP * len(self.times_s))
        hours = np.array(self.times_s[begin:]) / 3600
        return {
            name: round(float(np.polyfit(hours, values[begin : len(self.times_s)], 1)[0]), 2)
            for name, values in self.rss_mb.items()
        }


def cpu_s(pids: Mapping[str, int]) -> dict[str, float]:
    """CPU seconds that each process has used, user and system."""
    used = {}
    for name, pid in pids.items():
        # The name in brackets may hold blanks: what is counted comes after it.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        used[name] = (int(fields[11]) + int(fields[12])) / TICKS
    return used


def cpu_share(pids: Mapping[str, int], busy: Callable[[], None]) -> dict[str, float]:
    """Share of a core that each process uses while ``busy`` runs."""
    before, began = cpu_s(pids), time.monotonic()
    busy()
    took = time.monotonic() - began
    return {name: round((used - before[name]) / took, 3) for name, used in cpu_s(pids).items()}


class _Drive:
    """Goals of one room in turn, each from another start."""

    def __init__(self, graph: RosGraph, room: str) -> None:
        self.graph, self.room = graph, room
        self.now = 0.0
        self.goals_sought = 0
        self.decisions, self.metres = 0, 0.0
        graph.node.create_subscription(GroundTruth, "ground_truth/state", self._on_truth, 10)
        self._goals: Sequence[str] = graph.start_episode(room, "none", 0).goals
        if not self._goals:
            raise GraphError(f"{room} names no goals")

    def _on_truth(self, message: GroundTruth) -> None:
        self.now = stamp_to_seconds(message.header.stamp)

    def seek(self, until: Callable[[], bool]) -> None:
        """Seek goals until a condition holds.

        Raises:
            GraphError: a goal was refused, so that nothing drives.
        """
        while not until():
            goal = self._goals[self.goals_sought % len(self._goals)]
            if self.graph.start_episode(self.room, goal, self.goals_sought).ok:
                result = self.graph.navigate(goal, MAX_STEPS)
                if result.outcome == "refused":
                    raise GraphError(f"policy_node refused the goal {goal!r}: {result.message}")
                self.decisions += result.steps
                self.metres += self.graph.end_episode().path_length
            self.goals_sought += 1

    @property
    def driven(self) -> dict[str, float]:
        """What was done, so that nobody takes the cost of standing for that of driving."""
        return {
            "goals": self.goals_sought,
            "decisions": self.decisions,
            "metres": round(self.metres, 2),
        }

    def rest(self, until: Callable[[], bool]) -> None:
        """Do nothing but receive until a condition holds."""
        while not until():
            self.graph.receive()


def _after(seconds: float) -> Callable[[], bool]:
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def measure(config: UsageConfig) -> dict[str, Any]:
    """Drive, write the results and return the figures.

    Raises:
        GraphError: the graph did not run.
    """
    shares: dict[str, dict[str, float]] = {}
    with RosGraph(GraphConfig(config.room, config.out / "logs" / "usage", speed=1.0)) as graph:
        pids = {name: child.pid for name, child in graph.children.items()}
        drive = _Drive(graph, config.room)
        shares["idle"] = cpu_share(pids, lambda: drive.rest(_after(config.seconds)))
        shares["driving"] = cpu_share(pids, lambda: drive.seek(_after(config.seconds)))
        done = {"cpu_share": drive.driven}
    with RosGraph(GraphConfig(config.room, config.out / "logs" / "memory", speed=0.0)) as graph:
        pids = {name: child.pid for name, child in graph.children.items()}
        drive = _Drive(graph, config.room)
        with MemoryLog(pids, lambda: drive.now) as memory:
            drive.seek(lambda: drive.now > 60 * config.minutes)
    found = {
        "cpu_share": shares,
        "rss_slope_mb_per_h": memory.slopes(),
        "rss_mb": {name: round(values[-1], 1) for name, values in memory.rss_mb.items()},
        "simulated_minutes": config.minutes,
        "driven": {**done, "rss": drive.driven},
    }
    samples = {"times_s": memory.times_s, "rss_mb": memory.rss_mb}
    write_json(config.out / "usage.json", {**found, "samples": samples})
    return found


def main(config: UsageConfig) -> None:
    """Measure and print."""
    for name, values in measure(config).items():
        print(name, values)


if __name__ == "__main__":
    sys.exit(run_options("usage", UsageConfig, main))
