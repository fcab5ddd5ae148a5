"""How well bags are read and judged: ``make bench-bag``, or ``python -m tests.bags.bench``.

Runs the measuring programs one after the other and writes ``bag.json``; parts that are left out
keep the figures of an earlier run. The machine's load stands beside what was measured.
"""

from __future__ import annotations

import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from cfnav_ros.demo import commit, run_to_exit
from cfnav_ros.processes import GraphError

from cfnav_core.json_file import write_json


@dataclass(frozen=True)
class BagBenchConfig:
    """Measure speed, agreement with what happened, and damaged bags."""

    out: Path = Path("out/bench")
    """Folder of the results."""
    bag: Path = Path("out/demo/bag")
    """A recorded demo drive, for the speed; it is driven when it is not there."""
    only: str = ""
    """Parts to measure, comma-separated: speed, agreement, fuzz; empty: all."""


def _speed(config: BagBenchConfig) -> dict[str, Any]:
    from tests.bags.speed import SpeedConfig, measure

    if not config.bag.exists():
        demo = [sys.executable, "-m", "cfnav_ros.demo", "--out", str(config.bag.parent)]
        subprocess.run(demo, check=True)
    found = measure(SpeedConfig(config.bag))
    keys = ("replay_real_time_factor", "read_ratio_to_rosbags", "decode_ratio_to_rosbags")
    return {**{key: found[key] for key in keys}, "speed": found}


def _agreement(config: BagBenchConfig) -> dict[str, Any]:
    from tests.bags.agreement import AgreementConfig, measure

    return measure(AgreementConfig(config.out / "drives.jsonl"))


def _fuzz(_: BagBenchConfig) -> dict[str, Any]:
    from tests.bags.fuzz import FuzzConfig, measure

    return {"fuzz": measure(FuzzConfig())}


# Each part imports its own program, so that one that cannot run leaves the others whole.
PARTS: dict[str, Callable[[BagBenchConfig], dict[str, Any]]] = {
    "speed": _speed,
    "agreement": _agreement,
    "fuzz": _fuzz,
}


def measure(config: BagBenchConfig) -> dict[str, Any]:
    """Measure the parts and write the results after each.

    Raises:
        GraphError: a part that does not exist, or could not be measured.
    """
    names = [word.strip() for word in config.only.split(",") if word.strip()] or list(PARTS)
    if unknown := [name for name in names if name not in PARTS]:
        raise GraphError(f"--only names {unknown[0]!r}, expected parts of {', '.join(PARTS)}")
    path = config.out / "bag.json"
    found: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    for name in names:
        load = os.getloadavg()[0]
        found |= PARTS[name](config)
        found.setdefault("measured", {})[name] = {
            "commit": commit(),
            "command": shlex.join(["python", "-m", "tests.bags.bench", *sys.argv[1:]]),
            "load_before": round(load, 2),
            "load_after": round(os.getloadavg()[0], 2),
            "cores": os.cpu_count(),
            "machine": platform.machine(),
        }
        write_json(path, found)
    return found


def main() -> None:
    """Run the command line: 0 when all was measured, 1 when not, 130 on Ctrl-C."""
    config = tyro.cli(BagBenchConfig, prog="bench-bag")
    found = run_to_exit("bench-bag", lambda: measure(config))
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
