"""Tested runs -> rows of figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfnav_core.benchmark.chance import chance
from cfnav_core.benchmark.jobs import Job, Places
from cfnav_core.benchmark.pages import Figures
from cfnav_core.benchmark.presets import PRESETS, PresetName
from cfnav_core.benchmark.rows import WITH_LIDAR, Row, Split
from cfnav_core.benchmark.stamps import made_of
from cfnav_core.benchmark.statistics import interval, over_seeds
from cfnav_core.benchmark.tested import FrozenTest, Tested
from cfnav_core.config import PHat


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

    def job(self, row: Row, seed: int) -> Job:
        """A run of a row."""
        return Job.of_row(row, seed, self.preset, self.perception)

    def test(self, row: Row) -> FrozenTest:
        """The test of a row."""
        return self.frozen(row.split, row.p_hat, row.veto)

    def frozen(self, split: Split, p_hat: PHat = "own", veto: bool = False) -> FrozenTest:
        """A test on a split's frozen episodes."""
        frozen = self.episodes / f"{split}_test.json"
        of = made_of(self.places.scenes, frozen, veto or p_hat in WITH_LIDAR)
        return FrozenTest(p_hat, veto, frozen, PRESETS[self.preset].test_episodes, of)

    def tested(self, row: Row) -> list[Tested]:
        """Results by seed.

        Raises:
            FileNotFoundError: a run was not tested yet.
        """
        return [Tested.load(path) for path in self.results(row)]

    def results(self, row: Row) -> list[Path]:
        """Files of a row's results by seed."""
        file = self.test(row).file
        runs = (self.job(row, seed) for seed in range(self.seeds))
        return [run.options(self.places).out / file for run in runs]


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
    gain = sr_gain = over_own = None
    if row.itself:
        own = bench.tested(row.itself)
        over_own = _difference([t.cf_success for t in found], [t.cf_success for t in own])
    if row.reference:
        plain = bench.tested(row.reference)
        if len({t.identity for t in (*found, *plain)}) > 1:
            raise ValueError(f"found runs of {row.name} that met different episodes; test anew")
        gain = _difference([t.cf_success for t in found], [t.cf_success for t in plain])
        sr_gain = _difference([t.success for t in found], [t.success for t in plain])
    rooms = found[0].rooms
    return Figures(
        table=row.table, row=row.name, model=row.model, method=row.method, split=row.split,
        p_hat=row.p_hat, veto=row.veto, preset=bench.preset,
        paper_cf_sr=round(row.paper.cf_sr[0] / 100, 3) if row.paper else None,
        paper_cf_spl=round(row.paper.cf_spl[0] / 100, 3) if row.paper else None,
        paper_gain=_paper_gain(row, rows),
        **_measured(found),
        gain=None if gain is None else float(gain.mean()),
        gain_ci95=None if gain is None else interval(gain, rooms),
        sr_gain=None if sr_gain is None else float(sr_gain.mean()),
        sr_gain_ci95=None if sr_gain is None else interval(sr_gain, rooms),
        over_own=None if over_own is None else float(over_own.mean()),
        over_own_ci95=None if over_own is None else interval(over_own, rooms),
        command=bench.command, config_hash=bench.job(row, 0).hash,
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
        veto=False, preset="", paper_cf_sr=None, paper_cf_spl=None, paper_gain=None,
        **_measured(found), gain=None, gain_ci95=None, sr_gain=None, sr_gain_ci95=None,
        over_own=None, over_own_ci95=None,
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
        "commit": _all({t.commit for t in found}), "tested_at": _all({t.tested_at for t in found}),
    }  # fmt: skip


def _all(commits: set[str]) -> str:
    return ", ".join(sorted(commits))


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
