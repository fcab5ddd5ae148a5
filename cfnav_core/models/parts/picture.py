"""Picture features as a small map, and the fusion of maps and vectors over it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

COMPACT_SIDE = 3
"""Side of the map that a feature vector is unfolded to."""


class PictureMap(nn.Module):
    """Picture features to a map of n x n places: a 1x1 convolution and ReLU.

    A feature vector has no places: one linear layer unfolds it to a map of 3 x 3, so that all
    that follows is the same.

    Args:
        features: (F, n, n) of a map or (F,) of a vector.
        channels: of the map that comes out.

    Attributes:
        side: n.

    Raises:
        ValueError: features of another shape.
    """

    def __init__(self, features: Sequence[int], channels: int) -> None:
        super().__init__()
        self.channels = channels
        if len(features) == 1:
            self.side = COMPACT_SIDE
            self.layer: nn.Module = nn.Linear(features[0], channels * COMPACT_SIDE**2)
        elif len(features) == 3 and features[1] == features[2]:
            self.side = features[1]
            self.layer = nn.Conv2d(features[0], channels, 1)
        else:
            raise ValueError(
                f"found picture features of shape {tuple(features)}, expected a vector (F,) or a "
                "square map (F, n, n); make the scenes with a perception that gives one of these"
            )

    def forward(self, features: Tensor) -> Tensor:
        """Float32 [B, F] or [B, F, n, n] to [B, channels, n, n]."""
        return torch.relu_(self.layer(features)).view(-1, self.channels, self.side, self.side)


class Fusion(nn.Module):
    """The picture, other maps and tiled vectors beside one another, mixed at each place.

    Args:
        parts: channels of all that is fused, the picture's first.
        channels: of the map that comes out.
        side: n of the maps.
        dropout: on the picture and on the map that comes out.

    Attributes:
        width: length of the vector that comes out.
    """

    def __init__(self, parts: Sequence[int], channels: int, side: int, dropout: float) -> None:
        super().__init__()
        self.side = side
        self.width = channels * side**2
        self.pointwise = nn.Conv2d(sum(parts), channels, 1)
        self.dropout = nn.Dropout(dropout)

    def forward(self, picture: Tensor, *others: Tensor) -> Tensor:
        """Fuse.

        Args:
            picture: float32 [B, k, n, n].
            others: float32 maps [B, k, n, n] or vectors [B, k] in the order of ``parts``.

        Returns:
            Float32 [B, width].
        """
        maps = [self.dropout(picture)]
        for part in others:
            if part.ndim == 2:
                part = part[:, :, None, None].expand(-1, -1, self.side, self.side)
            maps.append(part)
        return self.dropout(torch.relu_(self.pointwise(torch.cat(maps, 1)))).flatten(1)
