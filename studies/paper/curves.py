"""Learning curves: CF-SR in training rooms and in rooms never trained in, over episodes.

The paper's figures: the methods of Table II, and those of the ablation. "Training" are the episodes
of training itself, with drawn actions; "unseen" are the validation rooms with the most probable
actions, as test rooms are looked at once and not along the way.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from cfnav_core.agent.methods import METHODS
from cfnav_core.learn.run_files import LOG
from studies.engine.jobs import GridFolders, Job
from studies.engine.pages import spread, table
from studies.engine.pictures import COLOURS, CURVES, save_picture
from studies.engine.statistics import over_seeds

PANELS = {
    "cf_sr": "training rooms, actions drawn",
    "validation_cf_sr": "unseen rooms (validation), most probable actions",
}

LAST = 2
"""Points at the end of a curve whose mean is said."""


@dataclass(frozen=True)
class Curve:
    """Over one run.

    Attributes:
        episodes: int64 [N], of each validation.
        values: float64 [N] by name in the log.
    """

    episodes: np.ndarray
    values: dict[str, np.ndarray]

    @classmethod
    def read(cls, job: Job, places: GridFolders) -> Curve:
        """The log of a run, that of the stage one which it goes on from before it.

        Raises:
            FileNotFoundError: the run was not made.
        """
        lines = _log(job, places)
        if job.stage1:
            # at the end of its stage one the other run already validated with p_hat fed
            until = job.config.hyperparameters.stage1_episodes
            lines = [s for s in _log(job.stage1, places) if s["episodes"] < until] + lines
        return cls(
            np.array([line["episodes"] for line in lines]),
            {name: np.array([line[name] for line in lines]) for name in PANELS},
        )


@dataclass(frozen=True)
class Learned:
    """The curves of a method.

    Attributes:
        name: of its row. seeds: curves of its runs.
        stage2_from: episodes when stage two begins, None where it is as stage one.
        told: in training it is fed the true flag, in unseen rooms its own prediction.
    """

    name: str
    seeds: Sequence[Curve]
    stage2_from: int | None = None
    told: bool = False

    def ends(self, key: str) -> np.ndarray:
        """float64 [seeds, LAST], the ends of its curves."""
        return np.array([curve.values[key][-LAST:] for curve in self.seeds])

    @classmethod
    def read(cls, name: str, jobs: Sequence[Job], places: GridFolders) -> Learned:
        """Those of runs of one configuration.

        Raises:
            FileNotFoundError: a run was not made.
        """
        method, config = METHODS[jobs[0].method], jobs[0].config
        begins = config.hyperparameters.stage1_episodes
        return cls(
            name, [Curve.read(job, places) for job in jobs],
            begins if method.stage1 != method.stage2 else None, method.stage2.feed_truth,
        )  # fmt: skip


def _log(job: Job, places: GridFolders) -> list[dict[str, float]]:
    path = job.options(places).out / LOG
    return [json.loads(line) for line in path.read_text().splitlines()]


def draw_curves(curves: Sequence[Learned], path: Path) -> None:
    """Draw methods beside one another: means over seeds, with bands of a standard deviation.

    Args:
        curves: of the methods, ours last.
        path: PNG file.

    Raises:
        WriteError: the picture cannot be written.
    """
    colours = (*COLOURS[: len(curves) - 1], COLOURS[-1])
    with mpl.rc_context(CURVES):
        figure = Figure(figsize=(10.5, 3.6), layout="constrained")
        axes = figure.subplots(1, 2, sharey=True)
        for ax, (key, title) in zip(axes, PANELS.items(), strict=True):
            for of, colour in zip(curves, colours, strict=True):
                x, y = _together(of.seeds, key)
                y = 100 * y
                ax.plot(x / 1000, y.mean(0), color=colour, label=of.name, lw=1.5)
                if len(y) > 1:
                    low, high = y.mean(0) - y.std(0, ddof=1), y.mean(0) + y.std(0, ddof=1)
                    ax.fill_between(x / 1000, low, high, color=colour, alpha=0.15, lw=0)
                if of.stage2_from is not None:
                    begins = np.interp(of.stage2_from, x, y.mean(0))
                    ax.plot(of.stage2_from / 1000, begins, "o", color=colour, ms=4)
            ax.plot([], [], "o", color="0.5", ms=4, label="stage two begins")
            ax.fill_between([], [], color="0.5", alpha=0.3, lw=0, label="± std over seeds")
            ax.set(title=title, xlabel="episodes, thousands", ylim=(0, 100))
        axes[0].set_ylabel("CF-SR, %")
        named = axes[0].get_legend_handles_labels()
        figure.legend(*named, loc="outside right upper", frameon=False, fontsize=8)
        save_picture(figure, path)


def gaps_as_markdown(curves: Sequence[Learned]) -> str:
    """How far each method is better where it was trained, percent, at the ends of its curves.

    Args:
        curves: as ``draw_curves`` takes them.
    """
    known, unseen = PANELS
    columns = {
        "method": lambda of: of.name,
        "training rooms": lambda of: spread(*over_seeds(of.ends(known))),
        "unseen rooms": lambda of: spread(*over_seeds(of.ends(unseen))),
        "gap": lambda of: spread(*over_seeds(of.ends(known) - of.ends(unseen))),
    }
    page = table(columns, curves)
    if told := [of.name for of in curves if of.told]:
        page += (
            f"\n{', '.join(told)}: fed the true flag in training rooms, its own prediction in "
            "unseen ones, so that its gap is of this too.\n"
        )
    return page


def _together(curves: Sequence[Curve], key: str) -> tuple[np.ndarray, np.ndarray]:
    """Seeds at the same episodes: those of the first, the others' read between theirs."""
    x = curves[0].episodes
    return x, np.stack([np.interp(x, c.episodes, c.values[key]) for c in curves])
