"""From episodes of tested rows to figures by name: means over seeds, differences, intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from studies.engine.row import Row
from studies.engine.statistics import over_seeds

Figures = dict[str, Any]
"""One row's figures under the names in ``FIGURES``, None where it has none."""

Interval = Callable[[np.ndarray, np.ndarray], tuple[float, float] | None]
"""Of a mean: takes differences [seeds, episodes] and the rooms [episodes]."""

FIGURES = (
    # what was tested, and the preset of its sizes and numbers
    "table", "row", "model", "method", "split", "p_hat", "veto", "preset",
    # means over seeds and their standard deviation over these, None for one seed; collisions are
    # those of an episode
    "cf_sr_mean", "cf_sr_std", "cf_spl_mean", "cf_spl_std", "sr_mean", "collisions_mean",
    "seeds", "episodes",
    # what made it: the hash of the first seed's configuration, the commits that trained it and
    # those that tested or drove it
    "command", "config_hash", "commit", "tested_at",
    # actions were drawn
    "sample",
    "paper_cf_sr", "paper_cf_sr_std", "paper_cf_spl", "paper_cf_spl_std", "paper_gain",
    # over the row's reference, paired by seed and episode, with intervals over seeds and rooms
    "gain", "gain_ci95", "gain_by_seed", "sr_gain", "sr_gain_ci95",
    # CF-SR minus that of the same policies with their own p_hat and without veto; minus that of
    # plain under the same veto; that of the paper's method minus the row's
    "over_own", "over_own_ci95", "over_vetoed", "over_vetoed_ci95", "ours_over", "ours_over_ci95",
    # shares of the episodes with a collision, and of the live trials that were given up
    "touched_mean", "aborted_mean",
    # over the episodes whose shortest way is long
    "long_episodes", "long_cf_sr_mean", "long_gain", "long_gain_ci95",
)  # fmt: skip
"""Every figure of a row, in the order of JSON and CSV. Rates are shares of 1, the paper's too."""


@dataclass(frozen=True)
class Results:
    """What the policies of a row did, episode by episode.

    Attributes:
        success: bool [R, N] of R training seeds. collisions: int64 [R, N].
        path, shortest: float64 [R, N], in actions, Done included, or in metres.
        rooms: [N], names of the rooms, the same for every seed.
        commits: of the code that trained them. tested_at: of the code that tested or drove them.
        identity: of the episodes; only rows of the same ones are compared.
        long: bool [N], episodes whose shortest way has at least ``LONG_EPISODE`` actions; None
            where lengths are in metres.
        aborted: bool [R, N], live trials that the policy node gave up.
    """

    success: np.ndarray
    collisions: np.ndarray
    path: np.ndarray
    shortest: np.ndarray
    rooms: np.ndarray
    commits: frozenset[str]
    tested_at: frozenset[str]
    identity: str = ""
    long: np.ndarray | None = None
    aborted: np.ndarray | None = None

    @property
    def cf_success(self) -> np.ndarray:
        """float64 [R, N], S_i of Eq. 1."""
        return (self.success & (self.collisions == 0)).astype(float)

    @property
    def cf_efficiency(self) -> np.ndarray:
        """float64 [R, N], the terms of CF-SPL."""
        return self.cf_success * self.shortest / np.maximum(self.path, self.shortest)

    @classmethod
    def load(cls, paths: Sequence[Path]) -> Results:
        """Read what ``save`` wrote of every seed's run.

        Raises:
            ValueError: a file is not there, or runs met different episodes.
        """
        # it loads torch, which live trials do without
        from cfnav_core.learn.evaluate import LONG_EPISODE

        files = [_read(path) for path in paths]
        first = files[0]
        if len({str(file["identity"]) for file in files}) > 1:
            raise ValueError(f"found runs that met different episodes in {paths[0]}; test anew")
        names = ("success", "collisions", "path", "shortest")
        commits, tested_at = (
            frozenset(str(file[name]) for file in files) for name in ("commit", "tested_at")
        )
        return cls(
            **{name: np.stack([file[name] for file in files]) for name in names},
            rooms=first["rooms"], commits=commits, tested_at=tested_at,
            identity=str(first["identity"]), long=first["shortest"] >= LONG_EPISODE,
        )  # fmt: skip


def _read(path: Path) -> dict[str, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file.items())
    except OSError as error:
        raise ValueError(f"found no readable results in {path} ({error}); test it") from error


class ResultSource(Protocol):
    """Where rows were tested: in a grid, or on the live graph."""

    @property
    def interval(self) -> Interval:
        """How sure a mean difference is."""
        ...

    def results(self, row: Row) -> Results | None:
        """Of a row, None when it is none of those that are compared here."""
        ...

    def about(self, row: Row) -> Figures:
        """What figures say of how the row was made: split, preset, command, config_hash."""
        ...


def figures_of(row: Row, source: ResultSource, rows: Sequence[Row]) -> Figures:
    """The figures of a tested row.

    Args:
        row: that was tested.
        source: where.
        rows: all of them, among which stands the one that the paper compares it with.

    Raises:
        ValueError: a run was not tested yet, or runs met different episodes.
    """
    found = source.results(row)
    assert found, row.name
    figures: Figures = {
        "table": row.table, "row": row.name, "model": row.model, "method": row.method,
        "p_hat": row.p_hat, "veto": row.veto, "sample": row.sample,
    }  # fmt: skip
    figures |= source.about(row) | measured(found) | _published(row, rows)
    for name, of in (("over_own", row.itself), ("over_vetoed", row.vetoed)):
        if of and (other := source.results(of)):
            figures |= compared(name, found, other, source.interval)
    if row.reference and (plain := source.results(row.reference)):
        figures |= _gains(found, plain, source.interval)
    if row.rival and (ours := source.results(row.rival)):
        figures |= compared("ours_over", ours, found, source.interval)
    return complete(figures)


def complete(figures: Figures) -> Figures:
    """Every figure under its name, in order, None for those that are not there."""
    return {name: figures.get(name) for name in FIGURES}


def measured(of: Results) -> Figures:
    """Means over seeds and episodes."""
    figures: Figures = {
        "sr_mean": float(of.success.mean()),
        "touched_mean": float((of.collisions > 0).mean()),
        "collisions_mean": float(of.collisions.mean()),
        "seeds": len(of.success), "episodes": len(of.rooms),
        "commit": ", ".join(sorted(of.commits)), "tested_at": ", ".join(sorted(of.tested_at)),
    }  # fmt: skip
    for name, values in (("cf_sr", of.cf_success), ("cf_spl", of.cf_efficiency)):
        figures[f"{name}_mean"], figures[f"{name}_std"] = over_seeds(values)
    if of.aborted is not None:
        figures["aborted_mean"] = float(of.aborted.mean())
    if of.long is not None:
        figures["long_episodes"] = int(of.long.sum())
        if of.long.any():
            figures["long_cf_sr_mean"] = float(of.cf_success[:, of.long].mean())
    return figures


def compared(
    name: str, of: Results, other: Results, interval: Interval, rate: str = "cf_success",
    among: np.ndarray | None = None,
) -> Figures:  # fmt: skip
    """How much higher a rate is, paired by seed and episode, and an interval.

    Args:
        name: of the figure.
        of, other: tested on the same episodes.
        interval: of a mean.
        rate: attribute of ``Results``.
        among: bool [N], only these episodes.

    Raises:
        ValueError: they met different episodes.
    """
    if of.identity != other.identity:
        raise ValueError("found compared runs that met different episodes; test anew")
    chosen = np.ones(len(of.rooms), bool) if among is None else among
    difference = getattr(of, rate).astype(float) - getattr(other, rate)
    ends = interval(difference[:, chosen], of.rooms[chosen])
    return {name: float(difference[:, chosen].mean()), f"{name}_ci95": ends}


def _gains(of: Results, plain: Results, interval: Interval) -> Figures:
    by_seed = (of.cf_success - plain.cf_success).mean(1)
    gains = compared("gain", of, plain, interval)
    gains |= compared("sr_gain", of, plain, interval, "success")
    if of.long is not None and of.long.any():
        gains |= compared("long_gain", of, plain, interval, among=of.long)
    return gains | {"gain_by_seed": tuple(by_seed.round(4).tolist())}


def _published(row: Row, rows: Sequence[Row]) -> Figures:
    """What the paper says, shares of 1."""
    if row.paper is None:
        return {}
    said = dict(zip(("cf_sr", "cf_sr_std"), row.paper.cf_sr, strict=True))
    said |= dict(zip(("cf_spl", "cf_spl_std"), row.paper.cf_spl, strict=True))
    if row.against:
        key = (row.table, row.model, row.split, row.against)
        of = next(r.paper for r in rows if (r.table, r.model, r.split, r.method) == key)
        assert of
        said["gain"] = row.paper.cf_sr[0] - of.cf_sr[0]
    return {f"paper_{name}": _share(value) for name, value in said.items()}


def _share(value: float | None) -> float | None:
    return None if value is None else round(value / 100, 3)
