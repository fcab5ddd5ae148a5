"""Bundles of real networks that answer a list of actions, then repeat the last."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from cfnav_core.actions import NUM_ACTIONS, Action
from cfnav_core.bundle import NETWORKS, BundleHead, file_hash
from cfnav_core.collision_predictor import CollisionPredictor
from cfnav_core.export import export_networks
from cfnav_core.perception import FEATURES
from cfnav_core.perception_net import PerceptionNet, export_perception


class ActionTable(nn.Module):
    """Logits from a table of previous actions, with a small share of what is seen."""

    hidden = 8

    def __init__(self, names):
        super().__init__()
        actions = [int(Action[name]) for name in names]
        table = torch.zeros(NUM_ACTIONS + 1, NUM_ACTIONS)
        for before, after in zip([NUM_ACTIONS, *actions], [*actions, actions[-1]], strict=True):
            table[before, after] = 6.0
        self.register_buffer("table", table)
        self.seen = nn.Linear(FEATURES, NUM_ACTIONS)

    def forward(self, features, detections, goal, previous, probability, h, c):
        first = 1 - previous.sum(1, keepdim=True)
        logits = torch.cat([previous, first], 1) @ self.table
        logits = logits + 0.1 * torch.tanh(self.seen(features)) + 0.1 * probability
        rest = 0 * (detections.sum() + goal.sum())
        return logits + rest, logits[:, :1], h + 0, c + 0


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
            out.mkdir()
            export_perception(self.perception, out / "perception.onnx")
            predictor = CollisionPredictor()
            export_networks(ActionTable(names), predictor, out)
            hashes = {name: file_hash(out / name) for name in NETWORKS}
            BundleHead(
                out.name, "ours", True, ("Laptop", "Mug"), (8, predictor.hidden), hashes, {}, {}
            ).save(out)
        return out
