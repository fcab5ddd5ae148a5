"""A policy that hears p_hat twice: as the paper's input of its memory, and beside its answer.

Where p_hat enters is not stated in the paper; there it is one more number among hundreds that the
LSTM reads. Here it is also added to the action logits with a weight for each action, which start at
zero: a straight way from the predictor to the choice. Not in the paper, and in none of its tables.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cfnav_core.models.base import ModelInput, NavModel, State
from cfnav_core.task.actions import NUM_ACTIONS


class Listening(NavModel):
    """Any navigation model with p_hat added to its action logits.

    Args:
        model: which.
    """

    def __init__(self, model: NavModel) -> None:
        super().__init__()
        self.model = model
        self.weight = nn.Parameter(torch.zeros(NUM_ACTIONS))
        self.state_shapes = model.state_shapes

    def picture_encoder(self) -> nn.Module:
        """See ``NavModel.picture_encoder``."""
        return self.model.picture_encoder()

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        logits, value, memory = self.model(seen, state)
        return logits + seen.collision_probability * self.weight, value, memory
