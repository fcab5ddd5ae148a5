"""How well bags are read and judged: ``make bench-bag``, or ``python -m studies.bags.bench``.

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

from cfnav_core.command import run_options
from studies.parts import Part, measure_parts


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
        demo = [sys.executable, "-m", "cfnav.cli", "demo", "--out", str(config.bag.parent)]
        subprocess.run(demo, check=True)
    return config.bag


# Each part imports its own program, so that one that cannot run leaves the others whole.


def _speed(config: BagBenchConfig) -> dict[str, Any]:
    from studies.bags.speed import SpeedConfig, measure

    found = measure(SpeedConfig(_recorded(config)))
    keys = ("replay_real_time_factor", "read_ratio_to_rosbags", "decode_ratio_to_rosbags")
    return {**{key: found[key] for key in keys}, "speed": found}


def _memory(config: BagBenchConfig) -> dict[str, Any]:
    from studies.bags.memory import MemoryConfig, measure

    return {"memory": measure(MemoryConfig(_recorded(config)))}


def _agreement(config: BagBenchConfig) -> dict[str, Any]:
    from studies.bags.agreement import AgreementConfig, measure

    return measure(AgreementConfig(config.out / "drives.jsonl"))


def _fuzz() -> dict[str, Any]:
    from studies.bags.fuzz import FuzzConfig, measure

    return {"fuzz": measure(FuzzConfig())}


def measure(config: BagBenchConfig) -> dict[str, Any]:
    """Measure the parts and write ``bag.json`` after each; see ``measure_parts``."""
    parts: dict[str, Part] = {
        "speed": lambda: _speed(config),
        "memory": lambda: _memory(config),
        "agreement": lambda: _agreement(config),
        "fuzz": _fuzz,
    }
    return measure_parts(config.out / "bag.json", "studies.bags.bench", parts, config.only)


def main(config: BagBenchConfig) -> None:
    """Measure and print."""
    print(json.dumps(measure(config), indent=1))


if __name__ == "__main__":
    sys.exit(run_options("bench-bag", BagBenchConfig, main))
