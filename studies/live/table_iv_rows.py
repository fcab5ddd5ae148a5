"""Table IV: its rooms, its goals, its trials and its rows. Plain data."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from cfnav_ros.live.plan import Trial

from cfnav_core.agent.config import MethodName
from cfnav_core.task.p_hat import PHat
from studies.engine.row import Claimed, Row
from studies.paper.rows import DRIVEN

ROOMS = {"living_room:77": 0.151, "living_room:36": 0.217, "living_room:70": 0.283}
"""Share of the floor below furniture. Of the 42 living rooms 30 to 129 that hold all three goals
these are the least, the middle and the most furnished one."""

GOALS = ("HousePlant", "Book", "Laptop")

PLACES = {
    "living_room:77": {
        "HousePlant": [(5.01, 5.02)],
        "Book": [(3.18, 3.97)],
        "Laptop": [(5.1, 0.21)],
    },
    "living_room:36": {
        "HousePlant": [(0.19, 0.26)],
        "Book": [(5.53, 0.18)],
        "Laptop": [(3.78, 2.4)],
    },
    "living_room:70": {
        "HousePlant": [(0.15, 3.26)],
        "Book": [(1.47, 0.29)],
        "Laptop": [(2.04, 1.51)],
    },
}
"""Of the goals in each room, x and y of their centres, metres."""

VISUAL_SHIFT = 0.5

FIRST_START = 1000
"""Seeds of starts count from it in blocks of a training seed's trials: tables of other sizes have
other starts."""

TRIALS = 15
"""Of the paper's table, three rooms by five; driven with the bundles of one training seed."""


def _row(name: str, method: MethodName, p_hat: PHat = "lidar", **more: Any) -> Row:
    """A row; its gain is over plain in the same light, with actions chosen alike."""
    against: MethodName | None = None if method == "plain" and not more.get("veto") else "plain"
    return Row(
        "IV", name, DRIVEN[0], method, DRIVEN[1], p_hat=p_hat, against=against, usual="lidar",
        visual_shift=more.pop("visual_shift", VISUAL_SHIFT), **more,
    )  # fmt: skip


def _successes(of_trials: int) -> Claimed:
    return Claimed((100 * of_trials / TRIALS, None))


PAPERS = (
    _row("TDANet", "plain", paper=_successes(0)),
    _row("Reward Only (TDANet)", "reward_only", paper=_successes(1)),
    _row("Stage Only (TDANet)", "stage_only", paper=_successes(4)),
    _row("ours (TDANet)", "ours", paper=_successes(12)),
)

RGB = _row("ours (TDANet), RGB for p_hat", "ours", "own")
LARGER = _row("ours (TDANet), the larger of LiDAR and p_hat", "ours", "both")

MAIN = (
    *PAPERS,
    RGB,
    _row("ours (TDANet), zero for p_hat", "ours", "zero"),
    _row("ours (TDANet), the LiDAR's earlier p_hat", "ours", "earlier"),
    _row("ours (TDANet), the true flag for p_hat", "ours", "true"),
    _row("Truth (TDANet)", "truth"),
)
"""Also ours with other sources of p_hat, and the method that was told the truth in training."""

SOURCES = (PAPERS[0], PAPERS[-1], RGB, LARGER)
"""Where p_hat should come from on a robot: the LiDAR, the picture, or both; and plain."""

ALL = (
    *MAIN,
    *(replace(row, name=f"{row.name}, actions drawn", paper=None, sample=True) for row in PAPERS),
    LARGER,
    _row("Truth (TDANet), the true flag for p_hat", "truth", "true"),
    _row("Truth (TDANet), the larger of LiDAR and p_hat", "truth", "both"),
    _row("TDANet, LiDAR veto", "plain", veto=True),
    _row("ours (TDANet), LiDAR veto", "ours", veto=True),
    _row("TDANet, no visual shift", "plain", visual_shift=0.0),
    _row("ours (TDANet), no visual shift", "ours", visual_shift=0.0),
)

ROWS = {"paper": PAPERS, "sources": SOURCES, "main": MAIN, "all": ALL}


def key_of(row: Row) -> str:
    """Name of a row's file of trials."""
    words = [
        row.method,
        *(["veto"] if row.veto else []),
        *([] if row.p_hat == "lidar" else [row.p_hat]),
        *(["drawn"] if row.sample else []),
    ]
    return "_".join([*words, *([] if row.visual_shift else ["unshifted"])])


def trials_of(count: int, seed: int) -> list[Trial]:
    """The trials of one training seed: rooms in turn, then goals; no start is met twice.

    Args:
        count: how many.
        seed: of training.
    """
    rooms, first = tuple(ROOMS), (FIRST_START + seed) * count
    return [Trial(rooms[n % 3], GOALS[n // 3 % 3], first + n) for n in range(count)]
