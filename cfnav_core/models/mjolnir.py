"""MJOLNIR-r: Baseline with words, and a graph network over all objects of the vocabulary.

Source: Pal, Qiu, Christensen, Learning Hierarchical Relationships for Object-Goal Navigation
(2021), as in its public code.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.models.base import Knowledge, ModelInput, NavModel, ObservationSpec, State
from cfnav_core.models.baseline import WordFusion
from cfnav_core.models.parts.graphs import normalised
from cfnav_core.models.parts.heads import ActorCritic, initialise
from cfnav_core.models.parts.reading import columns_of, similarities, table
from cfnav_core.models.size import ModelSize


class ObjectGraph(nn.Module):
    """Four graph layers over the objects; the adjacency is trained too.

    Args:
        adjacency: float32 [C, C], normalised.
        words: float32 [C, W].
        context: width K + 1 of an object's context with its similarity to the goal.
        width: of the vector that comes out; hidden nodes have the input's width, at most this.
    """

    words: Tensor

    def __init__(self, adjacency: Tensor, words: Tensor, context: int, width: int) -> None:
        super().__init__()
        objects, node = len(words), len(words) + words.shape[1]
        hidden = min(node, width)
        self.objects = objects
        self.adjacency = nn.Parameter(adjacency.clone())
        self.register_buffer("words", words, persistent=False)
        self.first = nn.Linear(node, hidden, bias=False)
        self.second = nn.Linear(hidden, hidden, bias=False)
        self.third = nn.Linear(hidden, context, bias=False)
        self.last = nn.Linear(2 * context, 1, bias=False)
        self.out = nn.Linear(objects, width)

    def forward(self, context: Tensor) -> Tensor:
        """Encode.

        Args:
            context: float32 [B, C, K + 1]; column 0 says whether the object is there.

        Returns:
            Float32 [B, width].
        """
        # A node's input is what is there, the same for all, beside its own word; multiplied apart,
        # and weights before adjacency, as that is half the work.
        presence, word = self.first.weight.split(list(self.words.shape), 1)
        there = F.linear(context[:, :, 0], presence)
        own = self.adjacency @ F.linear(self.words, word)
        x = self.adjacency.sum(1, keepdim=True) @ there.view(1, -1)
        x = torch.relu_(x.view(self.objects, -1, own.shape[1]) + own[:, None])
        x = self._passed(self.second(x.flatten(0, 1)))
        x = self._passed(self.third(x))
        x = torch.cat([x, context.transpose(0, 1).flatten(0, 1)], 1)
        x = self._passed(self.last(x))
        return self.out(x.view(self.objects, -1).t())

    def _passed(self, x: Tensor) -> Tensor:
        """Along the edges, and ReLU: float32 [C * B, N] to the same shape.

        Objects stand before episodes, so that both the layers and the adjacency multiply a matrix
        as it lies in memory.
        """
        mixed = torch.relu_(self.adjacency @ x.view(self.objects, -1))
        return mixed.view(-1, x.shape[1])


class MjolnirR(NavModel):
    """MJOLNIR-r.

    Args:
        inputs: detections of a known table.
        size: widths; ``hidden`` is also that of the graph's vector.
        knowledge: needs words and adjacency.
    """

    words: Tensor
    similarity: Tensor

    reward = "mjolnir"
    title = "MJOLNIR-r"

    def __init__(self, inputs: ObservationSpec, size: ModelSize, knowledge: Knowledge) -> None:
        super().__init__()
        objects = len(inputs.objects)
        self.columns = columns_of(inputs.fields)
        _, _, context = self.columns.widths
        words = table(knowledge, "words", objects, None)
        adjacency = table(knowledge, "adjacency", objects, objects)
        self.register_buffer("words", words, persistent=False)
        self.register_buffer("similarity", similarities(words), persistent=False)
        self.encoder = WordFusion(inputs, size, words.shape[1])
        self.graph = ObjectGraph(normalised(adjacency), words, context + 1, size.hidden)
        self.policy = ActorCritic(self.encoder.width + size.hidden, size.hidden, layers=1)
        self.state_shapes = self.policy.state_shapes
        initialise(self, self.graph)

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        similarity = (seen.goal @ self.similarity)[:, :, None]
        context = torch.cat([self.columns.read(seen.detections).context, similarity], 2)
        x = torch.cat([self.encoder(seen, seen.goal @ self.words), self.graph(context)], 1)
        return self.policy(x, seen.collision_probability, state)
