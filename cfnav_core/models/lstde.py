"""L-sTDE: object relations weighted by a layout belief, and a counterfactual at test time.

Source: Zhang, Song et al., Layout-based Causal Inference for Object Navigation (2023), as in its
public code, which evaluates with threshold 0.5. The belief is state of an episode.
"""

from __future__ import annotations

import torch
from torch import Tensor

from cfnav_core.models.base import Knowledge, ModelInput, NavModel, ObservationSpec, State
from cfnav_core.models.parts import layout
from cfnav_core.models.parts.heads import ActionEmbedding, ActorCritic, gate_done, initialise
from cfnav_core.models.parts.picture import Fusion, PictureMap
from cfnav_core.models.parts.reading import columns_of, table
from cfnav_core.models.parts.relation import RelationEncoder
from cfnav_core.models.size import ModelSize


class LayoutModel(NavModel):
    """What L-sTDE and AKGVP share.

    In training, picture and present relations are removed in one forward of two, for each episode
    by itself. At test the same is removed for the counterfactual pass, whose logits are subtracted
    by how new the room's layout is. p_hat is the same in both passes; the paper does not say.

    State: ``added`` and ``last`` of ``layout.Update``, and ``gap``, the layout gap.

    Args:
        inputs: detections of a known table.
        size: widths.
        knowledge: needs layout.
        codes: float32 [C, X], what marks each object when it is the goal.
        threshold: of the layout gap at test; None leaves out the counterfactual pass.
    """

    prior: Tensor
    codes: Tensor

    reward = "layout"

    def __init__(
        self, inputs: ObservationSpec, size: ModelSize, knowledge: Knowledge, codes: Tensor,
        threshold: float | None,
    ) -> None:  # fmt: skip
        super().__init__()
        objects, k = len(inputs.objects), size.channels
        self.columns = columns_of(inputs.fields)
        appearance, info, _ = self.columns.widths
        self.threshold = threshold
        self.register_buffer(
            "prior", _prior(knowledge, len(inputs.room_types), objects), persistent=False
        )
        self.register_buffer("codes", codes, persistent=False)
        self.picture = PictureMap(inputs.features, k)
        shape = (objects, appearance, info, codes.shape[1], self.picture.side)
        self.experience = RelationEncoder(*shape, mixes=4)
        self.present = RelationEncoder(*shape, mixes=2)
        self.action = ActionEmbedding()
        parts = (k, objects, objects, self.action.width)
        self.fusion = Fusion(parts, k, self.picture.side, size.dropout)
        self.policy = ActorCritic(self.fusion.width, size.hidden, layers=2)
        self.state_shapes = {
            **self.policy.state_shapes, "added": (objects,), "last": (objects,), "gap": (1,),
        }  # fmt: skip
        initialise(self)

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        rows = self.columns.read(seen.detections)
        prior = self.prior[seen.room.argmax(1)]
        belief = layout.update(rows.detected, state["added"], state["last"])
        weight = layout.attention(prior, belief.added, seen.goal)
        experience = torch.relu(self.experience(rows, seen.goal, self.codes, weight))
        picture, present = self.picture(seen.features), self.present(rows, seen.goal, self.codes)
        action = self.action(seen.previous_action)

        def answer(keep: Tensor | int) -> tuple[Tensor, Tensor, State]:
            x = self.fusion(picture * keep, experience, present * keep, action)
            logits, value, memory = self.policy(x, seen.collision_probability, state)
            return gate_done(logits, rows.confidence, seen.goal), value, memory

        logits, value, memory = answer(_coins(picture) if self.training else 1)
        gap = layout.FADE * state["gap"]
        if self.threshold is not None and not self.training:
            gap = torch.where(belief.new, layout.gap(prior, state["added"], belief.added), gap)
            without, _, _ = answer(0)
            # the published second pass finds nothing new and fades the gap before it is read
            gap = layout.FADE * gap
            logits = layout.subtract_counterfactual(logits, without, gap, self.threshold)
        return logits, value, {**memory, "added": belief.added, "last": belief.last, "gap": gap}


class LSTDE(LayoutModel):
    """L-sTDE: the goal's row is marked with a 1; the counterfactual pass is on.

    Args:
        inputs: see ``LayoutModel``.
        size: widths.
        knowledge: needs layout.
        threshold: see ``LayoutModel``.
    """

    title = "L-sTDE"

    def __init__(
        self,
        inputs: ObservationSpec,
        size: ModelSize,
        knowledge: Knowledge,
        threshold: float | None = 0.5,
    ) -> None:
        super().__init__(inputs, size, knowledge, torch.ones(len(inputs.objects), 1), threshold)


def _coins(picture: Tensor) -> Tensor:
    """0 or 1 for each picture, [B, 1, 1, 1]."""
    return torch.randint(2, (len(picture), 1, 1, 1), device=picture.device)


def _prior(knowledge: Knowledge, rooms: int, objects: int) -> Tensor:
    """The layout counts.

    Raises:
        ValueError: they are missing, of another shape, or not positive off the diagonal.
    """
    prior = table(knowledge, "layout", rooms, objects, objects)
    least = (prior + torch.eye(objects)).min()
    if not least > 0:
        raise ValueError(
            f"found a layout count of {least:g}, expected counts above 0 off the diagonal; add 1 "
            "to each of them"
        )
    return prior
