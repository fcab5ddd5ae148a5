"""A recorded drive as a moving picture: ``python -m studies.bags.drive_gif``.

Beside the camera's picture the plan, in which the driven path grows; below both, the action of the
moment and the collision probability that the policy was told. Needs no ROS.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import tyro
from cfnav_ros.bags.evaluation import EvaluatedDrive, JudgeOptions, evaluate
from cfnav_ros.bags.files.events import Decided, Picture
from cfnav_ros.bags.files.finding import BagError
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.roles import assign
from cfnav_ros.report.plot_theme import ACTION_STYLE, LIDAR_STYLE, LIGHT, style
from cfnav_ros.report.trajectory_plot import course_of, draw_plan, show_around
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image, ImageFilter

from cfnav_core.files.whole import WriteError, write_file

PIXELS = (800, 464)
"""Width and height of the moving picture."""

DPI = 100

COLOURS = 224

DRAWN = np.array(
    [
        [round(255 * part) for part in to_rgb(colour)]
        for colour in (
            *(LIGHT.paper, LIGHT.ink, LIGHT.floor, LIGHT.solid, LIGHT.early, LIGHT.late, LIGHT.red),
            *(colour for colour, _ in ACTION_STYLE.values()),
            LIDAR_STYLE[0],
        )
    ],
    np.uint8,
)
"""uint8 [N, 3]: colours of what is drawn; the others are chosen from the pictures."""

HOLD_MS = 2500
"""The last picture stands for so long before the drive begins again."""


@dataclass(frozen=True)
class GifConfig:
    """Make a moving picture of one drive of a bag."""

    bag: Path = Path("out/demo/bag")
    """Bag that ``make demo`` left, or another one with pictures and decisions."""
    out: Path = Path("out/demo/drive.gif")
    """File of the moving picture."""
    drive: int = 1
    """Number of the drive in the bag, from 1."""
    every: float = 0.6
    """Recorded seconds from one picture to the next."""
    rate: float = 6.0
    """Pictures a second."""


@dataclass(frozen=True)
class Still:
    """One picture of the drive: node time in nanoseconds, uint8 [H, W, 3], the newest decision."""

    t_ns: int
    rgb: np.ndarray
    decision: Decided


def stills(bag: Path, evaluated: EvaluatedDrive, every: float) -> Iterator[Still]:
    """The camera's pictures of a drive, at least so many seconds apart, and its last one."""
    drive, next_ns, last = evaluated.drive, 0, None
    with Bag(bag) as opened:
        for event in opened.events(assign(opened.topics, {})):
            if not isinstance(event, Picture) or event.t_ns > drive.end_ns:
                continue
            taken = [d for d in drive.decisions if d.t_ns <= event.t_ns]
            if taken and next_ns <= event.t_ns < drive.end_ns:
                next_ns = event.t_ns + round(every * 1e9)
                yield Still(event.t_ns, event.decode(), taken[-1])
            last = event if taken else None
    if last is not None:
        yield Still(drive.end_ns, last.decode(), drive.decisions[-1])


class Drawing:
    """Draws the stills of one drive."""

    def __init__(self, evaluated: EvaluatedDrive) -> None:
        """Take a drive."""
        self._evaluated, self._course = evaluated, course_of(evaluated)
        drive = evaluated.drive
        self._times = (
            np.array([truth.t_ns for truth in drive.truths])
            if drive.truths
            else drive.start_ns + drive.path[:, 0] * 1e9
        )

    def picture(self, still: Still) -> Image.Image:
        """One picture, RGB, of ``PIXELS``."""
        with mpl.rc_context({"font.size": 11}):
            figure = Figure(figsize=(PIXELS[0] / DPI, PIXELS[1] / DPI), facecolor=LIGHT.paper)
            self._draw_camera(figure.add_axes((0.015, 0.26, 0.42, 0.724)), still)
            self._draw_plan(figure.add_axes((0.455, 0.26, 0.53, 0.724)), still)
            self._draw_words(figure, still)
            self._draw_probability(figure.add_axes((0.455, 0.075, 0.53, 0.145)), still)
            drawn = io.BytesIO()
            figure.savefig(drawn, format="png", dpi=DPI, facecolor=LIGHT.paper)
        return Image.open(drawn).convert("RGB")

    def _draw_camera(self, axes: Axes, still: Still) -> None:
        # Without the sensor's noise, of which no two pictures are alike, the file is half as large.
        calm = Image.fromarray(still.rgb).filter(ImageFilter.MedianFilter(3))
        axes.imshow(calm, interpolation="bilinear")
        axes.set_axis_off()

    def _draw_plan(self, axes: Axes, still: Still) -> None:
        course, until = self._course, int(np.searchsorted(self._times, still.t_ns, "right"))
        contacts = tuple(c for c in course.contacts if c.t_ns <= still.t_ns)
        so_far = replace(course, poses=course.poses[: max(until, 1)], contacts=contacts)
        reached = bool(self._evaluated.outcome.success.value)
        draw_plan(axes, so_far, reached and self._is_over(still), LIGHT)
        if course.room is not None:
            show_around(axes, course)  # all of the way, so that the plan stands still
        axes.set_axis_off()

    def _draw_words(self, figure: Figure, still: Still) -> None:
        decision = still.decision
        colour, sign = ACTION_STYLE[decision.action]
        words = decision.action.name + (" (vetoed)" if decision.vetoed else "")
        told = f"p̂ {decision.collision_probability:.2f}"
        figure.text(0.02, 0.185, f"goal: {decision.goal}", color=LIGHT.ink, size=14, weight="bold")
        figure.text(0.02, 0.105, sign, color=colour, size=20, weight="bold")
        figure.text(0.065, 0.11, words, color=LIGHT.ink, size=14)
        figure.text(0.27, 0.11, told, color=LIDAR_STYLE[0], size=14)
        if self._is_over(still):
            figure.text(0.02, 0.035, self._result(), color=LIGHT.ink, size=14)

    def _is_over(self, still: Still) -> bool:
        return still.t_ns >= self._evaluated.drive.end_ns

    def _result(self) -> str:
        outcome = self._evaluated.outcome
        touches = outcome.collisions.value
        reached = "reached" if outcome.success.value else "missed"
        return f"{reached}, {f'{touches:g} touches' if touches else 'nothing touched'}"

    def _draw_probability(self, axes: Axes, still: Still) -> None:
        drive = self._evaluated.drive
        now = drive.since_start(still.t_ns)
        seen = drive.estimates[drive.estimates[:, 0] <= now]
        axes.fill_between(seen[:, 0], seen[:, 1], color=LIDAR_STYLE[0], alpha=0.25, lw=0)
        axes.plot(seen[:, 0], seen[:, 1], color=LIDAR_STYLE[0], lw=1.2)
        axes.set_xlim(0, drive.seconds)
        axes.set_ylim(0, 1.05)
        axes.set_yticks([0, 1])
        axes.xaxis.set_major_formatter("{x:g} s")
        axes.text(0.99, 0.8, "p̂: will MoveAhead collide?", transform=axes.transAxes, ha="right")
        style(axes, LIGHT)


def write_gif(pictures: Sequence[Image.Image], out: Path, rate: float) -> None:
    """Write pictures as a GIF that repeats; all share one palette, so that no colour flickers.

    Raises:
        WriteError: the file cannot be written.
    """
    shown = [np.asarray(picture) for picture in pictures[:: -max(len(pictures) // 8, 1)]]
    palette = Image.fromarray(np.vstack(shown)).quantize(COLOURS - len(DRAWN))
    own = palette.getpalette() or []
    palette.putpalette([*own[: 3 * (COLOURS - len(DRAWN))], *DRAWN.ravel()])
    frames = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    lasts = [round(1000 / rate)] * (len(frames) - 1) + [HOLD_MS]
    file = io.BytesIO()
    frames[0].save(
        file, format="GIF", save_all=True, append_images=frames[1:], duration=lasts, loop=0
    )
    write_file(out, file.getvalue())


def make(config: GifConfig) -> int:
    """Make the moving picture; returns the number of its pictures.

    Raises:
        BagError: the bag cannot be read, or does not hold such a drive.
        WriteError: the file cannot be written.
    """
    drives = evaluate(config.bag, JudgeOptions()).drives
    if not 1 <= config.drive <= len(drives):
        raise BagError(f"{config.bag} holds {len(drives)} drives, --drive is {config.drive}")
    evaluated = drives[config.drive - 1]
    drawing = Drawing(evaluated)
    pictures = [drawing.picture(still) for still in stills(config.bag, evaluated, config.every)]
    if not pictures:
        raise BagError(f"drive {config.drive} of {config.bag} holds no decision with a picture")
    write_gif(pictures, config.out, config.rate)
    return len(pictures)


def main() -> None:
    """Run the command line: 0 when it was written, 2 when not."""
    config = tyro.cli(GifConfig, prog="drive_gif")
    try:
        count = make(config)
    except (BagError, WriteError) as error:
        print(f"drive_gif: {error}", file=sys.stderr)
        sys.exit(2)
    print(f"{count} pictures, {config.out.stat().st_size / 1e6:.1f} MB in {config.out}")


if __name__ == "__main__":
    main()
