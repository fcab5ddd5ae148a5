"""Baseline: image features beside the class label of the goal. Source: Section V-B of the paper."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cfnav_core.actions import NUM_ACTIONS
from cfnav_core.models.base import NavModel
from cfnav_core.perception import DETECTION_FIELDS, FEATURES
from cfnav_core.vocabulary import CATEGORIES

C, D = len(CATEGORIES), len(DETECTION_FIELDS)


class Baseline(NavModel):
    """The class-label variant with detections, over the built-in perception's compact features.

    Args:
        hidden: LSTM width; the published network has 512.
    """

    def __init__(self, hidden: int = 256) -> None:
        super().__init__(encoded=256 + 64 + 10, hidden=hidden)
        self.picture = nn.Sequential(nn.Linear(FEATURES + C * D, 256), nn.ReLU())
        self.goal = nn.Linear(C, 32, bias=False)
        self.target = nn.Sequential(nn.Linear(32 + D, 64), nn.ReLU())
        self.action = nn.Sequential(nn.Linear(NUM_ACTIONS, 10), nn.ReLU())

    def encode(
        self, features: Tensor, detections: Tensor, goal: Tensor, previous_action: Tensor
    ) -> Tensor:
        """See ``NavModel.encode``."""
        picture = self.picture(torch.cat([features, detections.flatten(1)], 1))
        own = (detections * goal[:, :, None]).sum(1)
        target = self.target(torch.cat([self.goal(goal), own], 1))
        return torch.cat([picture, target, self.action(previous_action)], 1)
