"""Compact: one small network over any perception, made for training on a laptop.

The class-label form of the paper's Baseline without maps: everything that was seen is one vector.
It is no published network.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from cfnav_core.models.base import (
    Knowledge,
    ModelInput,
    NavModel,
    ObservationSpec,
    State,
    actor,
)
from cfnav_core.models.parts.recurrent import LSTMCell
from cfnav_core.models.size import ModelSize
from cfnav_core.task.actions import NUM_ACTIONS


class Compact(NavModel):
    """Picture features, all detections and the goal's own, in one LSTM.

    Args:
        inputs: of any shape.
        size: its ``channels`` mean nothing here.
        knowledge: nothing of it is needed.
    """

    title = "compact"

    def __init__(self, inputs: ObservationSpec, size: ModelSize, knowledge: Knowledge) -> None:
        super().__init__()
        objects, columns, hidden = len(inputs.objects), inputs.detections, size.hidden
        seen = math.prod(inputs.features) + objects * columns
        self.picture = nn.Sequential(nn.Linear(seen, 256), nn.ReLU())
        self.dropout = nn.Dropout(size.dropout)
        self.goal = nn.Linear(objects, 32, bias=False)
        self.target = nn.Sequential(nn.Linear(32 + columns, 64), nn.ReLU())
        self.action = nn.Sequential(nn.Linear(NUM_ACTIONS, 10), nn.ReLU())
        self.lstm = LSTMCell(256 + 64 + 10 + 1, hidden)
        self.actor = actor(hidden)
        self.critic = nn.Linear(hidden, 1)
        self.state_shapes = {"h": (hidden,), "c": (hidden,)}

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        own = (seen.detections * seen.goal[:, :, None]).sum(1)
        everything = torch.cat([seen.features.flatten(1), seen.detections.flatten(1)], 1)
        x = torch.cat([
            self.picture(self.dropout(everything)),
            self.target(torch.cat([self.goal(seen.goal), own], 1)),
            self.action(seen.previous_action),
            seen.collision_probability,
        ], 1)  # fmt: skip
        h, c = self.lstm.step(x, state["h"], state["c"])
        return self.actor(h), self.critic(h), {"h": h, "c": c}
