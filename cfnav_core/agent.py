"""What acts and learns in a run: policy, collision predictor and the reward they learn from."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from cfnav_core.collision_predictor import CollisionPredictor
from cfnav_core.config import RunConfig
from cfnav_core.methods import METHODS
from cfnav_core.models import MODELS, Inputs, Knowledge, NavModel
from cfnav_core.reward import REWARDS, Reward, RewardTables


@dataclass(frozen=True)
class Agent:
    """Networks and reward.

    Attributes:
        model: pi and V. predictor: P(I_t; phi).
        reward: r_o, a row of ``REWARDS``, and the tables it reads.
    """

    model: NavModel
    predictor: CollisionPredictor
    reward: Reward
    tables: RewardTables


def new_agent(
    config: RunConfig, inputs: Inputs, knowledge: Knowledge, device: torch.device | str = "cpu"
) -> Agent:
    """Networks with fresh weights, drawn on the CPU so that they are the same on every device.

    Raises:
        ValueError: an unknown name, knowledge that is missing, or no encoder to share.
    """
    for name, table in (("model", MODELS), ("method", METHODS), ("reward", REWARDS)):
        found = getattr(config, name)
        if found is not None and found not in table:
            raise ValueError(f"found {name} {found!r}, expected one of {', '.join(table)}")
    model = MODELS[config.model](inputs, config.size, knowledge)
    shared = METHODS[config.method].shared_encoder
    predictor = CollisionPredictor(
        inputs.features, config.predictor_hidden, model.picture_encoder() if shared else None
    )
    reward = config.reward or model.reward
    tables = RewardTables.of(reward, knowledge).to(torch.device(device))
    return Agent(model.to(device), predictor.to(device), REWARDS[reward], tables)
