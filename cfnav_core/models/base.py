"""The contract of navigation models, and the recurrent actor-critic they share (Eq. 2)."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.actions import NUM_ACTIONS

Hidden = tuple[Tensor, Tensor]
"""h and c of an LSTM, float32 [B, H] each."""


def lstm_step(cell: nn.LSTMCell, x: Tensor, hidden: Hidden) -> Hidden:
    """One step of an LSTM cell written out, so that it exports to ONNX as plain operators."""
    gates = F.linear(x, cell.weight_ih, cell.bias_ih) + F.linear(
        hidden[0], cell.weight_hh, cell.bias_hh
    )
    i, f, g, o = gates.chunk(4, 1)
    c = torch.sigmoid(f) * hidden[1] + torch.sigmoid(i) * torch.tanh(g)
    return torch.sigmoid(o) * torch.tanh(c), c


class NavModel(nn.Module):
    """pi(a | I, g, p_hat; theta) and V. Source: Eq. 2.

    A model implements ``encode``; the LSTM reads its output with the collision probability
    appended as one more number.

    Args:
        encoded: width of what ``encode`` returns.
        hidden: LSTM width H.
    """

    def __init__(self, encoded: int, hidden: int) -> None:
        super().__init__()
        self.hidden = hidden
        self.lstm = nn.LSTMCell(encoded + 1, hidden)
        self.actor = nn.Linear(hidden, NUM_ACTIONS)
        self.critic = nn.Linear(hidden, 1)
        nn.init.normal_(self.actor.weight, std=0.01)
        nn.init.zeros_(self.actor.bias)

    def encode(
        self, features: Tensor, detections: Tensor, goal: Tensor, previous_action: Tensor
    ) -> Tensor:
        """Everything the policy reads but p_hat.

        Args:
            features: float32 [B, F].
            detections: float32 [B, C, 5].
            goal: float32 [B, C], one-hot.
            previous_action: float32 [B, 6], zeros at the start.

        Returns:
            float32 [B, encoded].
        """
        raise NotImplementedError

    def forward(
        self, features: Tensor, detections: Tensor, goal: Tensor, previous_action: Tensor,
        collision_probability: Tensor, h: Tensor, c: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:  # fmt: skip
        """One step.

        Args:
            features: see ``encode``.
            detections: see ``encode``.
            goal: see ``encode``.
            previous_action: see ``encode``.
            collision_probability: float32 [B, 1]; zero in stage one.
            h: float32 [B, H].
            c: float32 [B, H].

        Returns:
            Action logits [B, 6], value [B, 1], and the next h and c [B, H].
        """
        x = self.encode(features, detections, goal, previous_action)
        h, c = lstm_step(self.lstm, torch.cat([x, collision_probability], 1), (h, c))
        return self.actor(h), self.critic(h), h, c
