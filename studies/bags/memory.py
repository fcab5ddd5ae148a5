"""Does a long bag need more memory? ``python -m studies.bags.memory --bag out/demo/bag``.

A recorded drive is written several times one after the other into one bag, every stamp moved on,
and both the single and the long bag are evaluated by the command line, replay included.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from cfnav_ros.bags.files.writer import BagWriter
from cfnav_ros.process.processes import GraphError
from rosbags.typesys.stores.ros2_jazzy import builtin_interfaces__msg__Time as Time

from cfnav_core.command import run_options
from studies.bags.bag_files import STORE, S

PAUSE_NS = S
"""Between two copies."""


@dataclass(frozen=True)
class MemoryConfig:
    """Evaluate a bag and the same drive repeated."""

    bag: Path = Path("out/demo/bag")
    """A recorded drive; make demo leaves one there."""
    times: int = 6
    """How often the long bag holds it."""


def measure(config: MemoryConfig) -> dict[str, Any]:
    """Largest resident memory of both evaluations, and what an hour more costs.

    Raises:
        GraphError: an evaluation failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        short_mb, seconds, _ = _evaluated(config.bag, Path(folder) / "short")
        bag = repeated(config.bag, Path(folder) / "bag", config.times)
        size = sum(file.stat().st_size for file in bag.iterdir())
        long_mb, long_seconds, drives = _evaluated(bag, Path(folder) / "long")
    return {
        "recorded_s": [round(seconds, 1), round(long_seconds, 1)],
        "peak_mb": [round(short_mb, 1), round(long_mb, 1)],
        "mb_per_recorded_hour": round((long_mb - short_mb) / (long_seconds - seconds) * 3600, 1),
        "drives": drives,
        "long_bag_mb": round(size / 1e6),
    }


def repeated(bag: Path, path: Path, times: int) -> Path:
    """Write a bag that holds another one several times."""
    from rosbags.highlevel import AnyReader

    with AnyReader([bag], default_typestore=STORE) as reader:
        writer = BagWriter(path, STORE)
        for connection in reader.connections:
            writer.add_topic(connection.topic, connection.msgtype)
        for n in range(times):
            shift = n * (reader.duration + PAUSE_NS)
            for connection, log_ns, data in reader.messages():
                if shift:
                    message = moved(reader.deserialize(data, connection.msgtype), shift)
                    data = bytes(STORE.serialize_cdr(message, connection.msgtype))
                writer.write(connection.topic, log_ns + shift, data)
        writer.close()
    return path


def moved(value: Any, shift: int) -> Any:
    """A message with all its stamps ``shift`` nanoseconds later; a zero stamp says nothing."""
    if isinstance(value, list):
        return [moved(item, shift) for item in value]
    if not is_dataclass(value) or isinstance(value, type):
        return value
    if isinstance(value, Time):
        ns = value.sec * S + value.nanosec
        ns += shift if ns else 0
        return replace(value, sec=ns // S, nanosec=ns % S)
    inner = {
        spec.name: moved(getattr(value, spec.name), shift)
        for spec in fields(value)
        if spec.name != "__msgtype__"
    }
    return replace(value, **inner)


def _evaluated(bag: Path, out: Path) -> tuple[float, float, int]:
    """Largest resident memory (MB), recorded seconds and drives of an evaluation."""
    command = [sys.executable, "-m", "cfnav.cli", "bag", "eval", str(bag), "--jobs", "1"]
    with subprocess.Popen([*command, "--out", str(out)], stdout=subprocess.DEVNULL) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise GraphError(f"{' '.join(command)} ended with code {process.returncode}, expected 0")
    found = json.loads((out / "metrics.json").read_text())
    return used.ru_maxrss / 1024, found["bags"][0]["seconds"], len(found["drives"])


def main(config: MemoryConfig) -> None:
    """Measure and print."""
    print(json.dumps(measure(config), indent=1))


if __name__ == "__main__":
    sys.exit(run_options("memory", MemoryConfig, main))
