"""Which objects stand together, from how often the states of training rooms show both.

Pure functions of counts; every count is over states of training scenes.
"""

from __future__ import annotations

from collections.abc import Set

import numpy as np

MIN_SHARE, MIN_STATES = 0.05, 5
"""Objects are linked from this share of the one's states and this many states on."""

PARENTS = (
    "ArmChair", "Bathtub", "Bed", "Blinds", "Cabinet", "Chair", "CounterTop", "Curtains", "Desk",
    "Drawer", "Dresser", "FloorLamp", "Fridge", "Microwave", "Mirror", "NightStand", "Ottoman",
    "Shelf", "ShowerDoor", "ShowerGlass", "Sink", "Sofa", "StoveBurner", "TableTop", "Television",
    "Toilet", "Window",
)  # fmt: skip
"""Large objects that stay where they are. Those that the published parents name, and their like."""

PARENTS_PER_GOAL = 3
PARENT_REWARD = 0.5
"""Worth of a parent that is always there when the goal is: a tenth of the success reward."""


def pair_counts(seen: np.ndarray) -> np.ndarray:
    """float64 [C, C]: states that show i and j; the diagonal counts those that show i.

    Args:
        seen: bool [S, C].
    """
    # float32 counts a million views exactly, and is multiplied fast
    views = np.asarray(seen, np.float32)
    return (views.T @ views).astype(np.float64)


def layout_prior(pairs: np.ndarray) -> np.ndarray:
    """Dirichlet counts of objects seen together: 1 + states that show both, diagonal 0.

    Args:
        pairs: float64 [..., C, C], ``pair_counts`` of what is detected.

    Returns:
        float32 [..., C, C].

    Source: reconstruction; L-sTDE publishes its counts and not how they were made.
    """
    return ((pairs + 1) * (1 - np.eye(pairs.shape[-1]))).astype(np.float32)


def adjacency(pairs: np.ndarray) -> np.ndarray:
    """Link i to j where j is visible in a twentieth of the states that see i, and in five.

    Visible is within 1.5 m, so linked objects stand near each other. MJOLNIR's own links are the
    relations that people described in Visual Genome's photographs, linked when counted five times
    or more; that data is not at hand. Those speak of the world at large, these of the training
    rooms alone, so a graph network learns less from them about rooms it has not seen.

    Args:
        pairs: float64 [C, C], ``pair_counts`` of what is visible, over all training rooms.

    Returns:
        float32 [C, C], 0 or 1, diagonal 0.
    """
    share = pairs / np.diagonal(pairs).clip(1)[:, None]
    linked = (share >= MIN_SHARE) & (pairs >= MIN_STATES)
    np.fill_diagonal(linked, False)
    return linked.astype(np.float32)


def parent_rewards(pairs: np.ndarray, objects: tuple[str, ...], goals: Set[str]) -> np.ndarray:
    """What the first sight of an object is worth on the way to a goal, in one type of room.

    A goal's candidates are the large objects visible with it (both within 1.5 m, so near each
    other). Their shares of those states add up to one; the three largest are kept, halved.

    Args:
        pairs: float64 [C, C], ``pair_counts`` of what is visible in training rooms of that type.
        objects: C names.
        goals: those that are asked for there.

    Returns:
        float32 [C, C], goals in rows; 0 for all that is no parent.

    Source: MJOLNIR (Pal et al. 2021); the file of its numbers is rebuilt by this rule of ours.
    """
    candidate = np.array([name in PARENTS for name in objects])
    goal = np.array([name in goals for name in objects])
    share = pairs * candidate * goal[:, None]
    np.fill_diagonal(share, 0)
    share /= share.sum(1, keepdims=True).clip(1)
    # a stable order, so that equal shares are settled by the objects' order
    rank = np.argsort(np.argsort(-share, axis=1, kind="stable"), axis=1)
    return (PARENT_REWARD * np.where(rank < PARENTS_PER_GOAL, share, 0)).astype(np.float32)
