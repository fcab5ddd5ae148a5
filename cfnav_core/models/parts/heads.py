"""Memory, policy and value of the published networks; the Done gate; how their weights start."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn

from cfnav_core.models.base import State
from cfnav_core.models.parts.picture import PictureMap
from cfnav_core.models.parts.recurrent import LSTMCell
from cfnav_core.task.actions import NUM_ACTIONS, Action

DONE_GATE = 0.58
"""A constant of the published code."""


class ActionEmbedding(nn.Sequential):
    """The previous action, float32 [B, 6], to [B, 10]."""

    width = 10

    def __init__(self) -> None:
        super().__init__(nn.Linear(NUM_ACTIONS, self.width), nn.ReLU())


class ActorCritic(nn.Module):
    """LSTM layers and the two heads. Source: Eq. 2.

    p_hat is one more number of the LSTM's input, given without dropout. Where it enters is not
    stated in the paper.

    Args:
        width: of the LSTM's input without p_hat.
        hidden: LSTM width H.
        layers: LSTM layers L; the value's head has as many linear layers, with nothing between.

    Attributes:
        state_shapes: of its part of a model's state.
    """

    def __init__(self, width: int, hidden: int, layers: int) -> None:
        super().__init__()
        inputs = [width + 1] + [hidden] * (layers - 1)
        self.cells = nn.ModuleList(LSTMCell(n, hidden) for n in inputs)
        self.actor = nn.Linear(hidden, NUM_ACTIONS)
        outputs = [hidden] + [64] * (layers - 1) + [1]
        self.critic = nn.Sequential(*(nn.Linear(a, b) for a, b in pairwise(outputs)))
        self.state_shapes = {"h": (layers, hidden), "c": (layers, hidden)}

    def forward(self, x: Tensor, p_hat: Tensor, state: State) -> tuple[Tensor, Tensor, State]:
        """One step.

        Args:
            x: float32 [B, width].
            p_hat: float32 [B, 1].
            state: has h and c, float32 [B, L, H] each.

        Returns:
            Action logits [B, 6], value [B, 1], and the next h and c.
        """
        x = torch.cat([x, p_hat], 1)
        hs, cs = [], []
        for k, cell in enumerate(self.cells):
            assert isinstance(cell, LSTMCell)
            x, c = cell.step(x, state["h"][:, k], state["c"][:, k])
            hs.append(x)
            cs.append(c)
        return self.actor(x), self.critic(x), {"h": torch.stack(hs, 1), "c": torch.stack(cs, 1)}


def gate_done(logits: Tensor, confidence: Tensor, goal: Tensor) -> Tensor:
    """Multiply the logit of Done by 0.58 times the confidence that the goal is seen.

    Args:
        logits: float32 [B, 6].
        confidence: float32 [B, C], 0..1.
        goal: float32 [B, C], one-hot.

    Returns:
        Float32 [B, 6]; the logit of Done is 0 where the goal is not seen at all.
    """
    gate = DONE_GATE * (confidence * goal).sum(1, keepdim=True)
    return torch.cat([logits[:, : Action.Done], logits[:, Action.Done :] * gate], 1)


def initialise(model: nn.Module, *later: nn.Module) -> None:
    """Give the weights the start of the published code.

    Linear and convolution layers: Glorot's uniform, no bias; the picture's times sqrt 2. Rows of
    the actor have norm 0.01, those of the critic 1. Biases of LSTM layers are 0.

    Args:
        model: has at most one ``PictureMap`` and one ``ActorCritic``.
        later: layers that the published code makes after this; they keep PyTorch's start.
    """
    kept = {id(module) for layer in later for module in layer.modules()}
    modules = [module for module in model.modules() if id(module) not in kept]
    for module in modules:
        if isinstance(module, nn.Linear | nn.Conv2d):
            nn.init.xavier_uniform_(module.weight)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
        elif isinstance(module, LSTMCell):
            nn.init.zeros_(module.bias_ih)
            nn.init.zeros_(module.bias_hh)
    for module in modules:
        if isinstance(module, PictureMap):
            for weight in module.parameters():
                weight.data *= 2**0.5
        elif isinstance(module, ActorCritic):
            _random_rows(module.actor, 0.01)
            for layer in module.critic:
                _random_rows(layer, 1.0)


def _random_rows(layer: nn.Module, norm: float) -> None:
    """Random directions of one length as the rows of a linear layer."""
    assert isinstance(layer, nn.Linear)
    rows = torch.randn_like(layer.weight)
    layer.weight.data = norm * rows / rows.norm(dim=1, keepdim=True)
