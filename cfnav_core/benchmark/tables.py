"""Tested runs -> rows of figures, as JSON, CSV and Markdown, the paper's beside ours."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from cfnav_core.benchmark.jobs import Job, Places
from cfnav_core.benchmark.presets import PresetName
from cfnav_core.benchmark.rows import Row
from cfnav_core.benchmark.statistics import interval, over_seeds
from cfnav_core.benchmark.tested import Tested, TestOf
from cfnav_core.config import MethodName, PHat


@dataclass(frozen=True)
class Figures:
    """One row of a table; rates are shares of 1, the paper's too.

    Attributes:
        cf_sr_std, cf_spl_std: over seeds, None for one seed.
        gain: mean CF-SR minus that of the row it is compared with, paired by seed and episode.
        gain_ci95: 95 % interval over seeds and rooms.
        config_hash: of the runs' configuration, seed 0.
        commit: of the code that trained them.
    """

    table: str
    row: str
    model: str
    method: str
    split: str
    p_hat: str
    paper_cf_sr: float | None
    paper_cf_spl: float | None
    paper_gain: float | None
    cf_sr_mean: float
    cf_sr_std: float | None
    cf_spl_mean: float
    cf_spl_std: float | None
    sr_mean: float
    collisions_mean: float
    seeds: int
    episodes: int
    gain: float | None
    gain_ci95: tuple[float, float] | None
    sr_gain: float | None
    sr_gain_ci95: tuple[float, float] | None
    command: str
    config_hash: str
    commit: str


@dataclass(frozen=True)
class Bench:
    """What the rows were made with.

    Attributes:
        places: of the grid. episodes: folder of the frozen test episodes.
        seeds: of each row. preset: of sizes and numbers. perception: of the scenes.
        command: that made the rows.
    """

    places: Places
    episodes: Path
    seeds: int
    preset: PresetName
    perception: str
    command: str

    def job(self, row: Row, method: MethodName, seed: int) -> Job:
        """The run of a row."""
        return Job(row.model, method, row.split, seed, self.preset, self.perception)

    def test(self, row: Row, p_hat: PHat) -> TestOf:
        """The test of a row."""
        return TestOf(p_hat, self.episodes / f"{row.split}_test.json")

    def tested(self, row: Row, method: MethodName, p_hat: PHat) -> list[Tested]:
        """Results by seed.

        Raises:
            FileNotFoundError: a run was not tested yet.
        """
        file = self.test(row, p_hat).file
        runs = (self.job(row, method, seed) for seed in range(self.seeds))
        return [Tested.load(run.options(self.places).out / file) for run in runs]


def figures_of(row: Row, bench: Bench, rows: Sequence[Row]) -> Figures:
    """The figures of a row.

    Args:
        row: whose runs were tested.
        bench: where they are.
        rows: all of them, among which stands what it is compared with.

    Raises:
        FileNotFoundError: a run was not tested yet.
        ValueError: runs met different episodes.
    """
    found = bench.tested(row, row.method, row.p_hat)
    success = np.array([t.success for t in found], float)
    cf_success = np.array([t.cf_success for t in found])
    cf_sr, cf_spl = (
        over_seeds(v) for v in (cf_success, np.array([t.cf_efficiency for t in found]))
    )
    gain = sr_gain = None
    if row.against:
        plain = bench.tested(row, row.against, "own")
        if len({t.identity for t in (*found, *plain)}) > 1:
            raise ValueError(f"found runs of {row.name} that met different episodes; test anew")
        gain = cf_success - np.array([t.cf_success for t in plain])
        sr_gain = success - np.array([t.success for t in plain], float)
    rooms = found[0].rooms
    return Figures(
        table=row.table, row=row.name, model=row.model, method=row.method, split=row.split,
        p_hat=row.p_hat,
        paper_cf_sr=row.paper.cf_sr[0] / 100 if row.paper else None,
        paper_cf_spl=row.paper.cf_spl[0] / 100 if row.paper else None,
        paper_gain=_paper_gain(row, rows),
        cf_sr_mean=cf_sr[0], cf_sr_std=_number(cf_sr[1]),
        cf_spl_mean=cf_spl[0], cf_spl_std=_number(cf_spl[1]),
        sr_mean=float(success.mean()),
        collisions_mean=float(np.mean([t.collisions for t in found])),
        seeds=bench.seeds, episodes=success.shape[1],
        gain=None if gain is None else float(gain.mean()),
        gain_ci95=None if gain is None else interval(gain, rooms),
        sr_gain=None if sr_gain is None else float(sr_gain.mean()),
        sr_gain_ci95=None if sr_gain is None else interval(sr_gain, rooms),
        command=bench.command, config_hash=bench.job(row, row.method, 0).hash,
        commit=", ".join(sorted({t.commit for t in found})),
    )  # fmt: skip


def _paper_gain(row: Row, rows: Sequence[Row]) -> float | None:
    if not (row.paper and row.against):
        return None
    of = (row.table, row.model, row.split, row.against)
    plain = next(r for r in rows if (r.table, r.model, r.split, r.method) == of)
    assert plain.paper
    return round(row.paper.cf_sr[0] - plain.paper.cf_sr[0], 1) / 100


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value


def as_json(rows: Sequence[Figures]) -> str:
    """All figures."""
    return json.dumps({"rows": [asdict(row) for row in rows]}, indent=1) + "\n"


def as_csv(rows: Sequence[Figures]) -> str:
    """All figures, a line a row."""
    text = io.StringIO()
    table = csv.DictWriter(text, list(asdict(rows[0])), lineterminator="\n")
    table.writeheader()
    for row in rows:
        values = asdict(row)
        for name in ("gain_ci95", "sr_gain_ci95"):
            ends = values[name]
            values[name] = "" if ends is None else f"{ends[0]:.4f} {ends[1]:.4f}"
        table.writerow(values)
    return text.getvalue()


def as_markdown(rows: Sequence[Figures]) -> str:
    """A table for people, percent."""
    lines = [
        "| data | row | CF-SR, paper | CF-SR | gain, paper | gain [95 %] | CF-SPL, paper | CF-SPL "
        "| SR | SR gain [95 %] | collisions per episode |",
        "|" + "---|" * 11,
    ]
    for r in rows:
        cells = (
            r.split, r.row, _percent(r.paper_cf_sr), _spread(r.cf_sr_mean, r.cf_sr_std),
            _signed(r.paper_gain), _change(r.gain, r.gain_ci95), _percent(r.paper_cf_spl),
            _spread(r.cf_spl_mean, r.cf_spl_std), _percent(r.sr_mean),
            _change(r.sr_gain, r.sr_gain_ci95), f"{r.collisions_mean:.2f}",
        )  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _percent(value: float | None) -> str:
    return "" if value is None else f"{100 * value:.1f}"


def _signed(value: float | None) -> str:
    return "" if value is None else f"{100 * value:+.1f}"


def _spread(mean: float, std: float | None) -> str:
    return _percent(mean) + ("" if std is None else f" ± {100 * std:.1f}")


def _change(gain: float | None, ends: tuple[float, float] | None) -> str:
    if gain is None or ends is None:
        return ""
    return f"{_signed(gain)} [{_signed(ends[0])}, {_signed(ends[1])}]"
