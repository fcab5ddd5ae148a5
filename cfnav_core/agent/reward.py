"""Rewards: pure functions of what one step did.

``REWARDS`` holds the r_o of every model, all called the same way: what the step did, what the
episode's reward remembers, and what is known of the objects; back come r_o and the memory. Eq. 4
and the shaping of Xiao et al. are functions of their own, which training methods add.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from cfnav_core.models.base import Knowledge
from cfnav_core.task.actions import Action

STEP_REWARD = -0.01
SUCCESS_REWARD = 5.0
MOVE_REWARD = 0.01
"""HOZ gives the step's cost back for MoveAhead, also for one that failed."""
APPROACH_REWARD = 0.1
"""Of L-sTDE and AKGVP, per metre nearer in a straight line."""
SIMILARITY_REWARD = 0.1


@dataclass(frozen=True)
class StepFacts:
    """What one step of B episodes did.

    Attributes:
        action: int64 [B].
        success: bool [B], Done was chosen with the goal visible.
        goal: int64 [B], row among the objects.
        room: int64 [B], row of ``ROOM_TYPES``.
        distance_before, distance: float32 [B], metres in a straight line to the nearest instance
            of the goal, before and after the step.
        path_before, path: float32 [B], metres of the shortest way to where the goal is visible,
            before and after the step.
        visible: bool [B, C], objects visible after the step.
    """

    action: Tensor
    success: Tensor
    goal: Tensor
    room: Tensor
    distance_before: Tensor
    distance: Tensor
    path_before: Tensor
    path: Tensor
    visible: Tensor


@dataclass(frozen=True)
class RewardMemory:
    """What rewards remember of B episodes; the rewards that remember nothing hand it on.

    Attributes:
        seen_parents: bool [B, C], parents of the goal that were rewarded.
        best_similarity: float32 [B], of the objects seen so far to the goal.
    """

    seen_parents: Tensor
    best_similarity: Tensor

    @classmethod
    def start(cls, batch: int, objects: int, device: torch.device | str = "cpu") -> RewardMemory:
        """At the start of B episodes."""
        seen = torch.zeros(batch, objects, dtype=torch.bool, device=device)
        return cls(seen, torch.zeros(batch, device=device))

    def forget(self, ended: Tensor) -> RewardMemory:
        """Start again where an episode ended (bool [B])."""
        return RewardMemory(
            self.seen_parents & ~ended[:, None], self.best_similarity.masked_fill(ended, 0.0)
        )


@dataclass(frozen=True)
class RewardTables:
    """What rewards know of the objects.

    Attributes:
        parents: float32 [4, C, C], worth of first seeing j on the way to goal i, by room type.
        similarity: float32 [C, C], cosine similarity of the objects' words.
    """

    parents: Tensor
    similarity: Tensor

    @classmethod
    def of(cls, reward: str, knowledge: Knowledge) -> RewardTables:
        """The tables that a row of ``REWARDS`` reads, of "" none; the others are empty.

        Raises:
            ValueError: knowledge lacks what it reads.
        """
        parents = similarity = torch.empty(0)
        if reward == "mjolnir":
            (parents,) = knowledge.need("parents")
        if reward == "similarity":
            unit = F.normalize(knowledge.need("words")[0], dim=1)
            similarity = unit @ unit.T
        return cls(parents, similarity)

    def to(self, device: torch.device) -> RewardTables:
        """On a device."""
        return RewardTables(self.parents.to(device), self.similarity.to(device))


Reward = Callable[[StepFacts, RewardMemory, RewardTables], tuple[Tensor, RewardMemory]]
"""Step, memory and tables to r_o float32 [B] and the memory after the step."""


def nav_reward(success: Tensor) -> Tensor:
    """r_o of the Baseline: -0.01 a step, 5 for a successful Done.

    Args:
        success: bool [B], Done was chosen with the goal visible.

    Returns:
        float32 [B].

    Source: the lineage's plain A3C agent (allenai/savn).
    """
    return torch.where(success, SUCCESS_REWARD, STEP_REWARD)


def baseline(
    step: StepFacts, memory: RewardMemory, tables: RewardTables
) -> tuple[Tensor, RewardMemory]:
    """``nav_reward``."""
    return nav_reward(step.success), memory


def hoz(step: StepFacts, memory: RewardMemory, tables: RewardTables) -> tuple[Tensor, RewardMemory]:
    """``nav_reward``, and MoveAhead costs nothing, also when it failed.

    Source: HOZ and its Baseline (public code).
    """
    return nav_reward(step.success) + MOVE_REWARD * (step.action == Action.MoveAhead), memory


def layout(
    step: StepFacts, memory: RewardMemory, tables: RewardTables
) -> tuple[Tensor, RewardMemory]:
    """``hoz``, and 0.1 for each metre nearer to the goal in a straight line, nothing for farther.

    A success is worth exactly 5. The published code gives no approach for an episode's first step,
    as it knows no distance before it; here every step counts alike.

    Source: L-sTDE and AKGVP (public code).
    """
    approach = APPROACH_REWARD * _nearer(step.distance_before, step.distance).clamp(min=0)
    reward, _ = hoz(step, memory, tables)
    return torch.where(step.success, SUCCESS_REWARD, reward + approach), memory


def mjolnir(
    step: StepFacts, memory: RewardMemory, tables: RewardTables
) -> tuple[Tensor, RewardMemory]:
    """The first sight of a parent of the goal is worth its number instead of -0.01.

    Of several parents seen first in one step the largest number counts and is used up. A success
    is worth 5 and the largest number of any parent then visible, or 5 - 0.01; a wrong Done -0.01.

    The published code counts instances of parents and asks that the state be one the worker has
    been to before, in any episode and scene; here objects count, once each an episode.

    Source: MJOLNIR (Pal et al. 2021).
    """
    worth = tables.parents[step.room, step.goal] * step.visible
    done = (step.action == Action.Done)[:, None]
    fresh = worth * ~(memory.seen_parents & ~done)
    best, parent = fresh.max(1)
    found = (best > 0) & (step.success | ~done[:, 0])
    partial = torch.where(found, best, STEP_REWARD)
    now = F.one_hot(parent, fresh.shape[1]).bool() & found[:, None]
    reward = SUCCESS_REWARD * step.success + partial
    return reward, replace(memory, seen_parents=memory.seen_parents | now)


def similarity(
    step: StepFacts, memory: RewardMemory, tables: RewardTables
) -> tuple[Tensor, RewardMemory]:
    """0.1 times the similarity of a visible object to the goal, when it beats all seen so far.

    It replaces -0.01. A success is worth 5 and 0.1 times the largest similarity then visible.

    The published code looks at visible boxes at any distance and asks for a state that the worker
    has been to before; here what counts as visible is what counts for Done.

    Source: SSNet (public code), the nearest public relative of TDANet.
    """
    alike = tables.similarity[step.goal].masked_fill(~step.visible, 0.0).max(1).values
    done = step.action == Action.Done
    better = alike > torch.where(done, 0.0, memory.best_similarity)
    better &= step.success | ~done
    partial = torch.where(better, SIMILARITY_REWARD * alike, STEP_REWARD)
    best = torch.where(better & ~done, alike, memory.best_similarity)
    return SUCCESS_REWARD * step.success + partial, replace(memory, best_similarity=best)


REWARDS: dict[str, Reward] = {
    "baseline": baseline,
    "hoz": hoz,
    "layout": layout,
    "mjolnir": mjolnir,
    "similarity": similarity,
}
"""Name to r_o."""


def path_shaping(step: StepFacts) -> Tensor:
    """Metres by which the shortest path got shorter, negative for longer; r_s before its weight.

    Returns:
        float32 [B].

    Source: Xiao et al. (2024), as the paper compares with it: lambda = 0.01.
    """
    return _nearer(step.path_before, step.path)


def _nearer(before: Tensor, after: Tensor) -> Tensor:
    """How many metres nearer; 0 where there is no finite distance."""
    return torch.nan_to_num(before - after, nan=0.0, posinf=0.0, neginf=0.0)


def total_reward(r_o: Tensor, collided: Tensor, collision_penalty: float) -> Tensor:
    """R = r_o + r_c.

    Args:
        r_o: float32 [B].
        collided: bool [B].
        collision_penalty: r_c on a collision; 0 in stage one.

    Returns:
        float32 [B].

    Source: Eq. 4.
    """
    return r_o + collision_penalty * collided
