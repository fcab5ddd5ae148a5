"""How good the predictor is in rooms that it does not learn in, and whether that ends stage one.

The paper's stage one has E_1 episodes. By the rule it goes on from there until the predictor no
longer gains. What is hard to foresee changes with the policy (one that begins to walk meets other
walls), so AUCs of two validations cannot be compared: a predictor that was kept is judged beside
the present one, at the same steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cfnav_core.agent.config import TrainOptions
from cfnav_core.agent.methods import Method
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Trace
from cfnav_core.task.actions import Action
from cfnav_core.task.calibration import auc, brier

Rule = tuple[int, float, int]
"""``stage1_most``, ``stage1_rise`` and ``stage1_patience`` of ``TrainOptions``."""

NO_RULE: Rule = (0, 0.0, 0)


@dataclass
class StageOne:
    """What a run knows of its stage one.

    Attributes:
        aucs: episodes and AUC of the predictor, of each validation that could tell one.
        kept: episodes after which the predictor last gained; None before, and without a rule.
        without_gain: validations since then.
        ended: episodes after which the rule ended it; None before that, and without a rule.
        frozen: episodes that the frozen predictor learned from, and its AUC at the end.
    """

    aucs: list[list[float]] = field(default_factory=list)
    kept: int | None = None
    without_gain: int = 0
    ended: int | None = None
    frozen: list[float] | None = None

    def gains(self, episodes: int, auc: float, kept_auc: float, rise: float) -> bool:
        """Whether the predictor is better than the kept one by ``rise``; NaN cannot tell."""
        gained = auc >= kept_auc + rise or (self.kept is None and not math.isnan(auc))
        self.kept = episodes if gained else self.kept
        self.without_gain = 0 if gained else self.without_gain + 1
        return gained


def rule_of(options: TrainOptions, method: Method) -> Rule:
    """The rule that is asked for, ``NO_RULE`` where there is none.

    Raises:
        ValueError: it makes no sense with the other options, or for the method.
    """
    most, least = options.stage1_most, options.run.hyperparameters.stage1_episodes
    if not most:
        return NO_RULE
    if most < max(least, 1):
        raise ValueError(
            f"found --stage1-most {most}, expected at least the {least} episodes after which it "
            "may end; change it or --stage1-episodes"
        )
    if options.stage1:
        raise ValueError(
            f"found --stage1-most with the stage one of {options.stage1}, which has its length; "
            "leave out one of them"
        )
    if options.workers:
        raise ValueError(
            f"found --stage1-most with {options.workers} asynchronous workers, which go on "
            "learning while a validation judges; leave out one of them"
        )
    alone = method.stage1.predicts_for_nobody and not method.shared_encoder
    if method.stage2.train_predictor or not alone:
        raise ValueError(
            f"found --stage1-most with method {options.run.method}, expected one whose predictor "
            "learns in stage one alone, by its own encoder, and is read by nobody there, such as "
            "ours; leave it out"
        )
    return most, options.stage1_rise, options.stage1_patience


def predictor_figures(bank: SceneBank, trace: Sequence[Trace]) -> dict[str, float]:
    """How good p_hat was at the MoveAheads of episodes.

    A state in which an episode moves ahead again counts once: an episode that is stuck at a wall
    would outweigh all others.

    Returns:
        predictor_auc, predictor_brier, predictor_blocked (share of collisions) and predictor_steps;
        without those that these steps cannot tell.
    """
    episodes, states, actions, p_hat = (
        np.concatenate([getattr(step, name) for step in trace])
        for name in ("episodes", "states", "actions", "p_hat")
    )
    ahead = np.flatnonzero(actions == Action.MoveAhead)
    _, first = np.unique(np.stack([episodes[ahead], states[ahead]]), axis=1, return_index=True)
    tried = ahead[first]
    found: dict[str, float] = {"predictor_steps": len(tried)}
    if len(tried):
        p, blocked, ones = (
            p_hat[tried].astype(float),
            bank.collided[states[tried]],
            np.ones(len(tried)),
        )
        found |= {
            "predictor_blocked": float(blocked.mean()),
            "predictor_brier": brier(p, blocked, ones),
        }
        if not math.isnan(area := auc(p, blocked)):
            found["predictor_auc"] = area
    return found
