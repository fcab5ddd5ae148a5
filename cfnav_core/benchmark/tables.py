"""Tested runs -> rows of figures, as JSON, CSV and Markdown, the paper's beside ours."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfnav_core.benchmark.chance import chance
from cfnav_core.benchmark.jobs import Job, Places
from cfnav_core.benchmark.presets import PRESETS, PresetName
from cfnav_core.benchmark.rows import Row, Split
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
    veto: bool
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

    def test(self, row: Row) -> TestOf:
        """The test of a row."""
        return self.frozen(row.split, row.p_hat, row.veto)

    def frozen(self, split: Split, p_hat: PHat = "own", veto: bool = False) -> TestOf:
        """A test on a split's frozen episodes."""
        frozen = self.episodes / f"{split}_test.json"
        return TestOf(p_hat, veto, frozen, PRESETS[self.preset].test_episodes)

    def tested(self, row: Row) -> list[Tested]:
        """Results by seed.

        Raises:
            FileNotFoundError: a run was not tested yet.
        """
        file = self.test(row).file
        runs = (self.job(row, row.method, seed) for seed in range(self.seeds))
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
    found = bench.tested(row)
    gain = sr_gain = None
    if row.reference:
        plain = bench.tested(row.reference)
        if len({t.identity for t in (*found, *plain)}) > 1:
            raise ValueError(f"found runs of {row.name} that met different episodes; test anew")
        gain = _difference([t.cf_success for t in found], [t.cf_success for t in plain])
        sr_gain = _difference([t.success for t in found], [t.success for t in plain])
    rooms = found[0].rooms
    return Figures(
        table=row.table, row=row.name, model=row.model, method=row.method, split=row.split,
        p_hat=row.p_hat, veto=row.veto,
        paper_cf_sr=round(row.paper.cf_sr[0] / 100, 3) if row.paper else None,
        paper_cf_spl=round(row.paper.cf_spl[0] / 100, 3) if row.paper else None,
        paper_gain=_paper_gain(row, rows),
        **_measured(found),
        gain=None if gain is None else float(gain.mean()),
        gain_ci95=None if gain is None else interval(gain, rooms),
        sr_gain=None if sr_gain is None else float(sr_gain.mean()),
        sr_gain_ci95=None if sr_gain is None else interval(sr_gain, rooms),
        command=bench.command, config_hash=bench.job(row, row.method, 0).hash,
    )  # fmt: skip


def figures_of_chance(split: Split, bench: Bench) -> Figures:
    """The figures of drawn actions in a split's test episodes.

    Raises:
        SceneError: the scenes cannot be used.
    """
    test = bench.frozen(split)
    found = [
        chance(test, bench.places.scenes, seed, bench.places.out / f"random_{seed}_{test.file}")
        for seed in range(bench.seeds)
    ]
    return Figures(
        table="own", row="random", model="none", method="random", split=split, p_hat="own",
        veto=False, paper_cf_sr=None, paper_cf_spl=None, paper_gain=None, **_measured(found),
        gain=None, gain_ci95=None, sr_gain=None, sr_gain_ci95=None,
        command=bench.command, config_hash="",
    )  # fmt: skip


def _measured(found: Sequence[Tested]) -> dict[str, Any]:
    """Means over seeds and episodes."""
    cf_sr, cf_spl = (
        over_seeds(np.array(values))
        for values in ([t.cf_success for t in found], [t.cf_efficiency for t in found])
    )
    return {
        "cf_sr_mean": cf_sr[0], "cf_sr_std": _number(cf_sr[1]),
        "cf_spl_mean": cf_spl[0], "cf_spl_std": _number(cf_spl[1]),
        "sr_mean": float(np.mean([t.success for t in found])),
        "collisions_mean": float(np.mean([t.collisions for t in found])),
        "seeds": len(found), "episodes": len(found[0].success),
        "commit": ", ".join(sorted({t.commit for t in found})),
    }  # fmt: skip


def _difference(found: Sequence[np.ndarray], plain: Sequence[np.ndarray]) -> np.ndarray:
    """float64 [seeds, N], paired."""
    return np.array(found, float) - np.array(plain, float)


def _paper_gain(row: Row, rows: Sequence[Row]) -> float | None:
    if not (row.paper and row.against):
        return None
    of = (row.table, row.model, row.split, row.against)
    plain = next(r for r in rows if (r.table, r.model, r.split, r.method) == of)
    assert plain.paper
    return round((row.paper.cf_sr[0] - plain.paper.cf_sr[0]) / 100, 3)


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
