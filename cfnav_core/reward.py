"""Rewards: pure functions of what one step did."""

from __future__ import annotations

import torch
from torch import Tensor

STEP_REWARD = -0.01
SUCCESS_REWARD = 5.0


def nav_reward(success: Tensor) -> Tensor:
    """r_o of the Baseline: -0.01 a step, 5 for a successful Done.

    Args:
        success: bool [B], Done was chosen with the goal visible.

    Returns:
        float32 [B].

    Source: the lineage's plain A3C agent (allenai/savn).
    """
    return torch.where(success, SUCCESS_REWARD, STEP_REWARD)


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
