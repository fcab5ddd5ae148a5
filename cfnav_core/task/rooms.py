"""Room names on command lines: ``kitchen:7``, ``sweet_home.kitchen:0-19``, ``data2:train``.

A room's kind is its type, such as kitchen, after a dot behind the furniture that it has, unless
that is our own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import MappingProxyType

from cfnav_core.task.vocabulary import ROOM_TYPES

BUILT_IN, SWEET_HOME, CC0, VARIED = "built_in", "sweet_home", "cc0", "varied"
FURNITURE = (BUILT_IN, SWEET_HOME, CC0, VARIED)
"""Our own furniture, the models of the Debian package sweethome3d-furniture, those few of them that
are in the public domain and come with cfnav, and the package's in other paint and proportions."""

KINDS = (*ROOM_TYPES, *(f"{name}.{kind}" for name in FURNITURE[1:] for kind in ROOM_TYPES))
"""Every kind of room that can be made."""

SPLIT_NAMES = ("train", "validation", "test")

SPLITS: Mapping[str, Mapping[str, Sequence[int]]] = MappingProxyType({
    "data1": {"train": range(20), "validation": range(20, 30, 2), "test": range(21, 30, 2)},
    # published with 0-19 for training and nothing to choose a checkpoint by
    "data2": {"train": range(18), "validation": range(18, 20), "test": range(20, 30)},
    "worlds": {"train": range(100, 225), "validation": range(230, 235), "test": range(300, 325)},
})  # fmt: skip
"""Seeds of each type's rooms. Offline Data 1 and 2 split theirs so (FloorPlan numbers from 0): what
validates in one is tested in the other, so never use both in one run. "worlds" are 500 rooms of
each furniture to train in and 100 sealed ones to test in, where models of furniture stand, of those
kinds of which there are enough, that no other room has.
"""

FIRST_OF_PERCEPTION = 1000
"""Seeds from here on are of rooms from which perception learns."""


AGAIN = "make it again (cfnav rooms make, or rooms boxes where it has sightings)"
"""What to do about a scene that is damaged or of another version."""


SHIFTED = " shifted by "
"""In a scene's source, before the strength of another light and lens than in training."""


def shift_of(source: str) -> float:
    """How far the pictures of a scene look otherwise than in training, by its source."""
    return float(source.partition(SHIFTED)[2] or 0)


def parse_room(text: str) -> tuple[str, int]:
    """Read ``type:seed``.

    Raises:
        ValueError: the text is not a known type, a colon and a whole number.
    """
    kind, _, seed = text.partition(":")
    if kind not in KINDS or not seed.isdecimal():
        raise ValueError(
            f"found room {text!r}; expected TYPE:SEED with a type of {', '.join(KINDS)} "
            "and a whole number, for example kitchen:21"
        )
    return kind, int(seed)


def type_of(kind: str) -> str:
    """The type of a kind of room: kitchen of sweet_home.kitchen."""
    return kind.rpartition(".")[2]


def furniture_of(kind: str) -> str:
    """The furniture of a kind of room, one of ``FURNITURE``."""
    return kind.rpartition(".")[0] or BUILT_IN


def of_furniture(kind: str, furniture: str) -> str:
    """The kind of a type of room with another furniture."""
    return type_of(kind) if furniture == BUILT_IN else f"{furniture}.{type_of(kind)}"


def parse_rooms(
    texts: Iterable[str], furniture: Sequence[str] = (BUILT_IN,)
) -> list[tuple[str, int]]:
    """Read any number of ``type:seed``, ``type:first-last``, ``data2:train`` and ``data2``.

    Args:
        texts: with their furniture before a dot, or without.
        furniture: of those without, which are given once for each.

    Returns:
        Kind and seed of each room, in order, none twice.

    Raises:
        ValueError: one is none of these, with what was expected.
    """
    return list(dict.fromkeys(
        room for text in texts for full in _in_full(text, furniture) for room in _rooms(full)
    ))  # fmt: skip


def _in_full(text: str, furniture: Sequence[str]) -> list[str]:
    if "." in text.partition(":")[0]:
        return [text]
    return [text if name == BUILT_IN else f"{name}.{text}" for name in furniture]


def _rooms(text: str) -> list[tuple[str, int]]:
    kind, colon, rest = text.partition(":")
    name = type_of(kind)
    if name in SPLITS and furniture_of(kind) in FURNITURE and (not colon or rest in SPLITS[name]):
        seeds = SPLITS[name][rest] if rest else sorted(chain(*SPLITS[name].values()))
        return [(of_furniture(k, furniture_of(kind)), seed) for k in ROOM_TYPES for seed in seeds]
    first, dash, last = rest.partition("-")
    last = last if dash else first
    if kind not in KINDS or not (first.isdecimal() and last.isdecimal()):
        splits = (f"{layout}:{split}" for layout, row in SPLITS.items() for split in row)
        raise ValueError(
            f"found rooms {text!r}; expected TYPE:SEED or TYPE:FIRST-LAST with a type of "
            f"{', '.join(KINDS)}, or one of {', '.join((*SPLITS, *splits))}"
        )
    if int(last) < int(first):
        raise ValueError(f"found rooms {text!r}; expected the smaller seed first")
    return [(kind, seed) for seed in range(int(first), int(last) + 1)]


def split_of(name: str, seed: int) -> str:
    """Split that a row of ``SPLITS`` puts a seed into; empty when it has no such seed."""
    return next((split for split, seeds in SPLITS[name].items() if seed in seeds), "")


def is_test_room(kind: str, seed: int) -> bool:
    """Whether a room is one of those that test, from which nothing learns."""
    names = ("data1", "data2", "worlds") if furniture_of(kind) == BUILT_IN else ("worlds",)
    return any(split_of(name, seed) == "test" for name in names)


def room_folder(folder: Path, kind: str, seed: int) -> Path:
    """Where a room's data lies in a folder of rooms."""
    return folder / f"{kind}_{seed:05d}"


def rooms_in(folder: Path, head: str = "scene.json") -> list[tuple[str, int]]:
    """Rooms whose finished data lies in a folder, in the order of its sub-folders.

    Args:
        folder: with a sub-folder for each room.
        head: the file that each of them has; a scene's when not given.
    """
    found = (p.parent.name.rpartition("_") for p in sorted(folder.glob(f"*_[0-9]*/{head}")))
    return [(kind, int(seed)) for kind, _, seed in found if kind in KINDS and seed.isdecimal()]
