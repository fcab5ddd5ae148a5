"""The contract of navigation models, and what they share (Eq. 2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from cfnav_core.models.parts.picture import PictureMap
from cfnav_core.task.actions import NUM_ACTIONS
from cfnav_core.task.detections import Fields, fields_before_names, width
from cfnav_core.task.vocabulary import FIRST_ROOM_TYPES, ROOM_TYPES

State = dict[str, Tensor]
"""What a model remembers of B episodes, float32 [B, ...] each; zeros when an episode starts."""


@dataclass(frozen=True)
class ObservationSpec:
    """What the scenes of a run offer to a model.

    Attributes:
        features: shape of one state's picture features: (256,) for the built-in perception,
            (512, 7, 7) for ResNet18 maps, (2048, 7, 7) for CLIP's.
        fields: what the D numbers of a row of the detection table mean.
        objects: names of its C rows; goals are among them.
        room_types: names of the R room types, in the order of the one-hot.
    """

    features: tuple[int, ...]
    fields: Fields
    objects: tuple[str, ...]
    room_types: tuple[str, ...] = ROOM_TYPES

    @property
    def detections(self) -> int:
        """D, numbers of a row of the detection table."""
        return width(self.fields)

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> ObservationSpec:
        """From a checkpoint's head; one that was made before fields had names says their number.

        Raises:
            ValueError: it says a number that no table had.
        """
        fields = values.get("fields")
        if fields is None:
            fields = fields_before_names(values["detections"])
        types = values.get("room_types", FIRST_ROOM_TYPES)
        return cls(tuple(values["features"]), tuple(fields), tuple(values["objects"]), tuple(types))


@dataclass(frozen=True)
class Knowledge:
    """Files computed once from training scenes or word lists; models take what they need.

    Attributes:
        words: float32 [C, W], word vectors of the objects.
        text: float32 [C, X], features of a text encoder that belongs to the picture features.
        zones: float32 [4, Z, C], share of a zone's views that show each object, by room type.
        zone_edges: float32 [4, Z, Z], share of neighbouring views between zones, diagonal 1.
        layout: float32 [4, C, C], counts of objects seen together by room type, diagonal 0.
        adjacency: float32 [C, C], 0 or 1, which objects belong together.
        parents: float32 [4, C, C], worth of first seeing j on the way to goal i, by room type.
    """

    words: np.ndarray | None = None
    text: np.ndarray | None = None
    zones: np.ndarray | None = None
    zone_edges: np.ndarray | None = None
    layout: np.ndarray | None = None
    adjacency: np.ndarray | None = None
    parents: np.ndarray | None = None

    def need(self, *names: str) -> list[Tensor]:
        """The named tables as tensors.

        Raises:
            ValueError: one is missing.
        """
        for name in names:
            if getattr(self, name) is None:
                raise ValueError(
                    f"found no {name} among what is known of the objects, but this model needs "
                    "them; make them with cfnav data knowledge"
                )
        return [torch.from_numpy(np.asarray(getattr(self, n), np.float32)) for n in names]

    def arrays(self) -> dict[str, np.ndarray]:
        """Those that are there, by name."""
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: array for name, array in given.items() if array is not None}


@dataclass(frozen=True)
class ModelInput:
    """What a model reads at one step of B episodes, float32.

    Attributes:
        features: [B, *Inputs.features].
        detections: [B, C, D].
        goal: [B, C], one-hot over the objects.
        room: [B, R], one-hot room type.
        previous_action: [B, 6], zeros when an episode starts.
        collision_probability: [B, 1], p_hat; zero in stage one.
    """

    features: Tensor
    detections: Tensor
    goal: Tensor
    room: Tensor
    previous_action: Tensor
    collision_probability: Tensor


class NavModel(nn.Module):
    """pi(a | I, g, p_hat; theta) and V. Source: Eq. 2.

    A model is a pure function of what it sees and remembers: ``forward`` changes nothing in
    itself, so that a bootstrap or counterfactual evaluation advances no memory. ``train`` and
    ``eval`` are the lineage's training and test phases.

    Attributes:
        state_shapes: names and shapes (without B) of what it remembers.
        reward: the row of ``REWARDS`` it was published with.
        title: its name wherever results appear.
        zero_shot: whether it may be asked for objects that it was not trained to find. Then no
            weight belongs to one object, so that such a goal is an input like any other and not an
            untrained weight, and the goal is looked for in the detections.
    """

    state_shapes: Mapping[str, tuple[int, ...]]
    reward: ClassVar[str] = "baseline"
    title: ClassVar[str]
    zero_shot: ClassVar[bool] = False

    def picture_encoder(self) -> nn.Module:
        """The layers that a collision predictor may share: features to a map.

        Raises:
            ValueError: this model has none.
        """
        picture = getattr(self, "picture", None)
        if not isinstance(picture, PictureMap):
            raise ValueError(
                f"found no picture encoder in {type(self).__name__} that a predictor could share; "
                "choose another model or method"
            )
        return picture

    def zero_state(self, batch: int) -> State:
        """At the start of ``batch`` episodes, on the device of the weights."""
        device = next(self.parameters()).device
        return {
            k: torch.zeros(batch, *shape, device=device) for k, shape in self.state_shapes.items()
        }

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """One step.

        Returns:
            Action logits [B, 6], value [B, 1], and what is remembered next.
        """
        raise NotImplementedError


def actor(hidden: int) -> nn.Linear:
    """The policy's last layer, small at first so that every action is tried."""
    layer = nn.Linear(hidden, NUM_ACTIONS)
    nn.init.normal_(layer.weight, std=0.01)
    nn.init.zeros_(layer.bias)
    return layer
