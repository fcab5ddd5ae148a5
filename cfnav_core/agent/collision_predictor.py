"""P(I_t; phi): would MoveAhead collide? Two LSTM layers over picture features and actions."""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.models.parts.recurrent import LSTMCell
from cfnav_core.task.actions import NUM_ACTIONS

COMPACT_WIDTH = 128
MAP_CHANNELS = 64


class CollisionPredictor(nn.Module):
    """The collision prediction module. Source: Section IV-B.

    Args:
        features: shape of the picture features: (F,) or (F, n, n).
        hidden: width H' of both LSTM layers; the paper has 512.
        picture: encoder of another network to read instead of one of its own (Wu et al.), float32
            [B, *features] to [B, ...].

    Attributes:
        state_shape: of what it remembers, (4, H'): h and c of both layers.
    """

    def __init__(
        self, features: Sequence[int], hidden: int = 128, picture: nn.Module | None = None
    ) -> None:
        super().__init__()
        self.state_shape = (4, hidden)
        self.picture = picture or _encoder(features)
        with torch.no_grad():
            width = self.picture(torch.zeros(1, *features)).numel()
        self.action = nn.Sequential(nn.Linear(NUM_ACTIONS, 10), nn.ReLU())
        self.lower = LSTMCell(width + 10, hidden)
        self.upper = LSTMCell(hidden, hidden)
        self.head = nn.Linear(hidden, 1)

    def forward(
        self, features: Tensor, previous_action: Tensor, state: Tensor
    ) -> tuple[Tensor, Tensor]:
        """One step.

        Args:
            features: float32 [B, *features].
            previous_action: float32 [B, 6], zeros at the start.
            state: float32 [B, 4, H'], zeros at the start.

        Returns:
            Logit of p_hat [B, 1] and the next state [B, 4, H'].
        """
        picture = self.picture(features).flatten(1)
        x = torch.cat([picture, self.action(previous_action)], 1)
        h1, c1 = self.lower.step(x, state[:, 0], state[:, 1])
        h2, c2 = self.upper.step(h1, state[:, 2], state[:, 3])
        return self.head(h2), torch.stack([h1, c1, h2, c2], 1)

    def sequence(
        self, features: Tensor, previous_action: Tensor, state: Tensor, ended: Tensor
    ) -> tuple[Tensor, Tensor]:
        """T steps at once, the same as ``forward`` step by step.

        Args:
            features: float32 [T * B, *features].
            previous_action: float32 [T * B, 6].
            state: float32 [B, 4, H'].
            ended: bool [T, B], episodes that ended in a step: the next one starts from zeros.

        Returns:
            Logits of p_hat [T * B] and the state after the last step.
        """
        x = torch.cat([self.picture(features).flatten(1), self.action(previous_action)], 1)
        x, h1, c1 = self.lower.sequence(x, state[:, 0], state[:, 1], ended)
        x, h2, c2 = self.upper.sequence(x, state[:, 2], state[:, 3], ended)
        return self.head(x)[:, 0], torch.stack([h1, c1, h2, c2], 1)


def _encoder(features: Sequence[int]) -> nn.Module:
    """A vector is mixed by one layer; a map at each of its places, as the published networks do."""
    if len(features) == 1:
        return nn.Sequential(nn.Linear(features[0], COMPACT_WIDTH), nn.ReLU())
    return nn.Sequential(nn.Conv2d(features[0], MAP_CHANNELS, 1), nn.ReLU())


def collision_loss(
    logit: Tensor, collided: Tensor, moved_ahead: Tensor, count: float | None = None
) -> Tensor:
    """L_c: cross-entropy over the steps whose action was MoveAhead, their mean.

    Args:
        logit: float32 [N].
        collided: bool [N], p_t.
        moved_ahead: bool [N].
        count: divide by this instead of one's own number of such steps.

    Returns:
        Scalar; 0 when no step moved ahead.

    Source: Eq. 3.
    """
    each = F.binary_cross_entropy_with_logits(logit, collided.float(), reduction="none")
    own = float(moved_ahead.sum()) if count is None else count
    return (each * moved_ahead).sum() / max(own, 1.0)
