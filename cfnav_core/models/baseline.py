"""Baseline: picture features beside the goal's word vector or class label.

Source: Section V-B of the paper ("the word embedding or class label of the target"); the layers
are those of its lineage, SAVN (words) and HOZ's plain agent (labels).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cfnav_core.models.base import Knowledge, ModelInput, NavModel, ObservationSpec, State
from cfnav_core.models.parts.heads import ActionEmbedding, ActorCritic, initialise
from cfnav_core.models.parts.picture import Fusion, PictureMap
from cfnav_core.models.parts.reading import table
from cfnav_core.models.size import ModelSize


class WordFusion(nn.Module):
    """Picture, the goal's word vector and the previous action, fused over the picture's map.

    Args:
        inputs: shape of the picture features.
        size: widths.
        word: width W of the word vectors.

    Attributes:
        width: length of the vector that comes out.
    """

    def __init__(self, inputs: ObservationSpec, size: ModelSize, word: int) -> None:
        super().__init__()
        k = size.channels
        self.picture = PictureMap(inputs.features, k)
        self.word = nn.Sequential(nn.Linear(word, k), nn.ReLU())
        self.action = ActionEmbedding()
        parts = (k, k, self.action.width)
        self.fusion = Fusion(parts, k, self.picture.side, size.dropout)
        self.width = self.fusion.width

    def forward(self, seen: ModelInput, word: Tensor) -> Tensor:
        """What is seen, with the goal's word vector [B, W], to float32 [B, width]."""
        picture = self.picture(seen.features)
        return self.fusion(picture, self.word(word), self.action(seen.previous_action))


class BaselineWord(NavModel):
    """Baseline with the goal as a word vector and no detections, for Offline Data 2.

    Args:
        inputs: of any shape; detections are not read.
        size: widths.
        knowledge: needs words.
    """

    words: Tensor

    title = "Baseline (word)"

    def __init__(self, inputs: ObservationSpec, size: ModelSize, knowledge: Knowledge) -> None:
        super().__init__()
        words = table(knowledge, "words", len(inputs.objects), None)
        self.register_buffer("words", words, persistent=False)
        self.encoder = WordFusion(inputs, size, words.shape[1])
        self.policy = ActorCritic(self.encoder.width, size.hidden, layers=1)
        self.state_shapes = self.policy.state_shapes
        initialise(self)

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        x = self.encoder(seen, seen.goal @ self.words)
        return self.policy(x, seen.collision_probability, state)


class BaselineLabel(NavModel):
    """Baseline with the goal as a mark beside its row of the detections, for Offline Data 1.

    Args:
        inputs: of any shape.
        size: widths.
        knowledge: nothing of it is needed.
    """

    reward = "hoz"
    title = "Baseline (label)"

    def __init__(self, inputs: ObservationSpec, size: ModelSize, knowledge: Knowledge) -> None:
        super().__init__()
        objects, k = len(inputs.objects), size.channels
        self.picture = PictureMap(inputs.features, k)
        self.side = self.picture.side
        self.detection = nn.Sequential(nn.Linear(inputs.detections + 1, self.side**2), nn.ReLU())
        self.action = ActionEmbedding()
        parts = (k, objects, self.action.width)
        self.fusion = Fusion(parts, k, self.side, size.dropout)
        self.policy = ActorCritic(self.fusion.width, size.hidden, layers=2)
        self.state_shapes = self.policy.state_shapes
        initialise(self)

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        rows = torch.cat([seen.detections, seen.goal[:, :, None]], 2)
        objects = self.detection(rows).unflatten(2, (self.side, self.side))
        x = self.fusion(self.picture(seen.features), objects, self.action(seen.previous_action))
        return self.policy(x, seen.collision_probability, state)
