"""Figures of rows as JSON, CSV and pages, the paper's beside ours."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from operator import itemgetter
from pathlib import Path

import numpy as np

from cfnav_core.files.whole import write_file
from studies.engine.pages import Cell, change, filled, percent, signed, spread, table
from studies.engine.results import FIGURES, Figures
from studies.engine.statistics import interval_of_seeds
from studies.paper.rows import ROWS

TABLES = ("I", "II", "III", "IV", "own", "tenfold")
"""In this order they stand in the summary."""

SUMMARY = "summary.json"

PLANNED = [(row.table, row.name, row.split) for row in ROWS]

LONG = "episodes whose shortest way is five actions or more"
"""In words; see ``Results.long``."""

ABLATED = ("zero", "other_episode", "true")
"""What ours is given in place of its own prediction to see what that is worth."""


def _mean(name: str) -> Cell:
    return lambda row: spread(row[name + "_mean"], row[name + "_std"])


def _paper(name: str) -> Cell:
    return lambda row: spread(row[f"paper_{name}"], row[f"paper_{name}_std"])


def _percent(name: str) -> Cell:
    return lambda row: percent(row[name])


def _change(name: str) -> Cell:
    return lambda row: change(row[name], row[f"{name}_ci95"])


def _seeds(row: Figures) -> str:
    return f"{row['seeds']}" + ("" if row["preset"] in ("", "small") else f", {row['preset']}")


COLUMNS: dict[str, Cell] = {
    "data": itemgetter("split"),
    "row": itemgetter("row"),
    "CF-SR, paper": _paper("cf_sr"),
    "CF-SR": _mean("cf_sr"),
    "gain, paper": lambda row: signed(row["paper_gain"]),
    "gain [95 %]": _change("gain"),
    "over own p_hat [95 %]": _change("over_own"),
    "over plain under the veto [95 %]": _change("over_vetoed"),
    "ours minus it [95 %]": _change("ours_over"),
    "CF-SPL, paper": _paper("cf_spl"),
    "CF-SPL": _mean("cf_spl"),
    "SR": _percent("sr_mean"),
    "SR gain [95 %]": _change("sr_gain"),
    "touched": _percent("touched_mean"),
    "aborted": _percent("aborted_mean"),
    "collisions per episode": lambda row: f"{row['collisions_mean']:.2f}",
    "seeds": _seeds,
}
"""Of every table, percent; without those in which no row has a figure."""

LONG_COLUMNS: dict[str, Cell] = {
    "data": itemgetter("split"),
    "row": itemgetter("row"),
    "episodes a seed": lambda row: f"{row['long_episodes']:,}",
    "CF-SR": _percent("long_cf_sr_mean"),
    "gain [95 %]": _change("long_gain"),
}


def write_tables(found: Sequence[Figures], out: Path) -> None:
    """Write tables as summary and pages, and print the pages of those that are made.

    Tables that the folder's summary holds already and that are not made anew stay in it; a table
    made in part replaces only its own rows.

    Args:
        found: rows of any tables.
        out: the folder.

    Raises:
        ValueError: the summary that is there cannot be read.
        WriteError: the folder cannot be written.
    """
    rows = {_key(row): row for row in (*read_summary(out), *found)}
    kept = sorted(rows.values(), key=_place)
    write_file(out / SUMMARY, json.dumps({"rows": kept}, indent=1) + "\n")
    write_file(out / "summary.csv", as_csv(kept))
    made = {row["table"] for row in found}
    for name in dict.fromkeys(row["table"] for row in kept):
        page = page_of(name, kept)
        write_file(out / f"table_{name}.md", page)
        if name in made:
            print(f"Table {name}\n\n{page}")


def page_of(name: str, kept: Sequence[Figures]) -> str:
    """A table for people, below it what its rows of ours do with another probability."""
    rows = [row for row in kept if row["table"] == name]
    page = as_markdown(rows)
    if name == "IV":
        return f"{page}\nCF-SPL is of metres here, of actions in the other tables.\n"
    if name == "I":
        page += "".join(f"\n{line}\n" for line in _mean_gains(rows))
        page += _gains_by_seed(rows)
    if long := [row for row in rows if row["long_episodes"]]:
        page += f"\n{LONG.capitalize()}:\n\n{table(LONG_COLUMNS, long)}"
    ours = {_policies(row) for row in rows if row["method"] == "ours"}
    given = [
        row for row in kept
        if row["table"] == "own" and row["p_hat"] in ABLATED and _policies(row) in ours
    ]  # fmt: skip
    if name in ("own", "tenfold") or not given:
        return page
    return f"{page}\nThe same policies, given another probability:\n\n{as_markdown(given)}"


def _policies(row: Figures) -> tuple[str, int, str]:
    return row["config_hash"], row["seeds"], row["commit"]


def as_markdown(rows: Sequence[Figures]) -> str:
    """A table for people."""
    return table(filled(COLUMNS, rows), rows, rule=" --- ")


def _mean_gains(rows: Sequence[Figures]) -> list[str]:
    """A sentence for each split, over the models whose gain the paper reports too.

    Rows of other presets or numbers of seeds are not mixed.
    """
    lines = []
    for split, seeds in dict.fromkeys((row["split"], _seeds(row)) for row in rows):
        found = [
            [row["gain"], row["long_gain"], row["paper_gain"]] for row in rows
            if (row["split"], _seeds(row)) == (split, seeds)
        ]  # fmt: skip
        gains = [of for of in found if None not in of]
        if gains:
            ours, long, papers = (sum(of) / len(gains) for of in zip(*gains, strict=True))
            of = "1 model" if len(gains) == 1 else f"{len(gains)} models"
            lines.append(
                f"Mean gain in CF-SR on {split}, {of} (seeds: {seeds}): {signed(ours)} points, "
                f"{signed(long)} over {LONG}; the paper's of the same models: {signed(papers)}."
            )
    return lines


def _gains_by_seed(rows: Sequence[Figures]) -> str:
    """How much training seeds differ; empty where no row has two.

    A bootstrap over so few is too narrow, so Student's t stands beside it.
    """
    found = [row for row in rows if len(row["gain_by_seed"] or ()) > 1]
    if not found:
        return ""
    columns: dict[str, Cell] = {"data": itemgetter("split"), "row": itemgetter("row")}
    for n in range(max(len(row["gain_by_seed"]) for row in found)):
        columns[f"seed {n}"] = _gain_of_seed(n)
    columns["mean [95 %, t]"] = _by_students_t
    title = "Gain in CF-SR of each training seed, and an interval by Student's t over these alone"
    return f"\n{title}:\n\n{table(columns, found)}"


def _gain_of_seed(n: int) -> Cell:
    """Empty where a row has fewer seeds."""
    return lambda row: "".join(map(signed, row["gain_by_seed"][n : n + 1]))


def _by_students_t(row: Figures) -> str:
    gains = np.array(row["gain_by_seed"])
    return change(float(gains.mean()), interval_of_seeds(gains))


def read_summary(out: Path) -> list[Figures]:
    """The rows of a folder's summary; none where there is no summary yet.

    Raises:
        ValueError: it cannot be read.
    """
    path = out / SUMMARY
    if not path.exists():
        return []
    again = "remove it and make the tables again"
    try:
        rows: list[Figures] = json.loads(path.read_text())["rows"]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"found no readable summary in {path} ({error}); {again}") from error
    if any(set(row) != set(FIGURES) for row in rows):
        raise ValueError(f"found {path} of another version of cfnav, with other figures; {again}")
    return rows


def _place(row: Figures) -> tuple[int, int]:
    """Where a row stands: by table, then as planned; others, below, as they were made."""
    of = row["table"], row["row"], row["split"]
    return TABLES.index(row["table"]), PLANNED.index(of) if of in PLANNED else len(PLANNED)


def _key(row: Figures) -> tuple[str, ...]:
    return row["table"], row["row"], row["split"], row["preset"]


def as_csv(rows: Sequence[Figures]) -> str:
    """All figures, a line a row."""
    text = io.StringIO()
    lines = csv.DictWriter(text, FIGURES, lineterminator="\n")
    lines.writeheader()
    for row in rows:
        lines.writerow({name: _in_csv(value) for name, value in row.items()})
    return text.getvalue()


def _in_csv(value: object) -> object:
    return " ".join(f"{x:.4f}" for x in value) if isinstance(value, (tuple, list)) else value
