"""How well bags are read and judged: ``make bench-bag``, or ``python -m tests.bags.bench``.

Runs the measuring programs one after the other and writes ``bag.json``; parts that are left out
keep the figures of an earlier run. The machine's load stands beside what was measured.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from cfnav_ros.demo import run_to_exit

from tests.parts import Part, measure_parts


@dataclass(frozen=True)
class BagBenchConfig:
    """Measure speed, memory, agreement with what happened, and damaged bags."""

    out: Path = Path("out/bench")
    """Folder of the results."""
    bag: Path = Path("out/demo/bag")
    """A recorded demo drive, for the speed; it is driven when it is not there."""
    only: str = ""
    """Parts to measure, comma-separated: speed, memory, agreement, fuzz; empty: all."""


def _recorded(config: BagBenchConfig) -> Path:
    if not config.bag.exists():
        demo = [sys.executable, "-m", "cfnav_ros.demo", "--out", str(config.bag.parent)]
        subprocess.run(demo, check=True)
    return config.bag


# Each part imports its own program, so that one that cannot run leaves the others whole.


def _speed(config: BagBenchConfig) -> dict[str, Any]:
    from tests.bags.speed import SpeedConfig, measure

    found = measure(SpeedConfig(_recorded(config)))
    keys = ("replay_real_time_factor", "read_ratio_to_rosbags", "decode_ratio_to_rosbags")
    return {**{key: found[key] for key in keys}, "speed": found}


def _memory(config: BagBenchConfig) -> dict[str, Any]:
    from tests.bags.memory import MemoryConfig, measure

    return {"memory": measure(MemoryConfig(_recorded(config)))}


def _agreement(config: BagBenchConfig) -> dict[str, Any]:
    from tests.bags.agreement import AgreementConfig, measure

    return measure(AgreementConfig(config.out / "drives.jsonl"))


def _fuzz() -> dict[str, Any]:
    from tests.bags.fuzz import FuzzConfig, measure

    return {"fuzz": measure(FuzzConfig())}


def measure(config: BagBenchConfig) -> dict[str, Any]:
    """Measure the parts and write ``bag.json`` after each; see ``measure_parts``."""
    parts: dict[str, Part] = {
        "speed": lambda: _speed(config),
        "memory": lambda: _memory(config),
        "agreement": lambda: _agreement(config),
        "fuzz": _fuzz,
    }
    return measure_parts(config.out / "bag.json", "tests.bags.bench", parts, config.only)


def main() -> None:
    """Run the command line: 0 when all was measured, 1 when not, 130 on Ctrl-C."""
    config = tyro.cli(BagBenchConfig, prog="bench-bag")
    found = run_to_exit("bench-bag", lambda: measure(config))
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
