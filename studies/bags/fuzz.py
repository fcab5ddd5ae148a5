"""Damaged bags by the thousands: ``python -m studies.bags.fuzz --inputs 10000``.

Small bags of every kind are damaged as ``mutated`` does, read and evaluated. Counted are
tracebacks, hangs, and what went unnoticed: events that the whole bag does not hold, or lacks,
without a word about it. Only a checksum can tell a changed byte within a message; of the kinds of
bags that have none such cases are counted apart.
"""

from __future__ import annotations

import json
import random
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.files.events import Event
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.roles import assign
from tqdm import tqdm

from cfnav_core.command import run_options
from studies.bags.bag_files import VARIANTS, drive

PATIENCE_S = 30
"""A bag of two seconds that takes longer hangs: whole it takes a tenth of a second."""

CHECKED = ("recorded", "mcap chunks", "mcap chunks lz4", "mcap chunks plain")
"""Kinds of bags whose chunks have checksums."""


@dataclass(frozen=True)
class FuzzConfig:
    """Read damaged bags."""

    inputs: int = 10_000
    """Mutations, the kinds of bags in turn; the number of each is its seed."""
    processes: int = 2
    """Side by side."""


class HangError(Exception):
    """Reading takes too long."""


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Damage as it happens: bytes flipped, overwritten, lost, put in twice, cut off."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 5])):
        at, length = rng.randrange(len(out)), rng.choice([1, 4, 8, 100, 1000])
        what = rng.randrange(5)
        if what == 0:
            out[at] ^= 1 << rng.randrange(8)
        elif what == 1:
            fill = rng.choice([b"\0", b"\xff", bytes([rng.randrange(256)])])
            out[at : at + length] = fill * len(out[at : at + length])
        elif what == 2:
            del out[at : at + length]
        elif what == 3:
            out[at:at] = out[at : at + length]
        else:
            del out[max(at, 1) :]
    return bytes(out)


def plain(event: Event) -> tuple:
    """An event as something that can be compared and hashed."""
    values = [type(event).__name__]
    for field in fields(event):
        value = getattr(event, field.name)
        if field.name == "decode":
            value = value().tobytes()
        elif isinstance(value, np.ndarray):
            value = (value.shape, value.tobytes())
        elif field.name == "scan":
            value = (value.ranges.tobytes(), value.angle_min, value.frame, value.scan_time)
        values.append(value)
    return tuple(values)


def read(path: Path) -> tuple[list[tuple], list[str]]:
    """All events of a bag, and what is said about it."""
    with Bag(path) as bag:
        events = [plain(event) for event in bag.events(assign(bag.topics))]
        return events, list(bag.notes)


@contextmanager
def _patience() -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise HangError

    signal.signal(signal.SIGALRM, stop)
    signal.alarm(PATIENCE_S)
    try:
        yield
    finally:
        signal.alarm(0)


@cache
def _whole(kind: str) -> tuple[Path, list[tuple]]:
    """A whole bag of a kind, and its events."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz"))
    path = VARIANTS[kind](folder / "bag", drive())
    events, _ = read(path)
    return path, events


def outcome(seed: int) -> tuple[str, str, str]:
    """Damage one bag: its kind, what became of it, and the error if there was one."""
    kind = list(VARIANTS)[seed % len(VARIANTS)]
    path, expected = _whole(kind)
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / path.name
        shutil.copytree(path, bag) if path.is_dir() else shutil.copy(path, bag)
        file = rng.choice(sorted(bag.iterdir())) if bag.is_dir() else bag
        file.write_bytes(mutated(file.read_bytes(), rng))
        try:
            with _patience():
                events, notes = read(bag)
                evaluate(bag, JudgeOptions())
        except HangError:
            return kind, "hang", f"seed {seed}"
        except Exception as error:
            return kind, "traceback", f"seed {seed}: {error!r}"
    if events == expected:
        return kind, "whole", ""
    if notes:
        return kind, "named", ""
    return kind, "unnoticed", f"seed {seed}"


def measure(config: FuzzConfig) -> dict[str, Any]:
    """Damage bags and count."""
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in VARIANTS}
    errors = []
    with get_context("spawn").Pool(config.processes) as pool:
        made = pool.imap_unordered(outcome, range(config.inputs), chunksize=20)
        for kind, became, error in tqdm(made, total=config.inputs, unit="bag"):
            counts[kind][became] += 1
            if became in ("hang", "traceback") or (became == "unnoticed" and kind in CHECKED):
                errors.append(f"{kind}, {error}")
    total = sum(counts.values(), Counter())
    return {
        "inputs": config.inputs,
        "tracebacks": total["traceback"],
        "hangs": total["hang"],
        "unnoticed_with_checksums": sum(counts[kind]["unnoticed"] for kind in CHECKED),
        "unnoticed_without": sum(counts[k]["unnoticed"] for k in VARIANTS if k not in CHECKED),
        "by_kind": {kind: dict(found) for kind, found in counts.items()},
        "errors": errors[:20],
    }


def main(config: FuzzConfig) -> None:
    """Measure and print."""
    print(json.dumps(measure(config), indent=1))


if __name__ == "__main__":
    sys.exit(run_options("fuzz", FuzzConfig, main))
