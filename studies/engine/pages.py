"""How studies show what they found: figures in words, and tables of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

Cell = Callable[[Any], str]
"""What a column shows of a row."""


def table(columns: Mapping[str, Cell], rows: Iterable[Any], rule: str = "---") -> str:
    """A Markdown table.

    Args:
        columns: what each shows, by its title.
        rows: of any kind that the columns can show.
        rule: below each title.
    """
    titles = "".join(f"| {title} " if title else "| " for title in columns)
    lines = [titles, f"|{rule}" * len(columns)]
    lines += ["".join(f"| {cell(row)} " for cell in columns.values()) for row in rows]
    return "".join(f"{line}|\n" for line in lines)


def filled(columns: Mapping[str, Cell], rows: Sequence[Any]) -> dict[str, Cell]:
    """The columns in which some row shows something."""
    return {title: cell for title, cell in columns.items() if any(map(cell, rows))}


def percent(value: float | None) -> str:
    """A share as percent; empty when there is none."""
    return "" if value is None else f"{100 * value:.1f}"


def signed(value: float | None) -> str:
    """A difference of shares as percent; empty when there is none."""
    return "" if value is None else f"{100 * value:+.1f}"


def spread(mean: float | None, std: float | None) -> str:
    """A share as percent, with its standard deviation over seeds unless there is only one."""
    return percent(mean) + ("" if std is None else f" ± {100 * std:.1f}")


def change(gain: float | None, ends: Sequence[float] | None) -> str:
    """A difference with its interval, percent; empty when there is none."""
    if gain is None or ends is None:
        return signed(gain)
    return f"{signed(gain)} [{signed(ends[0])}, {signed(ends[1])}]"
