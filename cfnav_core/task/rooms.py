"""Room names on command lines: ``kitchen:7``, ``kitchen:0-19``, ``data2:train``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import MappingProxyType

from cfnav_core.task.vocabulary import ROOM_TYPES

SPLIT_NAMES = ("train", "validation", "test")

SPLITS: Mapping[str, Mapping[str, Sequence[int]]] = MappingProxyType({
    "data1": {"train": range(20), "validation": range(20, 30, 2), "test": range(21, 30, 2)},
    # published with 0-19 for training and nothing to choose a checkpoint by
    "data2": {"train": range(18), "validation": range(18, 20), "test": range(20, 30)},
})  # fmt: skip
"""Seeds of each type's rooms, as Offline Data 1 and 2 split theirs (FloorPlan numbers from 0).

What validates in one is tested in the other: never use both in one run.
"""


def parse_room(text: str) -> tuple[str, int]:
    """Read ``type:seed``.

    Raises:
        ValueError: the text is not a known type, a colon and a whole number.
    """
    kind, _, seed = text.partition(":")
    if kind not in ROOM_TYPES or not seed.isdecimal():
        raise ValueError(
            f"found room {text!r}; expected TYPE:SEED with a type of {', '.join(ROOM_TYPES)} "
            "and a whole number, for example kitchen:21"
        )
    return kind, int(seed)


def parse_rooms(texts: Iterable[str]) -> list[tuple[str, int]]:
    """Read any number of ``type:seed``, ``type:first-last``, ``data2:train`` and ``data2``.

    Returns:
        Type and seed of each room, in order, none twice.

    Raises:
        ValueError: one is none of these, with what was expected.
    """
    return list(dict.fromkeys(room for text in texts for room in _rooms(text)))


def _rooms(text: str) -> list[tuple[str, int]]:
    name, _, rest = text.partition(":")
    if text in SPLITS or rest in SPLITS.get(name, ()):
        seeds = SPLITS[name][rest] if rest else sorted(chain(*SPLITS[name].values()))
        return [(kind, seed) for kind in ROOM_TYPES for seed in seeds]
    first, dash, last = rest.partition("-")
    last = last if dash else first
    if name not in ROOM_TYPES or not (first.isdecimal() and last.isdecimal()):
        splits = (f"{layout}:{split}" for layout, row in SPLITS.items() for split in row)
        raise ValueError(
            f"found rooms {text!r}; expected TYPE:SEED or TYPE:FIRST-LAST with a type of "
            f"{', '.join(ROOM_TYPES)}, or one of {', '.join((*SPLITS, *splits))}"
        )
    if int(last) < int(first):
        raise ValueError(f"found rooms {text!r}; expected the smaller seed first")
    return [(name, seed) for seed in range(int(first), int(last) + 1)]


def split_of(name: str, seed: int) -> str:
    """Split that a row of ``SPLITS`` puts a seed into; empty when it has no such seed."""
    return next((split for split, seeds in SPLITS[name].items() if seed in seeds), "")


def room_folder(folder: Path, kind: str, seed: int) -> Path:
    """Where a room's data lies in a folder of rooms."""
    return folder / f"{kind}_{seed:05d}"


def rooms_in(folder: Path) -> list[tuple[str, int]]:
    """Rooms whose finished scenes lie in a folder, in the order of its sub-folders."""
    found = (p.parent.name.rpartition("_") for p in sorted(folder.glob("*_[0-9]*/scene.json")))
    return [(kind, int(seed)) for kind, _, seed in found if kind in ROOM_TYPES and seed.isdecimal()]
