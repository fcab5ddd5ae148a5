"""Pictures of one episode: the room from above with the driven path, and a timeline.

Colours are those of Okabe and Ito, told apart by colour-blind readers; every colour is doubled by
a shape, a number or a letter. Each picture comes in a light and a dark theme.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

from cfnav_core.actions import Action
from cfnav_core.visibility import VISIBLE_DISTANCE_M
from cfnav_ros.bag_reader import RoomMap
from cfnav_ros.outcome import Contact, Episode

HULL_RADIUS_M = 0.175
VIEW_DEG = 90.0
"""Horizontal field of view of the camera, degrees."""

ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip

ACTION_STYLE = {
    Action.MoveAhead: (BLUE, "↑"),
    Action.RotateLeft: (SKY, "↺"),
    Action.RotateRight: (ORANGE, "↻"),
    Action.LookUp: (YELLOW, "△"),
    Action.LookDown: (PURPLE, "▽"),
    Action.Done: (GREEN, "■"),
}
"""Colour and sign of each action."""

_SAME_PLACE_M = 0.25
"""Marks of contacts nearer than this would cover each other."""


@dataclass(frozen=True)
class Theme:
    """Colours that depend on the background."""

    paper: str
    ink: str
    floor: str
    solid: str
    early: str
    late: str
    red: str


LIGHT = Theme("#ffffff", "#22262b", "#f1efe9", "#8a8f98", "#b9dcf5", "#08306b", "#c62828")
DARK = Theme("#1b1e23", "#e4e6ea", "#2b2f36", "#717783", "#e8f4fd", "#2b8bd6", "#ff6b5e")
THEMES = {"light": LIGHT, "dark": DARK}


def trajectory_png(episode: Episode, room: RoomMap | None, theme: Theme = LIGHT) -> bytes:
    """Draw the room from above with start, path, collisions and the last pose.

    Args:
        episode: the episode; its truths give the path.
        room: occupancy of the room; without it only the path is drawn.
        theme: light or dark.

    Returns:
        A PNG file.
    """
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(5, 5), facecolor=theme.paper, layout="constrained")
        axes = figure.add_subplot()
        if room is not None:
            _draw_room(axes, room, theme)
        _draw_path(axes, episode, theme)
        _draw_ends(axes, episode, theme)
        for contact in _merged(episode.contacts):
            _draw_contact(axes, contact, theme)
        _style(axes, theme)
        axes.set_aspect("equal")
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        if room is None:
            axes.margins(0.3)
        return _png(figure, bbox_inches="tight", pad_inches=0.04)


def timeline_png(episode: Episode, theme: Theme = LIGHT) -> bytes:
    """Draw actions, collision probability and clearance over the episode; returns a PNG file."""
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(5, 3.6), facecolor=theme.paper, layout="constrained")
        top, middle, bottom = figure.subplots(
            3, 1, sharex=True, gridspec_kw={"height_ratios": [0.5, 1, 1]}
        )
        _draw_actions(top, episode, theme)
        _draw_probability(middle, episode, theme)
        _draw_clearance(bottom, episode, theme)
        for axes in (top, middle, bottom):
            _style(axes, theme)
            for contact in episode.contacts:
                axes.axvline(_seconds(episode, contact.t_ns), color=theme.red, linewidth=1.5)
        bottom.set_xlabel("time (s); red line: collision" if episode.contacts else "time (s)")
        return _png(figure)


def _draw_room(axes: Axes, room: RoomMap, theme: Theme) -> None:
    height, width = room.occupied.shape
    (x, y), size = room.origin, room.resolution
    axes.imshow(
        room.occupied,
        cmap=ListedColormap([theme.floor, theme.solid]),
        vmin=0,
        vmax=1,
        origin="lower",
        extent=(x, x + width * size, y, y + height * size),
        interpolation="nearest",
    )
    axes.set_xlim(x, x + width * size)
    axes.set_ylim(y, y + height * size)


def _draw_path(axes: Axes, episode: Episode, theme: Theme) -> None:
    points = np.array([(s.x, s.y) for s in episode.truths])
    if len(points) < 2:
        return
    segments = list(np.stack([points[:-1], points[1:]], axis=1))
    colours = LinearSegmentedColormap.from_list("time", [theme.early, theme.late])
    lines = LineCollection(segments, cmap=colours, linewidths=3, capstyle="round", zorder=3)
    lines.set_array(np.linspace(0, 1, len(segments)))
    axes.add_collection(lines)


def _draw_ends(axes: Axes, episode: Episode, theme: Theme) -> None:
    """Mark the start with an S, the last pose with hull, heading and viewing cone."""
    first, last = episode.truths[0], episode.truths[-1]
    colour = GREEN if episode.outcome.success else ORANGE
    cone = math.degrees(last.yaw)
    axes.add_patch(
        Wedge(
            (last.x, last.y),
            VISIBLE_DISTANCE_M,
            cone - VIEW_DEG / 2,
            cone + VIEW_DEG / 2,
            facecolor=colour,
            alpha=0.3,
            zorder=2,
        )
    )
    axes.add_patch(
        Circle((first.x, first.y), HULL_RADIUS_M, fill=False, color=theme.ink, lw=1.5, zorder=4)
    )
    axes.text(
        first.x, first.y, "S", color=theme.ink, ha="center", va="center", weight="bold", zorder=5
    )
    axes.add_patch(Circle((last.x, last.y), HULL_RADIUS_M, color=colour, zorder=4))
    tip = HULL_RADIUS_M * np.array([math.cos(last.yaw), math.sin(last.yaw)])
    axes.plot([last.x, last.x + tip[0]], [last.y, last.y + tip[1]], color="black", lw=2, zorder=5)


def _draw_contact(axes: Axes, contact: Contact, theme: Theme) -> None:
    """Mark collisions at one place with a red circle that holds their count."""
    axes.add_patch(
        Circle((contact.x, contact.y), 0.13, facecolor=theme.red, edgecolor="white", lw=1, zorder=6)
    )
    axes.text(
        contact.x,
        contact.y - 0.01,
        str(contact.count),
        color="white" if theme is LIGHT else "black",
        ha="center",
        va="center",
        weight="bold",
        zorder=7,
    )


def _merged(contacts: Sequence[Contact]) -> list[Contact]:
    """Join contacts at the same place so that their marks do not cover each other."""
    places: list[Contact] = []
    for contact in contacts:
        for i, place in enumerate(places):
            if math.hypot(contact.x - place.x, contact.y - place.y) < _SAME_PLACE_M:
                count = place.count + contact.count
                places[i] = Contact(place.t_ns, place.x, place.y, place.contact_with, count)
                break
        else:
            places.append(contact)
    return places


def _draw_actions(axes: Axes, episode: Episode, theme: Theme) -> None:
    starts = [_seconds(episode, d.t_ns) for d in episode.decisions]
    ends = [*starts[1:], _seconds(episode, episode.end_ns)]
    gap = 0.8 if len(starts) < 60 else 0.0  # between many bars, gaps would hide the bars
    for decision, start, end in zip(episode.decisions, starts, ends, strict=False):
        colour, _ = ACTION_STYLE[decision.action]
        hatch = "////" if decision.vetoed else None
        width = max(end - start, 0.1)
        axes.barh(0, width, left=start, color=colour, edgecolor=theme.paper, hatch=hatch, lw=gap)
    axes.set_yticks([])
    axes.set_ylabel("action")


def _draw_probability(axes: Axes, episode: Episode, theme: Theme) -> None:
    times = [_seconds(episode, e.t_ns) for e in episode.estimates]
    axes.plot(times, [e.probability for e in episode.estimates], color=VERMILION, lw=1)
    asked = [_seconds(episode, d.t_ns) for d in episode.decisions]
    given = [d.collision_probability for d in episode.decisions]
    axes.plot(asked, given, "o", color=theme.ink, markersize=2.5)
    axes.set_ylim(-0.05, 1.05)
    axes.set_ylabel("p̂")


def _draw_clearance(axes: Axes, episode: Episode, theme: Theme) -> None:
    times = [_seconds(episode, e.t_ns) for e in episode.estimates]
    axes.plot(times, [e.clearance for e in episode.estimates], color=BLUE, lw=1)
    axes.axhline(0.25, color=theme.ink, lw=0.8, ls=":")
    axes.set_ylim(bottom=0)
    axes.set_ylabel("clearance (m)")


def _seconds(episode: Episode, t_ns: int) -> float:
    return (t_ns - episode.start_ns) * 1e-9


def _style(axes: Axes, theme: Theme) -> None:
    axes.set_facecolor(theme.paper)
    axes.tick_params(colors=theme.ink, labelsize=8)
    axes.xaxis.label.set_color(theme.ink)
    axes.yaxis.label.set_color(theme.ink)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(theme.ink)


def _png(figure: Figure, **options: Any) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150, facecolor=figure.get_facecolor(), **options)
    return buffer.getvalue()
