"""Every default of a training run, as frozen dataclasses read by tyro at the entry points."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

Rooms = Annotated[tuple[str, ...], tyro.conf.UseAppendAction]


@dataclass(frozen=True)
class Hyperparameters:
    """Of Algorithm 1 in its batched synchronous form."""

    stage1_episodes: int = 250_000
    """E_1; the paper has 1,000,000."""
    stage2_episodes: int = 600_000
    """E_2; the paper has 2,000,000."""
    batch: int = 64
    """Parallel episodes B. More of them mean fewer updates, which are what counts early on."""
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


@dataclass(frozen=True)
class TrainOptions:
    """Train a navigation policy on offline scenes (Algorithm 1, two stages)."""

    scenes: Path
    """Folder of scenes (python -m sim_bridge.dataset)."""
    train_rooms: Rooms
    """Rooms to train in: TYPE:SEED or TYPE:FIRST-LAST, given as often as needed."""
    validation_rooms: Rooms
    """Rooms that choose the checkpoint; never tested in."""
    out: Path = Path("out/runs/ours")
    """Folder of the run: checkpoints and log.jsonl. A killed run goes on from it."""
    stage1: Path | None = None
    """stage1.safetensors of another run of the same seed: skips stage one."""
    run: RunConfig = field(default_factory=RunConfig)
    validation_every: int = 15_000
    """Episodes between validations."""
    validation_episodes: int = 600
    """Frozen validation episodes, argmax."""
    checkpoint_s: float = 60.0
    """Seconds between checkpoints."""
    threads: int = 1
    """CPU threads."""
