"""Training methods as rows of one table. The trainer reads a ``Stage``; it knows no names."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """What one training stage does.

    Attributes:
        collision_penalty: r_c of Eq. 4.
        train_predictor: learn P(I_t; phi) from MoveAhead steps.
        feed_prediction: give p_hat to the policy; zero otherwise.
    """

    collision_penalty: float = 0.0
    train_predictor: bool = False
    feed_prediction: bool = False


@dataclass(frozen=True)
class Method:
    """Stage one and stage two."""

    stage1: Stage
    stage2: Stage


METHODS: dict[str, Method] = {
    "ours": Method(
        Stage(train_predictor=True), Stage(collision_penalty=-0.5, feed_prediction=True)
    ),
    "plain": Method(Stage(), Stage()),
    "stage_only": Method(Stage(), Stage(collision_penalty=-0.5)),
    "reward": Method(Stage(collision_penalty=-0.1), Stage(collision_penalty=-0.1)),
}
"""ours and the two ablations it is judged by, and Reward. Source: Sections V-C and V-D."""
