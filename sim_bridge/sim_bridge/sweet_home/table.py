"""Which model plays which part in a room: ``models.yaml``, and which models only test rooms have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from sim_bridge.sweet_home.cache import load
from sim_bridge.sweet_home.catalogue import Entry, SweetHomeError, catalogue
from sim_bridge.sweet_home.model import Model

TABLE = Path(__file__).with_name("models.yaml")
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
    """

    entry: Entry
    role: str
    held_out: bool
    rooms: tuple[str, ...] = ()
    on: tuple[str, ...] = ()
    wall: bool = False
    kind: str = ""
    style: str = ""

    def load(self) -> Model:
        """Its meshes and boxes.

        Raises:
            SweetHomeError: the archive is damaged.
        """
        return load(self.entry)


@cache
def pieces(path: Path = TABLE) -> Mapping[str, tuple[Piece, ...]]:
    """All pieces by role, in the order of the table.

    Raises:
        SweetHomeError: the furniture is not installed, or the table names what it has not.
    """
    known = catalogue()
    rows = yaml.safe_load(path.read_text())
    rows.pop("left_out", None)
    return MappingProxyType({role: tuple(_of_role(role, row, known)) for role, row in rows.items()})


def _of_role(role: str, rows: list[dict[str, Any]], known: Mapping[str, Entry]) -> list[Piece]:
    found: list[Piece] = []
    families: dict[str, bool] = {}
    for index, row in enumerate(rows):
        if row["id"] not in known:
            raise SweetHomeError(
                f"found no {row['id']} in the installed furniture, which {TABLE.name} names for "
                f"{role}; install sweethome3d-furniture 1.8"
            )
        entry = known[row["id"]]
        if "size" in row:
            entry = replace(entry, size=tuple(row["size"]))
        held_out = index % HELD_OUT_EVERY == HELD_OUT_EVERY - 1
        if "family" in row:
            held_out = families.setdefault(row["family"], held_out)
        found.append(
            Piece(
                entry, role, held_out, tuple(row.get("rooms", ())), tuple(row.get("on", ())),
                bool(row.get("wall", False)), row.get("kind", ""), row.get("style", ""),
            )  # fmt: skip
        )
    return found
