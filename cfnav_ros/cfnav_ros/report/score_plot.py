"""Pictures of how well collisions were foretold: reliability, ROC, precision and recall."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cfnav_ros.bags.replay.scores import CollisionScores
from cfnav_ros.report.plot_theme import BLUE, LIDAR_STYLE, LIGHT, Theme, png, style

RGB_STYLE = (BLUE, "s")
"""Colour and marker of the bundle's own predictor."""

Named = Sequence[tuple[str, CollisionScores, tuple[str, str]]]
"""What is drawn: its name, its scores, its colour and marker."""


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


@dataclass(frozen=True)
class Diagram:
    """A kind of picture: what draws it, the names of its axes, its caption."""

    draw: Callable[[Axes, Named, Theme], None]
    below: str
    beside: str
    caption: str


RELIABILITY = Diagram(
    _reliability,
    "p̂",
    "share that collided",
    "Reliability: on the dotted line p̂ is right; larger marks hold more moves",
)
CURVES = (
    Diagram(
        _roc,
        "false positive rate",
        "true positive rate",
        "ROC: alarms that came true over false ones; dotted: chance",
    ),
    Diagram(
        _precision_recall,
        "recall",
        "precision",
        "Precision over recall; dotted: share of moves that collided",
    ),
)
"""Those that need moves that collided and moves that did not."""


def score_png(
    diagram: Diagram, lidar: CollisionScores, rgb: CollisionScores, theme: Theme = LIGHT
) -> bytes:
    """Draw how well both predictors foretold collisions; returns a PNG file."""
    named = (("LiDAR", lidar, LIDAR_STYLE), ("RGB", rgb, RGB_STYLE))
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(3.5, 3.5), facecolor=theme.paper, layout="constrained")
        axes = figure.add_subplot()
        diagram.draw(axes, [row for row in named if row[1].moves], theme)
        style(axes, theme)
        axes.set_xlim(-0.03, 1.03)
        axes.set_ylim(-0.03, 1.03)
        axes.set_aspect("equal")
        axes.set_xlabel(diagram.below)
        axes.set_ylabel(diagram.beside)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8, frameon=False, labelcolor=theme.ink, loc="best")
        return png(figure)
