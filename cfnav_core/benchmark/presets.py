"""Sizes and numbers of the runs: small ones that two cores finish, and the published ones.

Every number of "small" was chosen on validation rooms, with plain as carefully as with ours, and
is the same for all methods of a model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from cfnav_core.config import Hyperparameters, ModelName, ModelSize, RunConfig
from cfnav_core.models import PUBLISHED

PresetName = Literal["small", "full", "tiny"]

MODELS: tuple[ModelName, ...] = (
    "baseline_label", "baseline_word", "hoz", "lstde", "akgvp", "mjolnir", "tdanet",
)  # fmt: skip


@dataclass(frozen=True)
class Preset:
    """How runs are trained.

    Attributes:
        runs: sizes and numbers by model.
        validations: of a run, equally spaced; those of stage two choose its checkpoint.
        validation_episodes: of each.
        test_episodes: of the frozen ones, from the first; all when None.
    """

    runs: dict[ModelName, RunConfig]
    validations: int = 20
    validation_episodes: int = 600
    test_episodes: int | None = None


SMALL = RunConfig(
    size=ModelSize(hidden=256, channels=64),
    predictor_hidden=128,
    hyperparameters=Hyperparameters(stage1_episodes=60_000, stage2_episodes=60_000),
)

FULL = RunConfig(
    size=PUBLISHED,
    predictor_hidden=512,
    hyperparameters=Hyperparameters(stage1_episodes=1_000_000, stage2_episodes=2_000_000),
)
"""Widths and episodes of the paper, in the synchronous execution."""

TINY = RunConfig(
    size=ModelSize(hidden=16, channels=8),
    predictor_hidden=16,
    hyperparameters=Hyperparameters(stage1_episodes=200, stage2_episodes=200, batch=16),
)
"""To try the grid itself: learns nothing."""

PRESETS: dict[PresetName, Preset] = {
    "small": Preset(dict.fromkeys(MODELS, SMALL)),
    "full": Preset(dict.fromkeys(MODELS, FULL), validations=100, validation_episodes=1000),
    "tiny": Preset(
        dict.fromkeys(MODELS, TINY), validations=2, validation_episodes=20, test_episodes=40
    ),
}
