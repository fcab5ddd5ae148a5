"""Rooms in another light and lens: ``python -m cfnav_core.benchmark.shift_study``.

On the robot the camera and the light are others than in training, and the paper replaces the RGB
predictor by the LiDAR there. Here plain and ours of table "tenfold" drive the frozen test episodes
in the same rooms as they look in training and otherwise (``python -m sim_bridge.dataset
--visual-shift``). Ours is given its own prediction, zero, the LiDAR's, the larger of both, and the
truth; both also drive under the LiDAR's veto.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import tyro
from matplotlib.figure import Figure

from cfnav_core.benchmark.curves import COLOURS
from cfnav_core.benchmark.grid import Local, ended_by_signals, run_tasks
from cfnav_core.benchmark.jobs import Places
from cfnav_core.benchmark.pages import Figures, change, percent, spread
from cfnav_core.benchmark.predictor import Quality, judged, over_runs
from cfnav_core.benchmark.presets import PresetName
from cfnav_core.benchmark.rows import DRIVEN, ROWS, Row
from cfnav_core.benchmark.run import tests_of
from cfnav_core.benchmark.stamps import Made
from cfnav_core.benchmark.tables import Bench, episodes_of, figures_of
from cfnav_core.json_file import write_json
from cfnav_core.published.start_states import read_episodes
from cfnav_core.rooms import parse_room, room_folder
from cfnav_core.scene import read_head
from cfnav_core.whole import whole, write_file, writing

LOOKS = "looks.json"
"""In the grid's folder: by strength of the shift, what the tests there are made of."""

SEEN = ("features", "detections")
"""What of a room may differ when it looks otherwise."""

METHODS = ("plain", "ours")
"""Reward Only and Stage Only read no p_hat, and Truth, which is told it, is none of the paper's."""
SOURCES = ("own", "lidar", "both")
"""Given to ours, in the order in which the quality of probabilities is told."""
P_HATS = ("own", "zero", "lidar", "both", "true")

DRIVERS: tuple[Row, ...] = tuple(
    row for row in ROWS
    if row.table == "tenfold" and (row.model, row.split) == DRIVEN and not row.sample
    and row.method in METHODS and row.p_hat in P_HATS
)  # fmt: skip


@dataclass(frozen=True)
class Study:
    """Test what a grid has trained in rooms that look otherwise than those of training."""

    scenes: Path = Path("out/paper/rooms")
    """The built-in rooms as they look in training."""
    shifted: tyro.conf.UseAppendAction[tuple[Path, ...]] = ()
    """The same test rooms as they look otherwise, a folder for each strength."""
    grid: Path = Path("out/paper/grid")
    """Folder of a grid (cfnav benchmark tenfold --model tdanet)."""
    results: Path = Path("out/paper/results")
    """Folder that gets visual_shift.md, visual_shift.json and visual_shift.png."""
    seeds: int = 5
    """Of each row."""
    first_seed: int = 0
    """The others follow it."""
    recorded: bool = False
    """Make the tables of results that are there, without rooms and weights."""
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Tests side by side."""
    preset: PresetName = "small"
    """That of the grid."""
    episodes: Path = Path("docs/episodes")
    """Folder of the frozen test episodes."""


@dataclass(frozen=True)
class Look:
    """How rooms look, and what came of it.

    Attributes:
        shift: strength of the other light and lens; 0 is as in training.
        found: figures by row's name. qualities: of the RGB predictor's and the LiDAR's p_hat.
    """

    shift: float
    found: Mapping[str, Figures]
    qualities: Sequence[Quality]


def run(study: Study) -> list[Look]:
    """Test what is not yet tested; write, draw and print.

    Returns:
        The looks by strength.

    Raises:
        ValueError: rooms are not the same ones, or the grid has not trained or tested a run.
        SceneError: the scenes cannot be used, or lack what the LiDAR says.
        WriteError: the results cannot be written.
    """
    command = shlex.join(["python", "-m", __spec__.name, *sys.argv[1:]])
    benches = {
        shift: Bench(
            Places(scenes.resolve(), study.grid.resolve()), study.episodes.resolve(), study.seeds,
            study.preset, made, command, study.first_seed,
        )
        for shift, (scenes, made) in sorted(_made(study).items())
    }  # fmt: skip
    if not study.recorded:
        tasks = [task for bench in benches.values() for task in tests_of(DRIVERS, bench)]
        run_tasks(tasks, Local(study.jobs))
    looks = [_look(shift, bench) for shift, bench in benches.items()]
    study.results.mkdir(parents=True, exist_ok=True)
    page = as_markdown(looks)
    write_file(study.results / "visual_shift.md", page)
    write_json(
        study.results / "visual_shift.json",
        {
            "rows": [
                {"shift": of.shift} | asdict(figures)
                for of in looks
                for figures in of.found.values()
            ],
            "probabilities": [
                {"shift": of.shift} | asdict(q) for of in looks for q in of.qualities
            ],
        },
    )
    draw(looks, study.results / "visual_shift.png")
    print(page)
    return looks


def _made(study: Study) -> dict[float, tuple[Path, Made]]:
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
                "python -m sim_bridge.dataset --visual-shift"
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
    program, _, shift = here["source"].partition(" shifted by ")
    if _but_looks(here | {"source": program}) != _but_looks(there):
        raise ValueError(
            f"found another {room[0]}:{room[1]} in {scenes} than in {usual}; make both with the "
            "same version of python -m sim_bridge.dataset"
        )
    return float(shift or 0)


def _but_looks(head: Mapping[str, Any]) -> dict[str, Any]:
    arrays = {name: digest for name, digest in head["sha256"].items() if name not in SEEN}
    return {**head, "sha256": arrays}


def _look(shift: float, bench: Bench) -> Look:
    found = {row.name: figures_of(row, bench, ROWS) for row in DRIVERS}
    (ours,) = (row for row in DRIVERS if row.method == "ours" and row.itself is None)
    return Look(shift, found, over_runs(judged(ours, bench)))


def as_markdown(looks: Sequence[Look]) -> str:
    """Tables for people, percent, a column for each strength."""
    shifts = [f"shift {of.shift:g}" if of.shift else "as in training" for of in looks]
    first = next(iter(looks[0].found.values()))
    said = f"{first.episodes:,} test episodes, {first.seeds} training seeds"
    parts = [
        (f"CF-SR, {said}", _cells(looks, lambda f: spread(f.cf_sr_mean, f.cf_sr_std))),
        ("Touched", _cells(looks, lambda f: percent(f.touched_mean))),
        ("SR", _cells(looks, lambda f: percent(f.sr_mean))),
        ("CF-SR over plain [95 %]", _cells(looks, lambda f: change(f.gain, f.gain_ci95))),
        (
            "CF-SR over the same with its own prediction [95 %]",
            _cells(looks, lambda f: change(f.over_own, f.over_own_ci95)),
        ),
        ("AUC of the probabilities, at the steps that ours drove with its own", _aucs(looks)),
    ]
    lines = []
    for title, rows in parts:
        lines += [f"{title}:", "", "| | " + " | ".join(shifts) + " |", "|---" * (len(shifts) + 1)]
        lines[-1] += "|"
        lines += [f"| {name} | " + " | ".join(cells) + " |" for name, cells in rows.items()]
        lines.append("")
    return "\n".join(lines)


def _cells(looks: Sequence[Look], cell: Callable[[Figures], str]) -> dict[str, list[str]]:
    """By row's name a cell for each look; rows without any are left out."""
    rows = {name: [cell(look.found[name]) for look in looks] for name in looks[0].found}
    return {name: cells for name, cells in rows.items() if any(cells)}


def _aucs(looks: Sequence[Look]) -> dict[str, list[str]]:
    sources = [quality.source for quality in looks[0].qualities]
    return {
        source: [f"{look.qualities[n].auc:.3f}" for look in looks]
        for n, source in enumerate(sources)
    }


def draw(looks: Sequence[Look], path: Path) -> None:
    """Draw CF-SR, and how good the probabilities are, over the strength of the shift.

    Args:
        looks: by strength.
        path: PNG file.

    Raises:
        WriteError: the picture cannot be written.
    """
    shifts = [look.shift for look in looks]
    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(10.5, 3.6), layout="constrained")
        rates, aucs = figure.subplots(1, 2, sharex=True)
        drivers = [_drives(f) for f in looks[0].found.values() if not f.veto]
        colours = dict(zip(drivers, COLOURS[: len(drivers)], strict=True))
        for name in looks[0].found:
            of = [look.found[name] for look in looks]
            rates.errorbar(
                shifts, [100 * f.cf_sr_mean for f in of],
                [100 * (f.cf_sr_std or 0) for f in of], color=colours[_drives(of[0])], marker="o",
                ms=4, lw=1.5, capsize=2, label=name, ls="--" if of[0].veto else "-",
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
        figure.legend(
            *rates.get_legend_handles_labels(), loc="outside right upper", frameon=False,
            fontsize=8,
        )  # fmt: skip
        with writing(path), whole(path) as partial:
            figure.savefig(partial, dpi=130, format="png")


def _drives(figures: Figures) -> tuple[str, str]:
    return figures.method, figures.p_hat


def main() -> None:
    """Entry point; what was found wrong is one sentence."""
    try:
        with ended_by_signals():
            run(tyro.cli(Study, prog="shift_study"))
    except (ValueError, OSError) as error:
        sys.exit(f"shift_study: {error}")


if __name__ == "__main__":
    main()
