"""Which parts of which bags are drives, from a file: for drives without a policy node's episodes.

YAML (a list of mappings) or CSV (with a header) of the columns ``bag, start, end, goal`` and, where
known, ``goal_x, goal_y, reached``. Times are seconds from the beginning of the bag, the goal's
place metres in the odometry frame.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

NEEDED = ("bag", "start", "end", "goal")
OPTIONAL = ("goal_x", "goal_y", "reached")
WORDS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


class EpisodesError(ValueError):
    """The file cannot be used; the text is one sentence."""


@dataclass(frozen=True)
class EpisodeRow:
    """One drive.

    Attributes:
        bag: name of the bag's folder or file, with or without its ending, and if need be with
            folders before it.
        start: s from the beginning of the bag.
        end: s.
        goal: what was sought, empty for nothing.
        goal_at: (x, y) of it, metres in the odometry frame, None if unknown.
        reached: whether it was found, None if nobody says.
    """

    bag: str
    start: float
    end: float
    goal: str
    goal_at: tuple[float, float] | None = None
    reached: bool | None = None


def read_episodes(path: Path) -> tuple[EpisodeRow, ...]:
    """Read the file: CSV when its name ends in .csv, YAML otherwise.

    Returns:
        The drives, by bag and start.

    Raises:
        EpisodesError: the file cannot be read or a row makes no sense; one sentence.
    """
    rows = []
    for number, cells in enumerate(_table(path), 1):
        try:
            rows.append(_row(cells))
        except ValueError as error:
            raise EpisodesError(f"{path}, row {number}: {error}") from None
    rows.sort(key=lambda row: (row.bag, row.start))
    for before, after in pairwise(rows):
        if before.bag == after.bag and after.start < before.end:
            raise EpisodesError(
                f"{path}: two episodes of {after.bag} overlap at {after.start:g} s; expected each "
                "to end before the next starts"
            )
    return tuple(rows)


def rows_by_bag(
    rows: Sequence[EpisodeRow], bags: Sequence[Path]
) -> dict[Path, tuple[EpisodeRow, ...]]:
    """The rows that speak of each bag.

    Raises:
        EpisodesError: a row fits no bag, or several; one sentence.
    """
    found: dict[Path, list[EpisodeRow]] = {bag: [] for bag in bags}
    for row in rows:
        fits = [bag for bag in bags if row.bag == str(bag)]
        fits = fits or [bag for bag in bags if _ends(bag.absolute(), row.bag)]
        fits = fits or [bag for bag in bags if _ends(_without_ending(bag), row.bag)]
        if len(fits) != 1:
            which = " and ".join(str(bag) for bag in fits) or "none of the bags"
            raise EpisodesError(
                f"The episodes file has a row of the bag {row.bag!r}, which fits {which}; expected "
                "one bag: name it as the report does, or with more of its path"
            )
        found[fits[0]].append(row)
    return {bag: tuple(mine) for bag, mine in found.items()}


def _ends(bag: Path, name: str) -> bool:
    """Whether the path of a bag ends as a name says, folder by folder."""
    parts = Path(name).parts
    return bag.parts[-len(parts) :] == parts


def _without_ending(bag: Path) -> Path:
    """A bag's path without ``.mcap``, ``.db3`` or the ``_*.mcap`` of one that is split."""
    whole = bag.absolute()
    return whole.with_name(whole.stem.removesuffix("_*"))


def _table(path: Path) -> list[Any]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise EpisodesError(f"{path} is no text; expected YAML or CSV") from None
    except OSError as error:
        raise EpisodesError(f"{path} cannot be read: {error.strerror}") from None
    try:
        if path.suffix.lower() == ".csv":
            return list(csv.DictReader(text.splitlines(), strict=True))
        table = yaml.safe_load(text)
    except (csv.Error, yaml.YAMLError, ValueError, RecursionError) as error:
        what = " ".join(str(error).split())
        raise EpisodesError(f"{path} is neither YAML nor CSV: {what}") from None
    if not isinstance(table, list):
        raise EpisodesError(
            f"{path} holds {type(table).__name__}, expected a list of episodes with {_columns()}"
        )
    return table


def _row(cells: Any) -> EpisodeRow:
    if not isinstance(cells, Mapping):
        raise ValueError(f"it is {cells!r}, expected {_columns()}")
    if None in cells:
        raise ValueError("it has more cells than the header; expected as many")
    unknown = sorted(str(name) for name in cells if name not in (*NEEDED, *OPTIONAL))
    if unknown:
        raise ValueError(f"{unknown[0]!r} is unknown; expected {_columns()}")
    missing = [name for name in NEEDED if cells.get(name) is None]
    if missing:
        raise ValueError(f"{missing[0]} is missing; expected {_columns()}")
    bag = str(cells["bag"]).strip().rstrip("/")
    if not bag:
        raise ValueError("bag is empty; expected the name of a bag")
    start, end = _number(cells, "start"), _number(cells, "end")
    if not 0 <= start < end:
        raise ValueError(f"it goes from {start:g} to {end:g} s; expected 0 <= start < end")
    return EpisodeRow(bag, start, end, str(cells["goal"]).strip(), _place(cells), _reached(cells))


def _place(cells: Mapping[Any, Any]) -> tuple[float, float] | None:
    given = [name for name in ("goal_x", "goal_y") if cells.get(name) not in (None, "")]
    if not given:
        return None
    if len(given) == 1:
        raise ValueError(f"it has {given[0]} alone; expected goal_x and goal_y, or neither")
    return _number(cells, "goal_x"), _number(cells, "goal_y")


def _reached(cells: Mapping[Any, Any]) -> bool | None:
    value = cells.get("reached")
    if value is None or value == "":
        return None
    if str(value).strip().lower() not in WORDS:
        raise ValueError(f"reached is {value!r}; expected true or false")
    return WORDS[str(value).strip().lower()]


def _number(cells: Mapping[Any, Any], name: str) -> float:
    value = cells[name]
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{name} is {value!r}; expected a number")
    return number


def _columns() -> str:
    return f"{', '.join(NEEDED)} and optionally {', '.join(OPTIONAL)}"
