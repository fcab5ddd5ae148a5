"""A belief about which objects stand together: Dirichlet counts that each new view adds to.

Pure functions. The counts of a room are a prior [C, C], one Dirichlet distribution in each row,
plus what this episode has ``added`` [C] to every row. Source: L-sTDE (2023) and its public code;
the numbers are that code's constants.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

ADDED = 5.0
"""Added to the count of every detected object."""

MIN_DIFFERENCE = 1e-4
"""Mean squared difference of two views beyond which they differ."""

FADE = 0.8
"""What is left of the layout gap after an evaluation that found nothing new."""

MIN_GAIN, MAX_GAIN = -0.001, 0.8

SHIFT = 6
"""Stirling's series is used this far above its argument."""


class Update(NamedTuple):
    """One view worked into the belief.

    Attributes:
        new: bool [B, 1], the view counted.
        added: float32 [B, C], added to every row so far.
        last: float32 [B, C], the last view that counted.
    """

    new: Tensor
    added: Tensor
    last: Tensor


def update(detected: Tensor, added: Tensor, last: Tensor) -> Update:
    """Count a view if it shows at least two objects and differs from the last that counted.

    Args:
        detected: float32 [B, C], 0 or 1.
        added: float32 [B, C].
        last: float32 [B, C].
    """
    differs = (detected - last).square().mean(1, keepdim=True) > MIN_DIFFERENCE
    new = differs & (detected.sum(1, keepdim=True) > 1)
    return Update(
        new, torch.where(new, added + ADDED * detected, added), torch.where(new, detected, last)
    )


def attention(prior: Tensor, added: Tensor, goal: Tensor) -> Tensor:
    """How much each object says about the goal: the goal's expected share in its row, 1 for itself.

    Args:
        prior: float32 [B, C, C].
        added: float32 [B, C].
        goal: float32 [B, C], one-hot.

    Returns:
        Float32 [B, C]: P[:, goal] with P = counts / row sums + identity.
    """
    of_goal = (prior @ goal[:, :, None])[:, :, 0] + (added * goal).sum(1, keepdim=True)
    return of_goal / (prior.sum(2) + added.sum(1, keepdim=True)) + goal


def gap(prior: Tensor, before: Tensor, after: Tensor) -> Tensor:
    """How much a view changed the belief: tanh |sum over rows of KL(after || before)|.

    One is added to each row's count of itself, whose prior is zero.

    Args:
        prior: float32 [B, C, C], positive off the diagonal.
        before: float32 [B, C], added before the view.
        after: float32 [B, C].

    Returns:
        Float32 [B, 1].
    """
    # in 64 bits: differences of log-gammas of thousands drown in 32
    counts = prior.double() + torch.eye(prior.shape[1], device=prior.device)
    divergence = dirichlet_kl(counts + after[:, None], counts + before[:, None]).sum(1)
    return torch.tanh(divergence.abs())[:, None].to(prior.dtype)


def dirichlet_kl(p: Tensor, q: Tensor) -> Tensor:
    """KL(Dir(p) || Dir(q)), float64 [..., C] each, at least 1, to [...]."""
    p0, q0 = p.sum(-1, keepdim=True), q.sum(-1, keepdim=True)
    normalisers = lgamma(p0) - lgamma(q0) - (lgamma(p) - lgamma(q)).sum(-1, keepdim=True)
    return (normalisers + ((p - q) * (digamma(p) - digamma(p0))).sum(-1, keepdim=True))[..., 0]


def lgamma(x: Tensor) -> Tensor:
    """Log of Gamma(x), x of at least 1, by Stirling's series; ONNX has no such operator."""
    product = torch.ones_like(x)
    for k in range(SHIFT):
        product = product * (x + k)
    y = x + SHIFT
    z = 1 / (y * y)
    series = (1 / 12 - z * (1 / 360 - z * (1 / 1260 - z / 1680))) / y
    return (y - 0.5) * y.log() - y + 0.918938533204672742 + series - product.log()


def digamma(x: Tensor) -> Tensor:
    """The derivative of ``lgamma``, x of at least 1."""
    below = torch.zeros_like(x)
    for k in range(SHIFT):
        below = below + 1 / (x + k)
    y = x + SHIFT
    z = 1 / (y * y)
    return y.log() - 0.5 / y - z * (1 / 12 - z * (1 / 120 - z * (1 / 252 - z / 240))) - below


def subtract_counterfactual(
    logits: Tensor, without: Tensor, layout_gap: Tensor, threshold: float
) -> Tensor:
    """(1 + s) y - s y', with s the layout gap above a threshold, clamped to -0.001..0.8.

    Args:
        logits: float32 [B, 6], y of what is seen.
        without: float32 [B, 6], y' of the layout alone.
        layout_gap: float32 [B, 1].
        threshold: of the gap.

    Returns:
        Float32 [B, 6].
    """
    s = (layout_gap - threshold).clamp(MIN_GAIN, MAX_GAIN)
    return (1 + s) * logits - s * without
