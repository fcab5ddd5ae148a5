"""Rows of figures as JSON, CSV and Markdown, the paper's beside ours. No torch."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from cfnav_core.benchmark.rows import ROWS
from cfnav_core.benchmark.statistics import interval_of_seeds
from cfnav_core.whole import write_file

TABLES = ("I", "II", "III", "IV", "own", "tenfold")
"""In this order they stand in the summary."""

SUMMARY = "summary.json"

PLANNED = [(row.table, row.name, row.split) for row in ROWS]

LONG = "episodes whose shortest way is five actions or more"
"""In words; see ``Tested.long``."""

ABLATED = ("zero", "shuffled", "true")
"""What ours is given in place of its own prediction to see what that is worth."""


@dataclass(frozen=True)
class Figures:
    """One row of a table; rates are shares of 1, the paper's too.

    Attributes:
        cf_sr_std, cf_spl_std: over seeds, None for one seed.
        collisions_mean: per episode. touched_mean: share of the episodes with any.
        aborted_mean: share of live trials that the policy node gave up.
        preset: of sizes and numbers.
        sample: actions were drawn.
        gain: mean CF-SR minus that of the row it is compared with, paired by seed and episode.
        gain_ci95: 95 % interval over seeds and rooms. gain_by_seed: its mean for each.
        over_own: mean CF-SR minus that of the same policies with their own p_hat, without veto.
        over_vetoed: mean CF-SR minus that of plain under the same veto.
        ours_over: mean CF-SR of the paper's method minus that of this row.
        long_cf_sr_mean, long_gain: over the episodes whose shortest way is five actions or more.
        command: that made the row.
        config_hash: of the runs' configuration, seed 0.
        commit: of the code that trained them. tested_at: of the code that tested or drove them.
    """

    table: str
    row: str
    model: str
    method: str
    split: str
    p_hat: str
    veto: bool
    preset: str
    cf_sr_mean: float
    cf_sr_std: float | None
    cf_spl_mean: float
    cf_spl_std: float | None
    sr_mean: float
    collisions_mean: float
    seeds: int
    episodes: int
    command: str
    config_hash: str
    commit: str
    tested_at: str
    sample: bool = False
    paper_cf_sr: float | None = None
    paper_cf_sr_std: float | None = None
    paper_cf_spl: float | None = None
    paper_cf_spl_std: float | None = None
    paper_gain: float | None = None
    gain: float | None = None
    gain_ci95: tuple[float, float] | None = None
    gain_by_seed: tuple[float, ...] | None = None
    sr_gain: float | None = None
    sr_gain_ci95: tuple[float, float] | None = None
    over_own: float | None = None
    over_own_ci95: tuple[float, float] | None = None
    over_vetoed: float | None = None
    over_vetoed_ci95: tuple[float, float] | None = None
    ours_over: float | None = None
    ours_over_ci95: tuple[float, float] | None = None
    touched_mean: float | None = None
    aborted_mean: float | None = None
    long_episodes: int | None = None
    long_cf_sr_mean: float | None = None
    long_gain: float | None = None
    long_gain_ci95: tuple[float, float] | None = None


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
    out.mkdir(parents=True, exist_ok=True)
    write_file(out / SUMMARY, as_json(kept))
    write_file(out / "summary.csv", as_csv(kept))
    made = {row.table for row in found}
    for table in dict.fromkeys(row.table for row in kept):
        page = page_of(table, kept)
        write_file(out / f"table_{table}.md", page)
        if table in made:
            print(f"Table {table}\n\n{page}")


def page_of(table: str, kept: Sequence[Figures]) -> str:
    """A table for people, below it what its rows of ours do with another probability."""
    rows = [row for row in kept if row.table == table]
    page = as_markdown(rows)
    if table == "IV":
        return f"{page}\nCF-SPL is of metres here, of actions in the other tables.\n"
    if table == "I":
        page += "".join(f"\n{line}\n" for line in _mean_gains(rows))
        page += _gains_by_seed(rows)
    if long := [row for row in rows if row.long_episodes]:
        page += f"\n{LONG.capitalize()}:\n\n{long_as_markdown(long)}"
    ours = {(r.config_hash, r.seeds, r.commit) for r in rows if r.method == "ours"}
    given = [
        r for r in kept
        if r.table == "own" and r.p_hat in ABLATED and (r.config_hash, r.seeds, r.commit) in ours
    ]  # fmt: skip
    if table in ("own", "tenfold") or not given:
        return page
    return f"{page}\nThe same policies, given another probability:\n\n{as_markdown(given)}"


def _mean_gains(rows: Sequence[Figures]) -> list[str]:
    """A sentence for each split, over the models whose gain the paper reports too.

    Rows of other presets or numbers of seeds are not mixed.
    """
    lines = []
    for split, seeds in dict.fromkeys((row.split, _seeds(row)) for row in rows):
        found = [
            (row.gain, row.long_gain, row.paper_gain) for row in rows
            if (row.split, _seeds(row)) == (split, seeds)
        ]  # fmt: skip
        gains = [(x, y, z) for x, y, z in found if None not in (x, y, z)]
        if gains:
            ours, long, papers = (sum(of) / len(gains) for of in zip(*gains, strict=True))
            of = "1 model" if len(gains) == 1 else f"{len(gains)} models"
            lines.append(
                f"Mean gain in CF-SR on {split}, {of} (seeds: {seeds}): {_signed(ours)} points, "
                f"{_signed(long)} over {LONG}; the paper's of the same models: {_signed(papers)}."
            )
    return lines


def _gains_by_seed(rows: Sequence[Figures]) -> str:
    """How much training seeds differ; empty where no row has two.

    A bootstrap over so few is too narrow, so Student's t stands beside it.
    """
    found = [row for row in rows if row.gain_by_seed and len(row.gain_by_seed) > 1]
    if not found:
        return ""
    most = max(len(row.gain_by_seed or ()) for row in found)
    lines = [
        "\nGain in CF-SR of each training seed, and an interval by Student's t over these alone:\n",
        "| data | row | " + "".join(f"seed {n} | " for n in range(most)) + "mean [95 %, t] |",
        "|" + "---|" * (most + 3),
    ]
    for row in found:
        gains = np.array(row.gain_by_seed)
        cells = [_signed(gain) for gain in gains] + [""] * (most - len(gains))
        cells.append(change(float(gains.mean()), interval_of_seeds(gains)))
        lines.append("| " + " | ".join([row.split, row.row, *cells]) + " |")
    return "\n".join(lines) + "\n"


def read_summary(out: Path) -> list[Figures]:
    """The rows of a folder's summary; none where there is no summary yet.

    Raises:
        ValueError: it cannot be read.
    """
    path = out / SUMMARY
    if not path.exists():
        return []
    try:
        return [Figures(**row) for row in json.loads(path.read_text())["rows"]]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"found no readable summary in {path} ({error}); remove it and make the tables again"
        ) from error


def _place(row: Figures) -> tuple[int, int]:
    """Where a row stands: by table, then as planned; others, below, as they were made."""
    of = row.table, row.row, row.split
    return TABLES.index(row.table), PLANNED.index(of) if of in PLANNED else len(PLANNED)


def _key(row: Figures) -> tuple[str, ...]:
    return row.table, row.row, row.split, row.preset


def as_json(rows: Iterable[Figures]) -> str:
    """All figures."""
    return json.dumps({"rows": [asdict(row) for row in rows]}, indent=1) + "\n"


def as_csv(rows: Sequence[Figures]) -> str:
    """All figures, a line a row."""
    text = io.StringIO()
    table = csv.DictWriter(text, list(asdict(rows[0])), lineterminator="\n")
    table.writeheader()
    for row in rows:
        values = asdict(row)
        for name, value in values.items():
            if isinstance(value, (tuple, list)):
                values[name] = " ".join(f"{x:.4f}" for x in value)
        table.writerow(values)
    return text.getvalue()


def as_markdown(rows: Sequence[Figures]) -> str:
    """A table for people, percent; without the columns in which no row has a figure."""
    columns = {
        "data": [r.split for r in rows],
        "row": [r.row for r in rows],
        "CF-SR, paper": [spread(r.paper_cf_sr, r.paper_cf_sr_std) for r in rows],
        "CF-SR": [spread(r.cf_sr_mean, r.cf_sr_std) for r in rows],
        "gain, paper": [_signed(r.paper_gain) for r in rows],
        "gain [95 %]": [change(r.gain, r.gain_ci95) for r in rows],
        "over own p_hat [95 %]": [change(r.over_own, r.over_own_ci95) for r in rows],
        "over plain under the veto [95 %]": [
            change(r.over_vetoed, r.over_vetoed_ci95) for r in rows
        ],
        "ours minus it [95 %]": [change(r.ours_over, r.ours_over_ci95) for r in rows],
        "CF-SPL, paper": [spread(r.paper_cf_spl, r.paper_cf_spl_std) for r in rows],
        "CF-SPL": [spread(r.cf_spl_mean, r.cf_spl_std) for r in rows],
        "SR": [percent(r.sr_mean) for r in rows],
        "SR gain [95 %]": [change(r.sr_gain, r.sr_gain_ci95) for r in rows],
        "touched": [percent(r.touched_mean) for r in rows],
        "aborted": [percent(r.aborted_mean) for r in rows],
        "collisions per episode": [f"{r.collisions_mean:.2f}" for r in rows],
        "seeds": [_seeds(r) for r in rows],
    }
    shown = {title: cells for title, cells in columns.items() if any(cells)}
    lines = [tuple(shown), ("---",) * len(shown), *zip(*shown.values(), strict=True)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _seeds(row: Figures) -> str:
    return f"{row.seeds}" + ("" if row.preset in ("", "small") else f", {row.preset}")


def long_as_markdown(rows: Sequence[Figures]) -> str:
    """The same rows over the longer episodes, percent."""
    lines = ["| data | row | episodes a seed | CF-SR | gain [95 %] |", "|" + "---|" * 5]
    lines += [
        f"| {r.split} | {r.row} | {r.long_episodes:,} | {percent(r.long_cf_sr_mean)} "
        f"| {change(r.long_gain, r.long_gain_ci95)} |"
        for r in rows
    ]
    return "\n".join(lines) + "\n"


def percent(value: float | None) -> str:
    """A share as percent; empty when there is none."""
    return "" if value is None else f"{100 * value:.1f}"


def _signed(value: float | None) -> str:
    return "" if value is None else f"{100 * value:+.1f}"


def spread(mean: float | None, std: float | None) -> str:
    """A share as percent, with its standard deviation over seeds unless there is only one."""
    return percent(mean) + ("" if std is None else f" ± {100 * std:.1f}")


def change(gain: float | None, ends: tuple[float, float] | None) -> str:
    """A difference with its interval, percent; empty when there is none."""
    if gain is None or ends is None:
        return _signed(gain)
    return f"{_signed(gain)} [{_signed(ends[0])}, {_signed(ends[1])}]"
