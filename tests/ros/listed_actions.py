"""Bundles whose answers are listed and depend a little on the picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from cfnav_core.models.base import ModelInput, NavModel, State
from cfnav_core.perception.net import PerceptionNet
from cfnav_core.perception.perception import FEATURES
from cfnav_core.task.actions import NUM_ACTIONS, Action
from studies.deploy.bundles import write_bundle


class ActionTable(NavModel):
    """Logits from a table of previous actions, with a small share of what is seen."""

    table: Tensor

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__()
        self.state_shapes = {"h": (8,), "c": (8,)}
        actions = [int(Action[name]) for name in names]
        table = torch.zeros(NUM_ACTIONS + 1, NUM_ACTIONS)
        for before, after in zip([NUM_ACTIONS, *actions], [*actions, actions[-1]], strict=True):
            table[before, after] = 6.0
        self.register_buffer("table", table)
        self.look = nn.Linear(FEATURES, NUM_ACTIONS)

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel``."""
        first = 1 - seen.previous_action.sum(1, keepdim=True)
        logits = torch.cat([seen.previous_action, first], 1) @ self.table
        logits = logits + 0.1 * torch.tanh(self.look(seen.features))
        logits = logits + 0.1 * seen.collision_probability
        rest = 0 * (seen.detections.sum() + seen.goal.sum())
        return logits + rest, logits[:, :1], {k: v + 0 for k, v in state.items()}


class ListedActions:
    """Makes each bundle once, in a folder named after its actions."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        torch.manual_seed(0)
        self.perception = PerceptionNet()

    def __call__(self, *names: str) -> Path:
        """Return the folder of the bundle that answers these actions."""
        out = self.folder / "-".join(names)
        if not out.exists():
            write_bundle(out, ActionTable(names), ("Laptop", "Mug"), self.perception)
        return out
