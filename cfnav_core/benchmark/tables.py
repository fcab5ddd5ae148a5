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
from cfnav_core.benchmark.stamps import Made
from cfnav_core.benchmark.statistics import interval, over_seeds
from cfnav_core.benchmark.tested import FrozenTest, Tested
from cfnav_core.config import PHat
from cfnav_core.scene import LIDAR


@dataclass(frozen=True)
class Bench:
    """What the rows were made with.

    Attributes:
        places: of the grid. episodes: folder of the frozen test episodes.
        seeds: of each row. preset: of sizes and numbers. made: what tests are made of.
        command: that made the rows. first_seed: the other seeds follow it.
    """

    places: Places
    episodes: Path
    seeds: int
    preset: PresetName
    made: Made
    command: str
    first_seed: int = 0

    @property
    def every_seed(self) -> range:
        """The training seeds."""
        return range(self.first_seed, self.first_seed + self.seeds)

    def job(self, row: Row, seed: int) -> Job:
        """A run of a row."""
        return Job.of_row(row, seed, self.preset, self.made.perception)

    def test(self, row: Row) -> FrozenTest:
        """The test of a row."""
        return self.frozen(row.split, row.p_hat, row.veto, row.sample)

    def frozen(
        self, split: Split, p_hat: PHat = "own", veto: bool = False, sample: bool = False
    ) -> FrozenTest:
        """A test on a split's frozen episodes.

        Raises:
            ValueError: it was not noted what it is made of.
        """
        key = f"{split} {LIDAR}" if veto or p_hat in WITH_LIDAR else split
        of = self.made.tests.get(key)
        if of is None:
            raise ValueError(
                f"found no test of {key} in {self.places.out}; test it, without --recorded, first"
            )
        most = PRESETS[self.preset].test_episodes
        return FrozenTest(p_hat, veto, episodes_of(self.episodes, split), most, of, sample)

    def tested(self, row: Row) -> list[Tested]:
        """Results by seed.

        Raises:
            ValueError: a run was not tested yet.
        """
        return [Tested.load(path) for path in self.results(row)]

    def results(self, row: Row) -> list[Path]:
        """Files of a row's results by seed."""
        file = self.test(row).file
        runs = (self.job(row, seed) for seed in self.every_seed)
        return [run.options(self.places).out / file for run in runs]


def episodes_of(folder: Path, split: Split) -> Path:
    """The file of a split's frozen test episodes."""
    return folder / f"{split}_test.json"


def figures_of(row: Row, bench: Bench, rows: Sequence[Row]) -> Figures:
    """The figures of a row.

    Args:
        row: whose runs were tested.
        bench: where they are.
        rows: all of them, among which stands what it is compared with.

    Raises:
        ValueError: a run was not tested yet, or runs met different episodes.
    """
    found = bench.tested(row)
    job = bench.job(row, bench.first_seed)
    compared: dict[str, Any] = {}
    if row.itself:
        own = _differences(row, found, bench.tested(row.itself))
        compared |= {"over_own": own["gain"], "over_own_ci95": own["gain_ci95"]}
    if row.vetoed:
        plain = _differences(row, found, bench.tested(row.vetoed))
        compared |= {"over_vetoed": plain["gain"], "over_vetoed_ci95": plain["gain_ci95"]}
    if row.reference:
        compared |= _differences(row, found, bench.tested(row.reference))
    if row.rival:
        ours = _differences(row, bench.tested(row.rival), found)
        compared |= {"ours_over": ours["gain"], "ours_over_ci95": ours["gain_ci95"]}
    return Figures(
        table=row.table, row=row.name, model=row.model, method=row.method, split=row.split,
        p_hat=row.p_hat, veto=row.veto, sample=row.sample, preset=bench.preset,
        **_published(row), paper_gain=_paper_gain(row, rows),
        **_measured(found), **compared,
        command=bench.command, config_hash=job.hash,
    )  # fmt: skip


def figures_of_chance(split: Split, bench: Bench) -> Figures:
    """The figures of drawn actions in a split's test episodes.

    Raises:
        SceneError: the scenes cannot be used.
    """
    test = bench.frozen(split)
    found = [
        chance(test, bench.places.scenes, seed, bench.places.out / f"random_{seed}_{test.file}")
        for seed in bench.every_seed
    ]
    return Figures(
        table="own", row="random", model="none", method="random", split=split, p_hat="own",
        veto=False, sample=True, preset="", **_measured(found), command=bench.command,
        config_hash="",
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
        **_long(found),
        "touched_mean": float(np.mean([t.collisions > 0 for t in found])),
        "collisions_mean": float(np.mean([t.collisions for t in found])),
        "seeds": len(found), "episodes": len(found[0].success),
        "commit": _all({t.commit for t in found}), "tested_at": _all({t.tested_at for t in found}),
    }  # fmt: skip


def _long(found: Sequence[Tested]) -> dict[str, Any]:
    """CF-SR over the longer episodes, where there are any."""
    long = found[0].long
    if not long.any():
        return {"long_episodes": 0}
    rate = float(np.mean([t.cf_success[long] for t in found]))
    return {"long_episodes": int(long.sum()), "long_cf_sr_mean": rate}


def _all(commits: set[str]) -> str:
    return ", ".join(sorted(commits))


def _differences(row: Row, found: Sequence[Tested], plain: Sequence[Tested]) -> dict[str, Any]:
    """Fields of ``Figures`` that compare, paired by seed and episode.

    Raises:
        ValueError: the runs met different episodes.
    """
    if len({t.identity for t in (*found, *plain)}) > 1:
        raise ValueError(f"found runs of {row.name} that met different episodes; test anew")
    rooms, long = found[0].rooms, found[0].long
    cf_sr, sr = (
        np.array([value(t) for t in found], float) - np.array([value(t) for t in plain], float)
        for value in (lambda t: t.cf_success, lambda t: t.success)
    )
    of_long = {
        "long_gain": float(cf_sr[:, long].mean()),
        "long_gain_ci95": interval(cf_sr[:, long], rooms[long]),
    } if long.any() else {}  # fmt: skip
    return {
        "gain": float(cf_sr.mean()), "gain_ci95": interval(cf_sr, rooms),
        "gain_by_seed": tuple(cf_sr.mean(1).round(4).tolist()),
        "sr_gain": float(sr.mean()), "sr_gain_ci95": interval(sr, rooms),
        **of_long,
    }  # fmt: skip


def _published(row: Row) -> dict[str, Any]:
    """What the paper says, shares of 1."""
    if row.paper is None:
        return {}
    named = {"paper_cf_sr": row.paper.cf_sr, "paper_cf_spl": row.paper.cf_spl}
    return {
        f"{name}{of}": round(value / 100, 3)
        for name, values in named.items()
        for of, value in zip(("", "_std"), values, strict=True)
    }


def _paper_gain(row: Row, rows: Sequence[Row]) -> float | None:
    if not (row.paper and row.against):
        return None
    of = (row.table, row.model, row.split, row.against)
    plain = next(r for r in rows if (r.table, r.model, r.split, r.method) == of)
    assert plain.paper
    return round((row.paper.cf_sr[0] - plain.paper.cf_sr[0]) / 100, 3)


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value
