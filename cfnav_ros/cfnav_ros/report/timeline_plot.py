"""The picture of one drive over time: actions, what the bundles say, p_hat, clearance, contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cfnav_core.task.actions import STEP_M, Action
from cfnav_ros.bags.evaluation import EvaluatedDrive
from cfnav_ros.bags.judge.contacts import SOURCES
from cfnav_ros.lidar.estimate import Verdict
from cfnav_ros.report.plot_theme import (
    ACTION_STYLE,
    BUNDLE_STYLE,
    LIDAR_STYLE,
    LIGHT,
    SOURCE_STYLE,
    Theme,
    png,
    style,
)

MOST_BUNDLES = len(BUNDLE_STYLE)

MANY = 60
"""Between so many bars, gaps would hide the bars."""


@dataclass(frozen=True)
class Bar:
    """One driven action; nanoseconds of the bag's one time."""

    start_ns: int
    end_ns: int
    action: Action
    vetoed: bool = False


def driven_bars(evaluated: EvaluatedDrive) -> list[Bar]:
    """The driven actions: as the policy decided, else as they were inferred for the replay."""
    decisions = evaluated.drive.decisions
    if decisions:
        ends = [*(d.t_ns for d in decisions[1:]), evaluated.drive.end_ns]
        return [
            Bar(d.t_ns, end, d.action, d.vetoed) for d, end in zip(decisions, ends, strict=True)
        ]
    by_step = {step.step: step for step in evaluated.steps}
    return [Bar(s.t_ns, s.until_ns, s.driven, s.driven_vetoed) for s in by_step.values()]


def timeline_png(evaluated: EvaluatedDrive, bundles: Sequence[str], theme: Theme = LIGHT) -> bytes:
    """Draw a drive over time; returns a PNG file.

    Args:
        evaluated: the drive.
        bundles: names of those that were replayed; the first ``MOST_BUNDLES`` are drawn.
        theme: light or dark.
    """
    names = list(bundles)[:MOST_BUNDLES]
    sources = [s for s in SOURCES if evaluated.drive.contacts.get(s)]
    rows = 1 + len(names) + len(sources)
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(5, 2.9 + 0.3 * rows), facecolor=theme.paper, layout="constrained")
        top, middle, bottom = figure.subplots(
            3, 1, sharex=True, gridspec_kw={"height_ratios": [0.24 * rows + 0.1, 1, 1]}
        )
        _draw_actions(top, evaluated, names, theme)
        _draw_sources(top, evaluated, sources, 1 + len(names), theme)
        _draw_probability(middle, evaluated, names, theme)
        _draw_clearance(bottom, evaluated, theme)
        for axes in (top, middle, bottom):
            style(axes, theme)
            for contact in evaluated.contacts:
                time = evaluated.drive.since_start(contact.t_ns)
                axes.axvline(time, color=theme.red, linewidth=1.2)
        top.spines["left"].set_visible(False)
        top.tick_params(left=False)
        bottom.set_xlim(0, max(evaluated.drive.seconds, 0.1))
        bottom.set_xlabel("time (s); red line: collision" if evaluated.contacts else "time (s)")
        return png(figure)


def _draw_actions(
    axes: Axes, evaluated: EvaluatedDrive, names: Sequence[str], theme: Theme
) -> None:
    """The driven actions, and below them those of each bundle where it would do another."""
    driven = driven_bars(evaluated)
    others = [
        [
            Bar(s.t_ns, s.until_ns, s.action)
            for s in evaluated.steps
            if s.bundle == name and not s.agrees
        ]
        for name in names
    ]
    gap = 0.8 if len(driven) < MANY else 0.0
    for row, bars in enumerate([driven, *others]):
        for vetoed, hatch in ((False, None), (True, "////")):
            shown = [bar for bar in bars if bar.vetoed == vetoed]
            # drawn at once: a drive may have thousands
            axes.broken_barh(
                [
                    (
                        evaluated.drive.since_start(bar.start_ns),
                        max((bar.end_ns - bar.start_ns) * 1e-9, 0.1),
                    )
                    for bar in shown
                ],
                (row - 0.4, 0.8),
                facecolors=[ACTION_STYLE[bar.action][0] for bar in shown],
                edgecolor=theme.paper,
                lw=gap,
                hatch=hatch,
            )
    labels = ["driven", *(_short(name) for name in names)]
    axes.set_yticks(range(len(labels)), labels)


def _draw_sources(
    axes: Axes, evaluated: EvaluatedDrive, sources: Sequence[str], first: int, theme: Theme
) -> None:
    """Contacts by each source that had any, a row each."""
    for row, source in enumerate(sources, first):
        times = [evaluated.drive.since_start(c.t_ns) for c in evaluated.drive.contacts[source]]
        axes.plot(times, [row] * len(times), SOURCE_STYLE[source], color=theme.ink, markersize=5)
    labels = [label.get_text() for label in axes.get_yticklabels()]
    axes.set_yticks(range(first + len(sources)), [*labels, *sources])
    axes.set_ylim(first + len(sources) - 0.45, -0.55)


def _draw_probability(
    axes: Axes, evaluated: EvaluatedDrive, names: Sequence[str], theme: Theme
) -> None:
    """p_hat of every scan, as given to the decisions, and of the bundles' own predictors."""
    estimates = evaluated.drive.estimates
    axes.plot(estimates[:, 0], estimates[:, 1], color=LIDAR_STYLE[0], lw=1)
    for number, (name, (colour, marker)) in enumerate(zip(names, BUNDLE_STYLE, strict=False)):
        steps = [s for s in evaluated.steps if s.bundle == name]
        times = [evaluated.drive.since_start(s.t_ns) for s in steps]
        axes.plot(times, [s.p_hat_rgb for s in steps], marker, color=colour,
                  markersize=6 - number, markeredgewidth=0)  # fmt: skip
    decisions = evaluated.drive.decisions
    asked = [evaluated.drive.since_start(d.t_ns) for d in decisions]
    given = [d.collision_probability for d in decisions]
    axes.plot(asked, given, "o", color=theme.ink, markersize=2.5)
    axes.set_ylim(-0.05, 1.05)
    axes.set_ylabel("p̂")


def _draw_clearance(axes: Axes, evaluated: EvaluatedDrive, theme: Theme) -> None:
    """Clearance ahead by every scan; a scan that saw nothing leaves a gap."""
    estimates = evaluated.drive.estimates
    blind = estimates[:, 3] == Verdict.BLIND
    clearance = np.where(blind, np.nan, estimates[:, 2])
    axes.plot(estimates[:, 0], clearance, color=LIDAR_STYLE[0], lw=1)
    axes.axhline(STEP_M, color=theme.ink, lw=0.8, ls=":")
    axes.set_ylim(bottom=0)
    axes.set_ylabel("clearance (m)")


def _short(name: str) -> str:
    """A name that fits beside a picture."""
    return name if len(name) <= 10 else name[:9] + "…"
