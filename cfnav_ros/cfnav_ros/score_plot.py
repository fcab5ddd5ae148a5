"""Pictures of how well collisions were foretold: reliability, ROC, precision and recall."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cfnav_ros.bags.scores import CollisionScores
from cfnav_ros.plot_theme import BLUE, LIDAR_STYLE, LIGHT, Theme, png, style

RGB_STYLE = (BLUE, "s")
"""Colour and marker of the bundle's own predictor."""

Named = Sequence[tuple[str, CollisionScores, tuple[str, str]]]
"""What is drawn: its name, its scores, its colour and marker."""


def reliability_png(lidar: CollisionScores, rgb: CollisionScores, theme: Theme = LIGHT) -> bytes:
    """How often it collided at which p_hat; returns a PNG file."""
    return _picture(lidar, rgb, theme, "p̂", "share that collided", _reliability)


def roc_png(lidar: CollisionScores, rgb: CollisionScores, theme: Theme = LIGHT) -> bytes:
    """True over false alarms; returns a PNG file."""
    return _picture(lidar, rgb, theme, "false positive rate", "true positive rate", _roc)


def precision_recall_png(
    lidar: CollisionScores, rgb: CollisionScores, theme: Theme = LIGHT
) -> bytes:
    """Precision over recall; returns a PNG file."""
    return _picture(lidar, rgb, theme, "recall", "precision", _precision_recall)


def _picture(
    lidar: CollisionScores,
    rgb: CollisionScores,
    theme: Theme,
    below: str,
    beside: str,
    draw: Callable[[Axes, Named, Theme], None],
) -> bytes:
    named = (("LiDAR", lidar, LIDAR_STYLE), ("RGB", rgb, RGB_STYLE))
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(3.5, 3.5), facecolor=theme.paper, layout="constrained")
        axes = figure.add_subplot()
        draw(axes, [row for row in named if row[1].moves], theme)
        style(axes, theme)
        axes.set_xlim(-0.03, 1.03)
        axes.set_ylim(-0.03, 1.03)
        axes.set_aspect("equal")
        axes.set_xlabel(below)
        axes.set_ylabel(beside)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8, frameon=False, labelcolor=theme.ink, loc="best")
        return png(figure)


def _reliability(axes: Axes, named: Named, theme: Theme) -> None:
    axes.plot([0, 1], [0, 1], color=theme.ink, lw=0.8, ls=":")
    for name, scores, (colour, marker) in named:
        sizes = 15 + 150 * np.array([b.count for b in scores.bins]) / scores.moves
        x, y = [b.predicted for b in scores.bins], [b.observed for b in scores.bins]
        axes.plot(x, y, color=colour, lw=0.8, alpha=0.5)
        axes.scatter(x, y, sizes, color=colour, marker=marker, alpha=0.9, zorder=3)
        axes.plot([], [], marker, color=colour, label=name)


def _roc(axes: Axes, named: Named, theme: Theme) -> None:
    axes.plot([0, 1], [0, 1], color=theme.ink, lw=0.8, ls=":")
    for name, scores, (colour, marker) in named:
        curve = scores.roc
        if len(curve):
            axes.plot(curve[:, 1], curve[:, 2], color=colour, marker=marker, ms=3, lw=1.5,
                      markevery=_apart(len(curve)), label=name)  # fmt: skip


def _precision_recall(axes: Axes, named: Named, theme: Theme) -> None:
    for name, scores, (colour, marker) in named:
        base = scores.collisions / scores.moves
        axes.axhline(base, color=theme.ink, lw=0.8, ls=":")
        curve = scores.precision_recall
        if len(curve):
            axes.plot(curve[:, 2], curve[:, 1], color=colour, marker=marker, ms=3, lw=1.5,
                      ds="steps-pre", markevery=_apart(len(curve)), label=name)  # fmt: skip


def _apart(points: int) -> int:
    """Every how many points of a curve a marker stands."""
    return max(points // 12, 1)
