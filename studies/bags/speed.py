"""How fast bags are read and replayed: ``python -m studies.bags.speed --bag out/demo/bag``.

Reading is timed beside the bare ``rosbags`` reader in turns, so that both meet the same load.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.roles import assign
from rosbags.highlevel import AnyReader

from cfnav_core.command import run_options


@dataclass(frozen=True)
class SpeedConfig:
    """Time reading and replay of one bag."""

    bag: Path = Path("out/demo/bag")
    """A recorded drive; make demo leaves one there."""
    rounds: int = 5
    """Times that each is done; the median counts."""


def measure(config: SpeedConfig) -> dict[str, Any]:
    """Time both.

    ``read_ratio_to_rosbags`` is of all raw messages, ``decode_ratio_to_rosbags`` of typed events
    beside the same messages deserialized by ``rosbags``.
    """
    seconds: dict[str, list[float]] = {}
    for _ in range(config.rounds):
        for name, work in WAYS.items():
            seconds.setdefault(name, []).append(_timed(work, config.bag))
    median = {name: statistics.median(times) for name, times in seconds.items()}
    recorded = evaluate(config.bag, JudgeOptions()).seconds
    return {
        "replay_real_time_factor": recorded / median["replay"],
        "read_ratio_to_rosbags": median["raw"] / median["rosbags raw"],
        "decode_ratio_to_rosbags": median["events"] / median["rosbags decoded"],
        "recorded_s": recorded,
        "seconds": median,
    }


def _timed(work: Callable[[Path], None], bag: Path) -> float:
    began = time.perf_counter()
    work(bag)
    return time.perf_counter() - began


def _raw(path: Path) -> None:
    with Bag(path) as bag:
        for _ in bag.messages():
            pass


def _events(path: Path) -> None:
    with Bag(path) as bag:
        for _ in bag.events(assign(bag.topics)):
            pass


def _rosbags_raw(path: Path) -> None:
    with AnyReader([path]) as reader:
        for _ in reader.messages():
            pass


def _rosbags_decoded(path: Path) -> None:
    with Bag(path) as bag:
        names = {topic.name for topic in assign(bag.topics).topics.values()}
    with AnyReader([path]) as reader:
        chosen = [c for c in reader.connections if c.topic in names]
        for connection, _, data in reader.messages(chosen):
            reader.deserialize(data, connection.msgtype)


def _replay(path: Path) -> None:
    evaluate(path, JudgeOptions(bundles={"shipped": ""}))


WAYS: dict[str, Callable[[Path], None]] = {
    "raw": _raw,
    "rosbags raw": _rosbags_raw,
    "events": _events,
    "rosbags decoded": _rosbags_decoded,
    "replay": _replay,
}


def main(config: SpeedConfig) -> None:
    """Measure and print."""
    print(measure(config))


if __name__ == "__main__":
    sys.exit(run_options("speed", SpeedConfig, main))
