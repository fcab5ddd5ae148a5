"""Colours, signs and files that all pictures share.

Colours are those of Okabe and Ito, told apart by colour-blind readers; every colour is doubled by
a shape, a number or a letter. Each picture comes in a light and a dark theme.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from cfnav_core.task.actions import Action
from cfnav_ros.bags.judge.contacts import BUMP, CLEARANCE, STALL, TRUTH

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

DASH, MINUS, TIMES = "\u2013", "\u2212", "\u00d7"
"""Signs of the text that are easily mistaken for others in source."""

BUNDLE_STYLE = ((SKY, "s"), (PURPLE, "^"), (GREEN, "D"), (ORANGE, "v"))
"""Colour and marker of the bundles in a picture; there are no more in one."""

LIDAR_STYLE = (VERMILION, "o")
"""Colour and marker of what comes from the LiDAR."""

SOURCE_STYLE = {TRUTH: "o", BUMP: "v", STALL: "x", CLEARANCE: "d"}
"""Marker of contacts by source."""

DPI = 130
"""Five inches are 650 pixels: twice what a phone gives the picture."""


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


def style(axes: Axes, theme: Theme) -> None:
    """Give axes the theme's colours, and only the two spines that carry numbers."""
    axes.set_facecolor(theme.paper)
    axes.tick_params(colors=theme.ink, labelsize=8)
    axes.xaxis.label.set_color(theme.ink)
    axes.yaxis.label.set_color(theme.ink)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(theme.ink)


def png(figure: Figure, **options: Any) -> bytes:
    """A figure as a PNG file of at most 256 colours, a third of the size of one with all."""
    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI, facecolor=figure.get_facecolor(), **options)
    picture = Image.open(drawn).convert("RGB")
    # Pillow, as OpenCV neither chooses colours nor writes a palette.
    few = picture.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(small, format="PNG", optimize=True)
    return small.getvalue()
