"""The reliability diagram of collision probabilities; measures: ``cfnav_core.task.calibration``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cfnav_core.task.calibration import bins
from cfnav_core.task.intervals import share_interval


def diagram(p: np.ndarray, y: np.ndarray, title: str, path: Path) -> None:
    """Draw observed against predicted with 95 % intervals, and how many predictions fall where."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (top, bottom) = plt.subplots(
        2, 1, figsize=(5.5, 7), height_ratios=(3, 1), sharex=True, layout="constrained"
    )
    top.plot((0, 1), (0, 1), color="0.6", linestyle="--", label="exactly right")
    for equal_count, colour, name in ((False, "C0", "width"), (True, "C1", "count")):
        found = bins(p, y, equal_count)
        low, high = np.transpose([share_interval(b.observed, b.count) for b in found])
        x, observed = ([getattr(b, f) for b in found] for f in ("predicted", "observed"))
        error = [np.array(observed) - low, high - np.array(observed)]
        top.errorbar(
            x, observed, error, color=colour, marker="o", ms=4, lw=1, capsize=2,
            label=f"bins of equal {name}",
        )  # fmt: skip
    top.set(ylabel="share that collided", title=title, xlim=(0, 1), ylim=(0, 1))
    top.legend(loc="upper left", frameon=False)
    bottom.hist(p, bins=np.linspace(0, 1, 41), color="0.5")
    bottom.set(yscale="log", xlabel="predicted probability of a collision", ylabel="motions")
    figure.savefig(path, dpi=130)
    plt.close(figure)
