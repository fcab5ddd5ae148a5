"""TDANet-style: attention to the objects that say most about the goal, before and at the goal.

The article (Lian, Zhang, TDANet: Target-Directed Attention Network, 2024) has no public code, and
its sizes are unknown. This is a network of its two ideas: attention over objects by words and by
place, and one encoder for the present view and for the view at the goal (Siamese). It reads no
picture features. Where detections are sightings, which say where a thing is, it also knows where
each object was seen before (``parts.places``); that is ours. Nothing is indexed by class but
through words, so that it takes goals and objects it was not trained with.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cfnav_core.models.base import Knowledge, ModelInput, NavModel, ObservationSpec, State
from cfnav_core.models.parts.heads import ActionEmbedding, ActorCritic, initialise
from cfnav_core.models.parts.places import FOUND, WIDTH, Places
from cfnav_core.models.parts.reading import columns_of, similarities, table
from cfnav_core.models.size import ModelSize
from cfnav_core.task.detections import SIGHTINGS

KEY, VALUE = 64, 128


class TargetAttention(nn.Module):
    """A view as one vector: objects weighted by what they say about the goal, and the goal's own.

    Args:
        word: width W of the word vectors.
        context: width K.

    Attributes:
        width: of the vector that comes out.
    """

    def __init__(self, word: int, context: int) -> None:
        super().__init__()
        self.query = nn.Linear(word, KEY)
        self.key = nn.Linear(word, KEY)
        self.place = nn.Sequential(
            nn.Linear(2 * context, KEY), nn.ReLU(inplace=True), nn.Linear(KEY, 1)
        )
        self.value = nn.Sequential(
            nn.Linear(context + 1, VALUE), nn.ReLU(inplace=True),
            nn.Linear(VALUE, VALUE), nn.ReLU(inplace=True),
        )  # fmt: skip
        self.width = VALUE + context

    def forward(
        self, context: Tensor, there: Tensor, goal: Tensor, words: Tensor, similarity: Tensor
    ) -> Tensor:
        """Encode a view.

        Args:
            context: float32 [B, C, K].
            there: float32 [B, C], 0 or 1: which objects can be attended to.
            goal: float32 [B, C], one-hot.
            words: float32 [C, W].
            similarity: float32 [B, C], of words to the goal's.

        Returns:
            Float32 [B, width]; without any object its first part is zero.
        """
        own = (context * goal[:, :, None]).sum(1)
        semantic = self.query(goal @ words) @ self.key(words).T / KEY**0.5
        # a view shows one or two objects of 38: the layers are asked about those alone
        at = there.flatten().nonzero()[:, 0]

        def of(table: Tensor) -> Tensor:
            return table.flatten(0, 1).index_select(0, at)

        seen, own_of = of(context), of(own[:, None].expand_as(context))
        score = of(semantic) + self.place(torch.cat([seen, own_of], 1))[:, 0]
        scores = torch.full_like(there, -1e9).flatten().index_put((at,), score).view_as(there)
        weight = torch.softmax(scores, 1) * there
        value = self.value(torch.cat([seen, of(similarity)[:, None]], 1))
        shown = weight.new_zeros(there.numel(), VALUE).index_put((at,), value)
        return torch.cat([(weight[:, None] @ shown.view(*there.shape, VALUE))[:, 0], own], 1)

    def of_goal(self, context: Tensor, similarity: Tensor) -> Tensor:
        """Encode a view that shows nothing but the goal: all attention is the goal's.

        Args:
            context: float32 [B, K], of the goal.
            similarity: float32 [B, 1], of the goal's word to itself.

        Returns:
            Float32 [B, width], what ``forward`` would give.
        """
        return torch.cat([self.value(torch.cat([context, similarity], 1)), context], 1)


class TDANet(NavModel):
    """A network in the manner of TDANet, see the module.

    Args:
        inputs: detections of a known table.
        size: widths; there are no maps, so ``channels`` and ``dropout`` mean nothing here.
        knowledge: needs words.
    """

    words: Tensor
    similarity: Tensor
    found: Tensor

    reward = "similarity"
    title = "TDANet-style"
    zero_shot = True

    def __init__(self, inputs: ObservationSpec, size: ModelSize, knowledge: Knowledge) -> None:
        super().__init__()
        self.columns = columns_of(inputs.fields)
        self.tracks = self.columns.context.needs == SIGHTINGS
        found = self.columns.context.found + (FOUND if self.tracks else ())
        words = table(knowledge, "words", len(inputs.objects), None)
        self.register_buffer("words", words, persistent=False)
        self.register_buffer("similarity", similarities(words), persistent=False)
        self.register_buffer("found", torch.tensor(found), persistent=False)
        self.encoder = TargetAttention(words.shape[1], len(found))
        self.action = ActionEmbedding()
        width = 3 * self.encoder.width + self.action.width
        self.policy = ActorCritic(width, size.hidden, layers=1)
        self.state_shapes = {**self.policy.state_shapes}
        if self.tracks:
            self.state_shapes["places"] = (len(inputs.objects), WIDTH)
        initialise(self)

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        goal, similarity = seen.goal, seen.goal @ self.similarity
        context, there, remembered = self._known(seen, state)
        now = self.encoder(context, there, goal, self.words, similarity)
        own = (goal * similarity).sum(1, keepdim=True)
        at_goal = self.encoder.of_goal(self.found.expand(own.shape[0], -1), own)
        x = torch.cat([now, at_goal, now - at_goal, self.action(seen.previous_action)], 1)
        logits, value, after = self.policy(x, seen.collision_probability, state)
        return logits, value, {**after, **remembered}

    def _known(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """Context [B, C, K] of the objects, which can be attended to, what is remembered of them.

        Those that are seen; of sightings also those that were seen before, where they are now.
        """
        rows = self.columns.read(seen.detections)
        if not self.tracks:
            return rows.context, rows.detected, {}
        action, columns = seen.previous_action, self.columns.columns
        now = Places.of_sightings(*(seen.detections[:, :, at] for at in columns))
        known = Places.read(state["places"]).after(action).with_new(now, action)
        context = torch.cat([rows.context, known.context()], 2)
        return context, known.there, {"places": known.write()}
