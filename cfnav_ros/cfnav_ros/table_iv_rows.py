"""Table IV: its rooms, its goals, its trials and its rows. Plain data."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cfnav_core.config import MethodName, PHat
from cfnav_ros.plan import Trial

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


@dataclass(frozen=True)
class Way:
    """One row: what drives, and how.

    Attributes:
        name: of the row. method: of training.
        paper: successes in 15 trials that the paper reports.
        p_hat, veto, visual_shift: see ``GraphConfig``.
        sample: actions are drawn, from the training seed; the most probable ones when not.
    """

    name: str
    method: MethodName
    paper: int | None = None
    p_hat: PHat = "lidar"
    veto: bool = False
    visual_shift: float = VISUAL_SHIFT
    sample: bool = False

    @property
    def key(self) -> str:
        """Name of its file of results."""
        words = [
            self.method,
            *(["veto"] if self.veto else []),
            *([] if self.p_hat == "lidar" else [self.p_hat]),
            *(["drawn"] if self.sample else []),
        ]
        return "_".join([*words, *([] if self.visual_shift else ["unshifted"])])


PAPERS = (
    Way("TDANet", "plain", 0),
    Way("Reward Only (TDANet)", "reward_only", 1),
    Way("Stage Only (TDANet)", "stage_only", 4),
    Way("ours (TDANet)", "ours", 12),
)

RGB = Way("ours (TDANet), RGB for p_hat", "ours", p_hat="own")
LARGER = Way("ours (TDANet), the larger of LiDAR and p_hat", "ours", p_hat="both")

MAIN = (
    *PAPERS,
    RGB,
    Way("ours (TDANet), zero for p_hat", "ours", p_hat="zero"),
    Way("ours (TDANet), shuffled p_hat", "ours", p_hat="shuffled"),
    Way("ours (TDANet), the true flag for p_hat", "ours", p_hat="true"),
    Way("Truth (TDANet)", "truth"),
)
"""Also ours with other sources of p_hat, and the method that was told the truth in training."""

SOURCES = (PAPERS[0], PAPERS[-1], RGB, LARGER)
"""Where p_hat should come from on a robot: the LiDAR, the picture, or both; and plain."""

WAYS = (
    *MAIN,
    *(replace(w, name=f"{w.name}, actions drawn", paper=None, sample=True) for w in PAPERS),
    LARGER,
    Way("Truth (TDANet), the true flag for p_hat", "truth", p_hat="true"),
    Way("Truth (TDANet), the larger of LiDAR and p_hat", "truth", p_hat="both"),
    Way("TDANet, LiDAR veto", "plain", veto=True),
    Way("ours (TDANet), LiDAR veto", "ours", veto=True),
    Way("TDANet, no visual shift", "plain", visual_shift=0.0),
    Way("ours (TDANet), no visual shift", "ours", visual_shift=0.0),
)

ROWS = {"paper": PAPERS, "sources": SOURCES, "main": MAIN, "all": WAYS}


def trials_of(count: int, seed: int) -> list[Trial]:
    """The trials of one training seed: rooms in turn, then goals; no start is met twice.

    Args:
        count: how many.
        seed: of training.
    """
    rooms, first = tuple(ROOMS), (FIRST_START + seed) * count
    return [Trial(rooms[n % 3], GOALS[n // 3 % 3], first + n) for n in range(count)]
