"""Bundles of real networks that answer a list of actions for each goal, whatever they see."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from torch import Tensor

from cfnav_core.agent.agent import Agent
from cfnav_core.agent.collision_predictor import CollisionPredictor
from cfnav_core.agent.reward import REWARDS, RewardTables
from cfnav_core.files.provenance import sha256
from cfnav_core.learn.export import export_networks
from cfnav_core.models.base import Knowledge, ModelInput, NavModel, ObservationSpec
from cfnav_core.perception.net import PerceptionNet, export_perception
from cfnav_core.perception.perception import FEATURES
from cfnav_core.policy.bundle import PERCEPTION, WEIGHTS, BundleError, BundleHead
from cfnav_core.task.actions import NUM_ACTIONS, Action
from cfnav_core.task.detections import SCORES, SIGHTINGS, Fields
from cfnav_core.task.vocabulary import CATEGORIES, CATEGORY_ID


class CountedActions(NavModel):
    """Logits from a table of steps for each goal; after its end the last action for good.

    Args:
        lists: actions of each goal.
    """

    table: Tensor

    def __init__(self, lists: Mapping[str, Sequence[Action]]) -> None:
        super().__init__()
        self.length = max(map(len, lists.values()))
        table = torch.zeros(len(CATEGORIES), self.length, NUM_ACTIONS)
        for goal, actions in lists.items():
            for step in range(self.length):
                table[CATEGORY_ID[goal], step, int(actions[min(step, len(actions) - 1)])] = 6.0
        self.register_buffer("table", table.flatten(1))
        self.state_shapes = {"h": (self.length,)}

    def forward(
        self, seen: ModelInput, state: Mapping[str, Tensor]
    ) -> tuple[Tensor, Tensor, dict[str, Tensor]]:
        """One step: a one-hot memory of the step goes on by one."""
        before = state["h"]
        now = torch.cat([1 - before.sum(1, keepdim=True), before[:, :-1]], 1)
        now = torch.cat([now[:, :-1], now[:, -1:] + before[:, -1:]], 1)
        listed = (seen.goal @ self.table).view(-1, self.length, NUM_ACTIONS)
        logits = (now.unsqueeze(2) * listed).sum(1)
        # The exporter leaves out inputs that nothing depends on, and a policy gives them all.
        rest = seen.detections.sum() + seen.features.sum() + seen.previous_action.sum()
        logits = logits + 0 * (rest + seen.collision_probability.sum())
        return logits, logits[:, :1], {"h": now}


def write_bundle(
    out: Path, model: NavModel, goals: tuple[str, ...], perception: PerceptionNet | None = None,
    fields: Fields = SCORES,
) -> None:  # fmt: skip
    """Write a bundle that drives with a model, with perception that has learnt nothing.

    Where it reads sightings there is none.
    """
    out.mkdir()
    if fields != SIGHTINGS:
        export_perception(perception or PerceptionNet(), out / PERCEPTION)
    inputs = ObservationSpec((FEATURES,), fields, CATEGORIES)
    predictor = CollisionPredictor(inputs.features)
    tables = RewardTables.of("baseline", Knowledge())
    agent = Agent(model, predictor, REWARDS["baseline"], tables)
    export_networks(agent, inputs, out)
    (out / WEIGHTS).touch()  # the networks hold their numbers themselves
    hashes = {path.name: sha256(path) for path in sorted(out.iterdir())}
    head = BundleHead(out.name, "ours", True, CATEGORIES, goals, hashes, {}, {}, fields=fields)
    head.save(out)


def make_bundle(
    folder: Path, lists: Mapping[str, Sequence[Action]], reads_sightings: bool = False
) -> Path:
    """Write a bundle that answers these actions, one list for each goal; returns its folder.

    It looks at pictures, or at what a detector says. It is named by a hash of the actions, so that
    one which is there already can be used again.
    """
    named = {goal: [action.name for action in actions] for goal, actions in lists.items()}
    name = hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()[:12]
    out = folder / f"{'sighted' if reads_sightings else 'listed'}-{name}"
    try:
        BundleHead.load(out)
    except BundleError:  # missing, cut short, or made for older code
        shutil.rmtree(out, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
        fields = SIGHTINGS if reads_sightings else SCORES
        write_bundle(out, CountedActions(lists), tuple(lists), fields=fields)
    return out
