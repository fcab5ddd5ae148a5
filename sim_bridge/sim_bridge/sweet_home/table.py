"""Which model plays which part in a room (``models.yaml``), and which only test rooms have."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import yaml

from sim_bridge.sweet_home.cache import load
from sim_bridge.sweet_home.catalogue import (
    Entry,
    SweetHomeError,
    catalogue,
    furniture_folder,
    shipped,
)
from sim_bridge.sweet_home.model import Model

TABLE = Path(__file__).with_name("models.yaml")
VARIABLE = "CFNAV_SWEET_HOME_TABLE"
"""Environment variable that names another table."""
HELD_OUT_EVERY = 3
"""The last of so many models of a role is held out."""


@dataclass(frozen=True)
class Piece:
    """A model and the part that it plays.

    Attributes:
        entry: the model in its catalogue, with the size that it has here.
        role: a category that can be a goal, or another part such as "sofa".
        held_out: whether only test rooms have it.
        rooms: types of the only rooms that it suits; empty for any.
        on: roles that it stands on; empty where the role alone says it.
        wall: fixed to a wall.
        kind: variant of its role, or empty.
        style: pieces that belong together share one.
        goals: categories of things that are part of the model, by the names of their objects or
            materials in its file: the pillows of a bed.
    """

    entry: Entry
    role: str
    held_out: bool
    rooms: tuple[str, ...] = ()
    on: tuple[str, ...] = ()
    wall: bool = False
    kind: str = ""
    style: str = ""
    goals: Mapping[str, str] = field(default_factory=dict)

    def load(self) -> Model:
        """Its meshes, those of ``goals`` by themselves, and its boxes.

        Raises:
            SweetHomeError: the archive is damaged.
        """
        return load(self.entry, self.goals)


def pieces() -> Mapping[str, tuple[Piece, ...]]:
    """All pieces by role, in the order of the table.

    Raises:
        SweetHomeError: the furniture is not installed, or the table names what it has not.
    """
    named = os.environ.get(VARIABLE)
    return _pieces(Path(named) if named else TABLE, furniture_folder())


@cache
def _pieces(path: Path, folder: Path) -> Mapping[str, tuple[Piece, ...]]:
    known = catalogue(folder)

    def look_up(role: str, name: str) -> Entry:
        if name not in known:
            raise SweetHomeError(
                f"found no {name} in the installed furniture, which {TABLE.name} names for {role}; "
                "install sweethome3d-furniture 1.8"
            )
        return known[name]

    return _cast(path, look_up)


@cache
def shipped_pieces() -> Mapping[str, tuple[Piece, ...]]:
    """The pieces of the project's table that come with cfnav, by role; roles may have none.

    Each plays its part as in ``pieces()`` and is held out where it is there.

    Raises:
        SweetHomeError: what came with cfnav is missing or damaged.
    """
    known = shipped()
    return _cast(TABLE, lambda role, name: known.get(name))


def _cast(
    table: Path, look_up: Callable[[str, str], Entry | None]
) -> Mapping[str, tuple[Piece, ...]]:
    """Each role of a table with its pieces: those of which there is a model."""
    rows = yaml.safe_load(table.read_text())
    rows.pop("left_out", None)
    return MappingProxyType(
        {role: tuple(_of_role(role, row, look_up)) for role, row in rows.items()}
    )


def _of_role(
    role: str, rows: list[dict[str, Any]], look_up: Callable[[str, str], Entry | None]
) -> Iterator[Piece]:
    families: dict[str, bool] = {}
    for index, row in enumerate(rows):
        held_out = index % HELD_OUT_EVERY == HELD_OUT_EVERY - 1
        if "family" in row:
            held_out = families.setdefault(row["family"], held_out)
        held_out = row.get("held_out", held_out)
        entry = look_up(role, row["id"])
        if entry is None:
            continue
        if "size" in row:
            entry = replace(entry, size=tuple(row["size"]))
        if "turn" in row:
            entry = _turned(entry, row["turn"])
        yield Piece(
            entry, role, held_out, tuple(row.get("rooms", ())), tuple(row.get("on", ())),
            bool(row.get("wall", False)), row.get("kind", ""), row.get("style", ""),
            row.get("goals", {}),
        )  # fmt: skip


def _turned(entry: Entry, degrees: int) -> Entry:
    """The same turned by quarters, counter-clockwise from above."""
    c, s = (round(f(math.radians(degrees))) for f in (math.cos, math.sin))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array(entry.rotation)
    width, depth, height = entry.size
    return replace(
        entry, rotation=tuple(map(tuple, turn.tolist())),
        size=(depth, width, height) if s else entry.size,
    )  # fmt: skip
