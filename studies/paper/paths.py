"""The path figure: the same episodes before and after, collisions marked, repeated ones counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from cfnav_core.learn.candidate import Candidate
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, Trace, run_episodes
from cfnav_core.published.start_states import read_episodes
from cfnav_core.task.actions import Action
from studies.engine.pictures import save_picture
from studies.engine.results import Results

CELL_M = 0.25

FLOOR, SEEN_FROM = "0.92", "#cfe8f7"
REACHED, MISSED, TOUCHED = "#009e73", "0.3", "#d55e00"
EARLY, WAY = "#7fb8d9", "#003a5c"
"""The path where it begins and ends."""


def _mark(marker: str, colour: str, label: str, size: float = 5) -> Line2D:
    return Line2D([], [], ls="", marker=marker, ms=size, color=colour, label=label)


LEGEND = (
    _mark("s", FLOOR, "where the robot can stand", 9),
    _mark("s", SEEN_FROM, "where it can see the goal", 9),
    Line2D([], [], color=WAY, label="path, light to dark in time"),
    _mark("o", EARLY, "start"),
    _mark("s", REACHED, "end: the goal was reached"),
    _mark("s", MISSED, "end: it was missed"),
    Line2D([], [], ls="", marker="o", ms=9, mfc="none", mec=TOUCHED, label="collisions, how many"),
)


@dataclass(frozen=True)
class DrivenPath:
    """One episode as it was driven.

    Attributes:
        at: float64 [T, 2], metres, before each action and at the end.
        collided: bool [T - 1], by action.
        success: Done with the goal in view.
    """

    at: np.ndarray
    collided: np.ndarray
    success: bool

    def repeated(self) -> Counter[tuple[float, float]]:
        """Places of collisions, and how many at each."""
        places = self.at[:-1][self.collided]
        return Counter((float(x), float(y)) for x, y in places)


@dataclass(frozen=True)
class Pair:
    """An episode driven by two policies.

    Attributes:
        scene: name of the room. goal: what was sought.
        cells: float32 [P, 2], metres: where the robot can stand.
        seen_from: float32 [V, 2]: where the goal is visible.
        before, after: the two drives.
    """

    scene: str
    goal: str
    cells: np.ndarray
    seen_from: np.ndarray
    before: DrivenPath
    after: DrivenPath


def find_pairs(
    before: Path,
    after: Path,
    tested: tuple[Results, Results],
    scenes: Path,
    frozen: Path,
    count: int,
) -> list[Pair]:
    """Find the most telling test episodes and drive them again with both policies.

    Args:
        before, after: checkpoints.
        tested: what they reached in the frozen episodes, of one seed each.
        scenes: folder of the scenes.
        frozen: file of the episodes.
        count: how many at most, of different rooms: those in which the first collided most often
            and the second reached the goal without a touch. There may be none.
    """
    chosen = telling(*tested)[:count]
    if not chosen:
        return []
    every = read_episodes(frozen)
    starts = [every[n] for n in chosen]
    bank = SceneBank.load(scenes, sorted({s.scene for s in starts}))
    episodes = Episodes.thaw(bank, starts)
    driven = [_drive(path, bank, episodes) for path in (before, after)]
    return [_pair(bank, episodes, n, *ways) for n, ways in enumerate(zip(*driven, strict=True))]


def telling(first: Results, second: Results) -> list[int]:
    """Episodes that the first collided in and the second drove clean, worst first, one a room."""
    chosen: dict[str, int] = {}
    (touched,), (clean,) = first.collisions, second.cf_success
    for n in np.argsort(-touched, kind="stable"):
        if touched[n] and clean[n]:
            chosen.setdefault(str(first.rooms[n]), int(n))
    return list(chosen.values())


def _drive(path: Path, bank: SceneBank, episodes: Episodes) -> list[DrivenPath]:
    """All the episodes with one policy."""
    trace: list[Trace] = []
    results = run_episodes(Candidate.load(path).networks, bank, episodes, trace=trace)
    return [_driven(bank, trace, n, result.success) for n, result in enumerate(results)]


def _driven(bank: SceneBank, trace: Sequence[Trace], episode: int, success: bool) -> DrivenPath:
    """One episode of a trace."""
    mine = [(step, int(np.flatnonzero(step.episodes == episode)[0])) for step in trace
            if episode in step.episodes]  # fmt: skip
    states = [int(step.states[row]) for step, row in mine]
    actions = [int(step.actions[row]) for step, row in mine]
    states.append(int(bank.next_state[states[-1], actions[-1]]))
    ahead = np.array(actions) == Action.MoveAhead
    return DrivenPath(
        np.array([_place(bank, s) for s in states]), ahead & bank.collided[states[:-1]], success
    )


def _place(bank: SceneBank, state: int) -> np.ndarray:
    """Of a state, metres."""
    k = int(bank.scene[state])
    scene = bank.scenes[k]
    return scene.positions[scene.position[state - bank.offsets[k]]]


def _pair(
    bank: SceneBank, episodes: Episodes, n: int, before: DrivenPath, after: DrivenPath
) -> Pair:
    k, goal = int(bank.scene[episodes.states[n]]), int(episodes.goals[n])
    scene = bank.scenes[k]
    where = np.unique(scene.position[scene.visible[:, goal]])
    return Pair(
        bank.names[k], bank.objects[goal], scene.positions, scene.positions[where], before, after
    )


def draw_paths(pairs: Sequence[Pair], names: tuple[str, str], path: Path) -> None:
    """Draw episodes below one another, before on the left and after on the right.

    Args:
        pairs: the episodes.
        names: of the two policies.
        path: PNG file.

    Raises:
        WriteError: the picture cannot be written.
    """
    with mpl.rc_context({"font.size": 8}):
        figure = Figure(figsize=(7, 3.2 * len(pairs)), layout="constrained")
        for axes, pair in zip(figure.subplots(len(pairs), 2, squeeze=False), pairs, strict=True):
            for ax, name, way in zip(axes, names, (pair.before, pair.after), strict=True):
                _draw(ax, pair, way)
                ended = "reached" if way.success else "missed"
                n = int(way.collided.sum())
                ax.set_title(f"{pair.scene}, {pair.goal}: {name}\n{ended}, collisions: {n}")
        figure.legend(handles=LEGEND, loc="outside lower center", ncols=3, frameon=False)
        save_picture(figure, path)


def _draw(ax: Axes, pair: Pair, way: DrivenPath) -> None:
    for cells, colour in ((pair.cells, FLOOR), (pair.seen_from, SEEN_FROM)):
        for x, y in cells:
            corner = (x - CELL_M / 2, y - CELL_M / 2)
            cell = Rectangle(corner, CELL_M, CELL_M, color=colour, lw=0, antialiased=False)
            ax.add_patch(cell)
    time = LinearSegmentedColormap.from_list("time", [EARLY, WAY])
    steps = list(np.stack([way.at[:-1], way.at[1:]], axis=1))
    ax.add_collection(LineCollection(steps, array=np.arange(len(steps)), cmap=time, linewidths=1.8))
    (x0, y0), (x1, y1) = way.at[0], way.at[-1]
    ax.scatter(x0, y0, color=EARLY, s=25, zorder=3)
    ax.scatter(x1, y1, color=REACHED if way.success else MISSED, marker="s", s=25, zorder=3)
    for (x, y), count in way.repeated().items():
        ax.scatter(x, y, s=90, facecolors="none", edgecolors=TOUCHED, linewidths=1.5, zorder=4)
        if count > 1:
            ax.annotate(
                f"\N{MULTIPLICATION SIGN}{count}",
                (x, y),
                (6, 6),
                textcoords="offset points",
                color=TOUCHED,
                zorder=5,
                bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.5},
            )
    left, below = pair.cells.min(0) - CELL_M
    ax.plot([left, left + 1], [below - CELL_M, below - CELL_M], color="black", lw=2)
    ax.text(left + 0.5, below - 1.5 * CELL_M, "1 m", ha="center", va="top")
    ax.set_aspect("equal")
    ax.set_axis_off()
