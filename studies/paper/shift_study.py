"""Rooms in another light and lens: ``python -m studies.paper.shift_study``.

On the robot the camera and the light are others than in training, and the paper replaces the RGB
predictor by the LiDAR there. Here plain and ours of table "tenfold" drive the frozen test episodes
in the same rooms as they look in training and otherwise (``cfnav rooms make
--visual-shift``). Ours is given its own prediction, zero, the LiDAR's, the larger of both, and the
truth; both also drive under the LiDAR's veto.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from operator import itemgetter
from pathlib import Path

import matplotlib as mpl
import tyro
from matplotlib.figure import Figure

from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.whole import write_file
from cfnav_core.published.start_states import read_episodes
from cfnav_core.scenes.scene import read_head
from cfnav_core.task.rooms import parse_room, room_folder, shift_of
from studies.engine.bench import Bench, GridOptions, episodes_of
from studies.engine.grid import executor_of, run_tasks
from studies.engine.jobs import GridFolders
from studies.engine.pages import Cell, change, percent, spread, table
from studies.engine.pictures import COLOURS, CURVES, save_picture
from studies.engine.results import Figures, figures_of
from studies.engine.stamps import Made, room_of
from studies.paper.predictor import Quality, judged, over_runs
from studies.paper.rows import DRIVEN, ROWS

LOOKS = "looks.json"
"""In the grid's folder: by strength of the shift, what the tests there are made of."""

METHODS = ("plain", "ours")
"""Reward Only and Stage Only read no p_hat, and Truth, which is told it, is none of the paper's."""
SOURCES = ("own", "lidar", "both")
"""Given to ours, in the order in which the quality of probabilities is told."""
P_HATS = ("own", "zero", "lidar", "both", "true")

DRIVERS = tuple(
    row for row in ROWS
    if row.table == "tenfold" and (row.model, row.split) == DRIVEN and not row.sample
    and row.method in METHODS and row.p_hat in P_HATS
)  # fmt: skip

PARTS: dict[str, Callable[[Figures], str]] = {
    "CF-SR, {episodes:,} test episodes, {seeds} training seeds": lambda f: spread(
        f["cf_sr_mean"], f["cf_sr_std"]
    ),
    "Touched": lambda f: percent(f["touched_mean"]),
    "SR": lambda f: percent(f["sr_mean"]),
    "CF-SR over plain [95 %]": lambda f: change(f["gain"], f["gain_ci95"]),
    "CF-SR over the same with its own prediction [95 %]": lambda f: change(
        f["over_own"], f["over_own_ci95"]
    ),
}
"""Tables of the page; rows in which nothing stands are left out."""


@dataclass(frozen=True)
class ShiftStudy(GridOptions):
    """Test what a grid has trained (cfnav benchmark tenfold --model tdanet) in another light.

    Writes visual_shift.md, visual_shift.json and visual_shift.png.
    """

    shifted: tyro.conf.UseAppendAction[tuple[Path, ...]] = ()
    """The same test rooms as they look otherwise, a folder for each strength."""
    episodes: Path = Path("docs/episodes")
    """Folder of the frozen test episodes."""


@dataclass(frozen=True)
class ShiftResult:
    """How rooms look, and what came of it.

    Attributes:
        shift: strength of the other light and lens; 0 is as in training.
        found: figures by row's name. qualities: of the RGB predictor's and the LiDAR's p_hat.
    """

    shift: float
    found: Mapping[str, Figures]
    qualities: Sequence[Quality]


def run(study: ShiftStudy, command: str) -> list[ShiftResult]:
    """Test what is not yet tested; write, draw and print.

    Returns:
        The looks by strength.

    Raises:
        ValueError: rooms are not the same ones, or the grid has not trained or tested a run.
        SceneError: the scenes cannot be used, or lack what the LiDAR says.
        WriteError: the results cannot be written.
    """
    benches = {
        shift: Bench(
            GridFolders(scenes.resolve(), study.grid.resolve()), study.episodes.resolve(),
            study.every_seed, study.preset, made, command,
        )
        for shift, (scenes, made) in sorted(_made(study).items())
    }  # fmt: skip
    if not study.recorded:
        with executor_of(study.jobs, study.ray) as executor:
            run_tasks([t for bench in benches.values() for t in bench.tests(DRIVERS)], executor)
    looks = [_look(shift, bench) for shift, bench in benches.items()]
    page = as_markdown(looks)
    write_file(study.results / "visual_shift.md", page)
    shifts = [({"shift": of.shift}, of) for of in looks]
    write_json(study.results / "visual_shift.json", {
        "rows": [shift | figures for shift, of in shifts for figures in of.found.values()],
        "probabilities": [shift | asdict(q) for shift, of in shifts for q in of.qualities],
    })  # fmt: skip
    draw(looks, study.results / "visual_shift.png")
    print(page)
    return looks


def _made(study: ShiftStudy) -> dict[float, tuple[Path, Made]]:
    """By strength: the rooms, and what tests in them are made of; noted in the grid's folder."""
    path = study.grid / LOOKS
    if study.recorded:
        if not path.exists():
            raise ValueError(f"found no {LOOKS} in {study.grid}; unpack recorded results there")
        noted = json.loads(path.read_text())
        return {float(shift): (study.scenes, Made(**made)) for shift, made in noted.items()}
    split = DRIVEN[1]
    frozen = episodes_of(study.episodes, split)
    rooms = sorted({parse_room(start.scene) for start in read_episodes(frozen)})
    found: dict[float, tuple[Path, Made]] = {}
    for scenes in (study.scenes, *study.shifted):
        shifts = {_shift(scenes, study.scenes, room) for room in rooms}
        if len(shifts) > 1 or shifts & found.keys():
            raise ValueError(
                f"found rooms shifted by {', '.join(map(str, sorted(shifts)))} in {scenes}, "
                "expected one strength a folder and each once; make them again with "
                "cfnav rooms make --visual-shift"
            )
        found[shifts.pop()] = (scenes, Made.of(scenes, {split: frozen}, {split}))
    noted = json.loads(path.read_text()) if path.exists() else {}
    write_json(path, noted | {str(shift): asdict(made) for shift, (_, made) in found.items()})
    return found


def _shift(scenes: Path, usual: Path, room: tuple[str, int]) -> float:
    """How far a room looks otherwise than in training; in nothing else it may differ.

    Raises:
        ValueError: it is another room.
        SceneError: it is not there.
    """
    here, there = (read_head(room_folder(folder, *room)) for folder in (scenes, usual))
    if (room_of(here), here["perception"]) != (room_of(there), there["perception"]):
        raise ValueError(
            f"found another {room[0]}:{room[1]} in {scenes} than in {usual}; make both with the "
            "same version of cfnav rooms make"
        )
    return shift_of(here["source"])


def _look(shift: float, bench: Bench) -> ShiftResult:
    found = {row.name: figures_of(row, bench, ROWS) for row in DRIVERS}
    (ours,) = (row for row in DRIVERS if row.method == "ours" and row.itself is None)
    return ShiftResult(shift, found, over_runs(judged(ours, bench)))


def as_markdown(looks: Sequence[ShiftResult]) -> str:
    """Tables for people, percent, a column for each strength."""
    first = next(iter(looks[0].found.values()))
    parts = {
        title.format(**first): [
            (name, *(cell(look.found[name]) for look in looks)) for name in looks[0].found
        ]
        for title, cell in PARTS.items()
    }
    parts["AUC of the probabilities, at the steps that ours drove with its own"] = [
        (same[0].source, *(f"{quality.auc:.3f}" for quality in same))
        for same in zip(*(look.qualities for look in looks), strict=True)
    ]
    shifts = [f"shift {of.shift:g}" if of.shift else "as in training" for of in looks]
    columns: dict[str, Cell] = {title: itemgetter(n) for n, title in enumerate(("", *shifts))}
    return "\n".join(
        f"{title}:\n\n{table(columns, [row for row in rows if any(row[1:])])}"
        for title, rows in parts.items()
    )


def draw(looks: Sequence[ShiftResult], path: Path) -> None:
    """Draw CF-SR, and how good the probabilities are, over the strength of the shift.

    Args:
        looks: by strength.
        path: PNG file.

    Raises:
        WriteError: the picture cannot be written.
    """
    shifts = [look.shift for look in looks]
    with mpl.rc_context(CURVES):
        figure = Figure(figsize=(10.5, 3.6), layout="constrained")
        rates, aucs = figure.subplots(1, 2, sharex=True)
        drivers = [_drives(f) for f in looks[0].found.values() if not f["veto"]]
        colours = dict(zip(drivers, COLOURS[: len(drivers)], strict=True))
        for name in looks[0].found:
            of = [look.found[name] for look in looks]
            rates.errorbar(
                shifts, [100 * f["cf_sr_mean"] for f in of],
                [100 * (f["cf_sr_std"] or 0) for f in of], color=colours[_drives(of[0])],
                marker="o", ms=4, lw=1.5, capsize=2, label=name, ls="--" if of[0]["veto"] else "-",
            )  # fmt: skip
        for n, (quality, p_hat) in enumerate(zip(looks[0].qualities, SOURCES, strict=True)):
            aucs.plot(
                shifts, [look.qualities[n].auc for look in looks], "o-",
                color=colours["ours", p_hat], ms=4, label=quality.source,
            )  # fmt: skip
        rates.set(ylabel="CF-SR, %, ± std over seeds", ylim=(0, 100))
        aucs.set(ylabel="AUC of p̂", ylim=(0.5, 1))
        for ax in (rates, aucs):
            ax.set(xlabel="strength of the visual shift", xticks=shifts)
        aucs.legend(frameon=False, fontsize=8, loc="lower left")
        named = rates.get_legend_handles_labels()
        figure.legend(*named, loc="outside right upper", frameon=False, fontsize=8)
        save_picture(figure, path)


def _drives(figures: Figures) -> tuple[str, str]:
    return figures["method"], figures["p_hat"]


def main(study: ShiftStudy) -> None:
    """Make the study and print its page."""
    run(study, command_line())


if __name__ == "__main__":
    sys.exit(run_options("shift_study", ShiftStudy, main))
