"""Damaged bags by the thousands: ``python -m tests.bags.fuzz --inputs 10000``.

Small bags of every kind are damaged as ``damage.mutated`` does, read and evaluated. Counted are
tracebacks, hangs, and what went unnoticed: events that the whole bag does not hold, or lacks,
without a word about it. Only a checksum can tell a changed byte within a message; of the kinds of
bags that have none such cases are counted apart.
"""

from __future__ import annotations

import json
import random
import shutil
import signal
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import tyro
from cfnav_ros.bags.evaluation import Options, evaluate
from tqdm import tqdm

from tests.bags.bag_files import VARIANTS, drive
from tests.bags.damage import mutated
from tests.bags.plain_events import read

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
                evaluate(bag, Options())
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


if __name__ == "__main__":
    print(json.dumps(measure(tyro.cli(FuzzConfig, prog="fuzz")), indent=1))
