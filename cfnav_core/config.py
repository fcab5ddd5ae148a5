"""Every default of a training run, as frozen dataclasses read by tyro at the entry points."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Hyperparameters:
    """Of Algorithm 1 in its batched synchronous form."""

    stage1_episodes: int = 80_000
    """E_1; the paper has 1,000,000."""
    stage2_episodes: int = 160_000
    """E_2; the paper has 2,000,000."""
    batch: int = 256
    """Parallel episodes B."""
    rollout_length: int = 20
    """t_max."""
    gamma: float = 0.99
    """Discount."""
    gae_lambda: float = 0.95
    """1 gives the paper's plain returns."""
    lr: float = 7e-4
    """Adam's learning rate; falls linearly to a tenth during stage two."""
    entropy_weight: float = 0.01
    """beta of A3C."""
    value_weight: float = 0.5
    """Weight of the squared value error."""
    max_grad_norm: float = 1.0
    """Gradients are clipped to this global norm."""


@dataclass(frozen=True)
class ModelSize:
    """Widths of the compact networks."""

    hidden: int = 256
    """LSTM width of the policy; the published networks have 512."""
    predictor_hidden: int = 128
    """LSTM width of the collision predictor; the paper has 512."""


@dataclass(frozen=True)
class RunConfig:
    """One training run."""

    method: str = "ours"
    """Row of methods.METHODS."""
    model: str = "baseline"
    """Row of models.MODELS."""
    seed: int = 0
    """Seed of weights, episodes and actions."""
    hyperparameters: Hyperparameters = field(default_factory=Hyperparameters)
    size: ModelSize = field(default_factory=ModelSize)
