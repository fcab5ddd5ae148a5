"""The figure of Table IV: what each method drove to each goal, from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from cfnav_ros.bags.files.events import OccupancyMap
from cfnav_ros.bags.judge.contacts import Contact
from cfnav_ros.report.plot_theme import GREEN, LIGHT, ORANGE, PURPLE, png
from cfnav_ros.report.trajectory_plot import (
    HULL_RADIUS_M,
    draw_contact,
    draw_path,
    draw_room,
    merged,
)
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import MultipleLocator, NullFormatter

from cfnav_core.task.visibility import VISIBLE_DISTANCE_M

END_POINTS = 20.0
"""Diameter of the ring around the end, so that it goes round a mark of collisions."""

Places = Mapping[str, Sequence[tuple[float, float]]]
"""By goal: x and y of each, metres."""


def _disc(fill: str, edge: str, label: str, width: float = 1.0) -> Line2D:
    return Line2D([], [], ls="", marker="o", ms=9, mfc=fill, mec=edge, mew=width, label=label)


LEGEND = (
    _disc("none", LIGHT.ink, "start"),
    Line2D([], [], ls="", marker="*", ms=9, color=PURPLE, label="the goal"),
    _disc("none", GREEN, f"end: the goal in view within {VISIBLE_DISTANCE_M:g} m", 2.5),
    _disc("none", ORANGE, "end: it was missed", 2.5),
    _disc(LIGHT.red, LIGHT.red, "collisions at one place, how many"),
    Line2D([], [], color=LIGHT.late, lw=3, label="path, light to dark in time"),
    Line2D([], [], ls="", marker="|", color="black", label="ticks: 1 m apart"),
)


def draw_table_iv(
    driven: Mapping[str, Sequence[dict[str, Any]]], maps: Path, places: Mapping[str, Places],
    title: str,
) -> bytes:  # fmt: skip
    """Draw a row of rooms for each method; returns a PNG file.

    Args:
        driven: trials by method, each as ``table_iv`` writes it, all methods the same trials.
        maps: folder of the rooms' maps.
        places: of the goals in each room.
        title: above them all.
    """
    columns = max(len(trials) for trials in driven.values())
    with mpl.rc_context({"font.size": 8}):
        figure = Figure(figsize=(3 * columns, 3.1 * len(driven)), layout="constrained")
        grid = figure.subplots(len(driven), columns, squeeze=False)
        for axes, (name, trials) in zip(grid, driven.items(), strict=True):
            for ax, trial in zip(axes, trials, strict=True):
                room = trial["room"]
                _draw(ax, trial, maps / f"{room.replace(':', '_')}.npz", places[room])
            axes[0].set_ylabel(name, fontsize=10)
        figure.suptitle(title, fontsize=10)
        figure.legend(handles=LEGEND, loc="outside lower center", ncols=4, frameon=False)
        return png(figure)


def _draw(ax: Axes, trial: dict[str, Any], path: Path, places: Places) -> None:
    with np.load(path) as kept:
        room = OccupancyMap(
            t_ns=0, occupied=kept["occupied"], resolution=float(kept["resolution"]), origin=(0, 0)
        )
    draw_room(ax, room, LIGHT)
    ax.plot(*np.transpose(places[trial["goal"]]), "*", color=PURPLE, ms=10, zorder=5)
    track = np.array(trial["track"])
    draw_path(ax, track, LIGHT)
    (x0, y0, _), (x1, y1, _) = track[0], track[-1]
    ax.add_patch(Circle((x0, y0), HULL_RADIUS_M, fill=False, color=LIGHT.ink, lw=1.5, zorder=5))
    colour = GREEN if trial["success"] else ORANGE
    ax.plot(x1, y1, "o", ms=END_POINTS, mfc="none", mec=colour, mew=2.5, zorder=8)
    new = np.diff(track[:, 2], prepend=0)
    hits = [Contact(0, x, y, count=int(n)) for (x, y, _), n in zip(track, new, strict=True) if n]
    for contact in merged(hits):
        draw_contact(ax, contact, LIGHT)
    ended = "reached" if trial["success"] else "missed"
    given_up = ", given up" if trial["outcome"] == "aborted" else ""
    what = f"{ended}{given_up}, collisions: {trial['collisions']}"
    ax.set_title(f"{trial['goal']} in {trial['room']}\n{what}")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MultipleLocator(1.0))
        axis.set_major_formatter(NullFormatter())
