"""Every default of a training run, as frozen dataclasses read by tyro at the entry points."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from cfnav_core.models.size import ModelSize

Rooms = Annotated[tuple[str, ...], tyro.conf.UseAppendAction]

MethodName = str
"""A row of ``methods.METHODS``, or FILE.py:NAME or package.module:NAME, see ``find``."""

ModelName = str
"""A row of ``models.table.MODELS``, or FILE.py:NAME or package.module:NAME."""

RewardName = Literal["baseline", "hoz", "layout", "mjolnir", "similarity"]


@dataclass(frozen=True)
class Hyperparameters:
    """Numbers of Algorithm 1. Where the paper has another, it is named."""

    stage1_episodes: int = 250_000
    """E_1: episodes in which the predictor learns and p_hat is 0; the paper has 1,000,000."""
    stage2_episodes: int = 600_000
    """E_2: episodes that read p_hat and in which collisions cost; the paper has 2,000,000."""
    batch: int = 64
    """Parallel episodes B, one update a rollout; more of them mean fewer updates."""
    rollout_length: int = 20
    """t_max: steps between updates."""
    episode_steps: int = 0
    """Most actions of a training episode, the lineage's are cut at 30; 0: as many as at test."""
    gamma: float = 0.99
    """Discount of returns."""
    gae_lambda: float = 0.95
    """Lambda of the advantages; 1 gives the paper's plain returns."""
    lr: float = 7e-4
    """Adam's, falling linearly to a tenth in stage two; the paper's workers have 1e-4."""
    entropy_weight: float = 0.01
    """Weight of the policy's entropy (beta of A3C)."""
    value_weight: float = 0.5
    """Weight of the squared value error."""
    max_grad_norm: float = 1.0
    """Gradients are clipped to this global norm."""


@dataclass(frozen=True)
class RunConfig:
    """What is trained."""

    method: MethodName = "ours"
    """The paper's method (ours), plain, or what it is compared with: reward, xiao, wu, stage_only,
    cp_only, reward_only, truth (docs/training.md); or your own as FILE.py:NAME."""
    model: ModelName = "compact"
    """Navigation model: compact, or a published one: baseline_label, baseline_word, hoz, lstde,
    akgvp, mjolnir, tdanet; or your own as FILE.py:NAME or package.module:NAME."""
    reward: RewardName | None = None
    """r_o; the one the model was published with when absent."""
    seed: int = 0
    """Seed of weights, episodes and actions."""
    hyperparameters: Hyperparameters = field(default_factory=Hyperparameters)
    size: ModelSize = field(default_factory=ModelSize)
    predictor_hidden: int = 128
    """LSTM width of the collision predictor; the paper has 512."""
    listening: bool = False
    """Add p_hat to the action logits too (not in the paper, see models/listening.py)."""

    @classmethod
    def read(cls, values: dict[str, Any]) -> RunConfig:
        """From what ``dataclasses.asdict`` made of it."""
        nested = {
            "hyperparameters": Hyperparameters(**values["hyperparameters"]),
            "size": ModelSize(**values["size"]),
        }
        return cls(**values | nested)


@dataclass(frozen=True)
class TrainOptions:
    """Train a navigation policy on offline scenes (Algorithm 1, two stages)."""

    scenes: Path
    """Folder of scenes (cfnav rooms make)."""
    train_rooms: Rooms
    """Rooms to train in: TYPE:SEED, TYPE:FIRST-LAST or data2:train, given as often as needed."""
    validation_rooms: Rooms
    """Rooms that choose the checkpoint, for example data2:validation; never tested in."""
    out: Path = Path("out/runs/ours")
    """Folder of the run: checkpoints and log.jsonl. A killed run goes on from it."""
    stage1: Path | None = None
    """stage1.safetensors of another run of the same seed; skips stage one."""
    run: RunConfig = field(default_factory=RunConfig)
    stage1_most: int = 0
    """Most episodes of a stage one that goes on after --stage1-episodes until the predictor no
    longer gains in the validation rooms. 0: it does not go on."""
    stage1_rise: float = 0.002
    """What counts as a gain: an AUC higher by this than that of the predictor that gained last, at
    the same steps."""
    stage1_patience: int = 5
    """Validations without a gain that end a stage one with --stage1-most."""
    leave_out: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """A goal that is neither asked for nor detected, in training and validation; given as often as
    needed. Models that take goals they never trained on can then be tested on it. Rooms without
    another goal are left out, too."""
    knowledge: Path | None = None
    """What the model knows of the objects (cfnav data knowledge); compact needs nothing."""
    validation_every: int = 15_000
    """Episodes between validations."""
    validation_episodes: int = 600
    """Frozen validation episodes, argmax."""
    checkpoint_s: float = 60.0
    """Seconds between checkpoints; after a kill no more is done again."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where networks and episodes live; auto takes a GPU when there is one."""
    precision: Literal["highest", "high", "medium"] = "highest"
    """Of multiplications: float32, high is TF32 on GPUs, medium bfloat16 where it is fast."""
    threads: int = 1
    """CPU threads."""
    workers: int = 0
    """Asynchronous workers as in the paper (32 there); 0 is batched and synchronous."""

    def check(self) -> None:
        """Look at the numbers.

        Raises:
            ValueError: one makes no sense.
        """
        hp = self.run.hyperparameters
        least = {
            "stage1_episodes": (hp.stage1_episodes, 0), "stage2_episodes": (hp.stage2_episodes, 0),
            "batch": (hp.batch, 1), "rollout_length": (hp.rollout_length, 1),
            "episode_steps": (hp.episode_steps, 0),
            "validation_every": (self.validation_every, 1),
            "validation_episodes": (self.validation_episodes, 1),
            "stage1_most": (self.stage1_most, 0), "stage1_rise": (self.stage1_rise, 0),
            "stage1_patience": (self.stage1_patience, 1),
            "checkpoint_s": (self.checkpoint_s, 0), "threads": (self.threads, 1),
            "workers": (self.workers, 0), "seed": (self.run.seed, 0),
            "value_weight": (hp.value_weight, 0), "entropy_weight": (hp.entropy_weight, 0),
        }  # fmt: skip
        shares = {"gamma": hp.gamma, "gae_lambda": hp.gae_lambda}
        positive = {"lr": hp.lr, "max_grad_norm": hp.max_grad_norm}
        wrong = [
            *((n, f, f"at least {e}") for n, (f, e) in least.items() if not e <= f < math.inf),
            *((n, f, "0 to 1") for n, f in shares.items() if not 0 <= f <= 1),
            *((n, f, "more than 0") for n, f in positive.items() if not 0 < f < math.inf),
        ]
        for name, found, expected in wrong:
            raise ValueError(f"found --{name.replace('_', '-')} {found}, expected {expected}")
