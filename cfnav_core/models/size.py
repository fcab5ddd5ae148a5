"""Widths of navigation models."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ModelSize:
    """Widths of the policy's network; the defaults are compact, for built-in scenes."""

    hidden: int = 256
    """LSTM width of the policy; the published networks have 512."""
    channels: int = 64
    """Of picture and fusion maps, where a network has such."""
    dropout: float = 0.0
    """On picture and fusion maps, in compact on all that it sees; the published have 0.25."""


PUBLISHED = ModelSize(hidden=512, channels=64, dropout=0.25)
"""Widths of the published networks over 7x7 maps."""
