"""Training methods as rows of one table. The trainer reads a ``Stage``; it knows no names."""

from __future__ import annotations

from dataclasses import dataclass

from cfnav_core.task.p_hat import PHat


@dataclass(frozen=True)
class Stage:
    """What one training stage does.

    Attributes:
        collision_penalty: r_c of Eq. 4.
        train_predictor: learn P(I_t; phi) from MoveAhead steps.
        feed_prediction: give p_hat to the policy; zero otherwise.
        feed_truth: in training, give it the true flag where it will be given p_hat.
        distance_shaping: lambda of Xiao et al., reward per metre that the way gets shorter.
    """

    collision_penalty: float = 0.0
    train_predictor: bool = False
    feed_prediction: bool = False
    feed_truth: bool = False
    distance_shaping: float = 0.0

    @property
    def p_hat(self) -> PHat:
        """What the policy is given."""
        if not self.feed_prediction:
            return "zero"
        return "true" if self.feed_truth else "own"

    @property
    def predicts_for_nobody(self) -> bool:
        """The predictor learns, and the policy does not read it."""
        return self.train_predictor and self.p_hat != "own"


@dataclass(frozen=True)
class Method:
    """Stage one and stage two.

    Attributes:
        shared_encoder: the predictor reads the policy's own picture encoder and trains it too.
    """

    stage1: Stage
    stage2: Stage
    shared_encoder: bool = False


def throughout(stage: Stage, shared_encoder: bool = False) -> Method:
    """One stage all the time."""
    return Method(stage, stage, shared_encoder)


PREDICT = Stage(train_predictor=True)

METHODS: dict[str, Method] = {
    "ours": Method(PREDICT, Stage(collision_penalty=-0.5, feed_prediction=True)),
    "plain": throughout(Stage()),
    "reward": throughout(Stage(collision_penalty=-0.1)),
    "xiao": throughout(Stage(collision_penalty=-0.1, distance_shaping=0.01)),
    "wu": throughout(PREDICT, shared_encoder=True),
    "stage_only": Method(Stage(), Stage(collision_penalty=-0.5)),
    "cp_only": throughout(Stage(train_predictor=True, feed_prediction=True)),
    "reward_only": throughout(Stage(collision_penalty=-0.5)),
    "truth": Method(PREDICT, Stage(collision_penalty=-0.5, feed_prediction=True, feed_truth=True)),
}
"""ours, the original model, the three comparisons and the three ablations. Source: Section V.

Wu et al. train the prediction as an auxiliary task and feed it to nobody. Reward Only keeps the
penalty of ours from the first episode on; with -0.1 it would repeat Reward. Truth is not in the
paper: in stage two the simulator knows what the robot's LiDAR will nearly know, and a policy that
was never lied to has more reason to listen.
"""
