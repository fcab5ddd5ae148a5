"""How studies draw: colours, settings, files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from cfnav_core.files.whole import whole, writing

COLOURS = ("#000000", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#0072b2")
"""Of Okabe and Ito, told apart by colour-blind people too."""

CURVES: dict[Any, Any] = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
"""Matplotlib's settings for curves."""


def save_picture(figure: Figure, path: Path) -> None:
    """Write a picture as PNG.

    Raises:
        WriteError: it cannot be written.
    """
    with writing(path), whole(path) as partial:
        figure.savefig(partial, dpi=130, format="png")
