"""P(I_t; phi): would MoveAhead collide? Two LSTM layers over picture features and actions."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.actions import NUM_ACTIONS
from cfnav_core.models.base import lstm_step
from cfnav_core.perception import FEATURES


class CollisionPredictor(nn.Module):
    """The collision prediction module. Source: Section IV-B.

    Args:
        hidden: width H' of both LSTM layers; the paper has 512.
    """

    def __init__(self, hidden: int = 128) -> None:
        super().__init__()
        self.hidden = hidden
        self.picture = nn.Sequential(nn.Linear(FEATURES, 128), nn.ReLU())
        self.action = nn.Sequential(nn.Linear(NUM_ACTIONS, 10), nn.ReLU())
        self.lower = nn.LSTMCell(138, hidden)
        self.upper = nn.LSTMCell(hidden, hidden)
        self.head = nn.Linear(hidden, 1)

    def forward(
        self, features: Tensor, previous_action: Tensor, state: Tensor
    ) -> tuple[Tensor, Tensor]:
        """One step.

        Args:
            features: float32 [B, F].
            previous_action: float32 [B, 6], zeros at the start.
            state: float32 [B, 4, H'], h and c of both layers.

        Returns:
            Logit of p_hat [B, 1] and the next state [B, 4, H'].
        """
        x = torch.cat([self.picture(features), self.action(previous_action)], 1)
        h1, c1 = lstm_step(self.lower, x, (state[:, 0], state[:, 1]))
        h2, c2 = lstm_step(self.upper, h1, (state[:, 2], state[:, 3]))
        return self.head(h2), torch.stack([h1, c1, h2, c2], 1)


def collision_loss(logit: Tensor, collided: Tensor, moved_ahead: Tensor) -> Tensor:
    """L_c: cross-entropy over the steps whose action was MoveAhead, their mean.

    Args:
        logit: float32 [N].
        collided: bool [N], p_t.
        moved_ahead: bool [N].

    Returns:
        Scalar; 0 when no step moved ahead.

    Source: Eq. 3.
    """
    each = F.binary_cross_entropy_with_logits(logit, collided.float(), reduction="none")
    return (each * moved_ahead).sum() / moved_ahead.sum().clamp(min=1)
