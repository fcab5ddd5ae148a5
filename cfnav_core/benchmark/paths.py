"""The path figure: the same episodes before and after, collisions marked, repeated ones counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cfnav_core.actions import Action
from cfnav_core.env import SceneBank
from cfnav_core.evaluate import Candidate, Episodes, Trace, run_episodes
from cfnav_core.published.start_states import read_episodes
from cfnav_core.whole import whole, writing

CELL_M = 0.25


@dataclass(frozen=True)
class Way:
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
    before: Way
    after: Way


def find_pairs(before: Path, after: Path, scenes: Path, frozen: Path, count: int) -> list[Pair]:
    """Drive frozen episodes with two policies and keep the most telling ones.

    Args:
        before, after: checkpoints.
        scenes: folder of the scenes.
        frozen: file of the episodes.
        count: how many to keep, of different rooms: those in which the first collided most often
            and the second reached the goal without a touch. There may be none.
    """
    bank, episodes, ways = None, None, []
    for path in (before, after):
        candidate = Candidate.load(path)
        starts = read_episodes(frozen)
        bank = SceneBank.load(scenes, sorted({s.scene for s in starts}))
        episodes = Episodes.thaw(bank, starts)
        trace: list[Trace] = []
        results = run_episodes(candidate.networks, bank, episodes, trace=trace)
        ways.append((results, trace))
    assert bank is not None
    assert episodes is not None
    (first, first_trace), (second, second_trace) = ways
    chosen: dict[int, int] = {}
    for n in sorted(range(len(first)), key=lambda n: -first[n].collisions):
        room = int(bank.scene[episodes.states[n]])
        if first[n].collisions and second[n].cf_success and room not in chosen:
            chosen[room] = n
    return [
        _pair(bank, episodes, n, _way(bank, first_trace, n, first[n].success),
              _way(bank, second_trace, n, second[n].success))
        for n in list(chosen.values())[:count]
    ]  # fmt: skip


def _way(bank: SceneBank, trace: Sequence[Trace], episode: int, success: bool) -> Way:
    """One episode of a trace."""
    mine = [(step, int(np.flatnonzero(step.episodes == episode)[0])) for step in trace
            if episode in step.episodes]  # fmt: skip
    states = [int(step.states[row]) for step, row in mine]
    actions = [int(step.actions[row]) for step, row in mine]
    states.append(int(bank.next_state[states[-1], actions[-1]]))
    ahead = np.array(actions) == Action.MoveAhead
    return Way(
        np.array([_place(bank, s) for s in states]), ahead & bank.collided[states[:-1]], success
    )


def _place(bank: SceneBank, state: int) -> np.ndarray:
    """Of a state, metres."""
    k = int(bank.scene[state])
    scene = bank.scenes[k]
    return scene.positions[scene.position[state - bank.offsets[k]]]


def _pair(bank: SceneBank, episodes: Episodes, n: int, before: Way, after: Way) -> Pair:
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
                touched = int(way.collided.sum())
                ax.set_title(f"{pair.scene}, {pair.goal}: {name}\n{ended}, {touched} collisions")
        with writing(path), whole(path) as partial:
            figure.savefig(partial, dpi=130, format="png")


def _draw(ax: Axes, pair: Pair, way: Way) -> None:
    for cells, colour in ((pair.cells, "0.92"), (pair.seen_from, "#cfe8f7")):
        for x, y in cells:
            corner = (x - CELL_M / 2, y - CELL_M / 2)
            ax.add_patch(mpl.patches.Rectangle(corner, CELL_M, CELL_M, color=colour, lw=0))
    ax.plot(*way.at.T, color="#0072b2", lw=1.2)
    (x0, y0), (x1, y1) = way.at[0], way.at[-1]
    ax.scatter(x0, y0, color="#0072b2", s=25, zorder=3)
    ax.scatter(x1, y1, color="#009e73" if way.success else "0.3", marker="s", s=25, zorder=3)
    for (x, y), count in way.repeated().items():
        ax.scatter(x, y, s=90, facecolors="none", edgecolors="#d55e00", linewidths=1.5, zorder=4)
        if count > 1:
            ax.annotate(
                f"\N{MULTIPLICATION SIGN}{count}",
                (x, y),
                (6, 6),
                textcoords="offset points",
                color="#d55e00",
            )
    ax.set_aspect("equal")
    ax.set_axis_off()
