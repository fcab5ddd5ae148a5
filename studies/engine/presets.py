"""Sizes and numbers of the runs: small ones that two cores finish, and the published ones.

The numbers of "small" were chosen in validation rooms of data2, with plain as carefully as with
ours, and are the same for all methods of a model. Only E_1 is longer where collisions cost from the
first episode: such agents walk later. Rows that are trained as long as they show what that makes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from cfnav_core.agent.config import Hyperparameters, MethodName, ModelName, RunConfig
from cfnav_core.agent.methods import METHODS
from cfnav_core.models.size import PUBLISHED, ModelSize
from studies.engine.row import Schedule

PresetName = Literal["small", "full", "tiny"]

MODELS: tuple[ModelName, ...] = (
    "baseline_label", "baseline_word", "hoz", "lstde", "akgvp", "mjolnir", "tdanet",
)  # fmt: skip


@dataclass(frozen=True)
class Preset:
    """How runs are trained.

    Attributes:
        runs: sizes and numbers by model.
        stage1_if_penalised: E_1 of methods in which collisions cost in stage one, by model; that
            of the others when absent.
        stage1_later: E_1 of runs whose schedule is "later", by model.
        validations: in stage two, equally spaced, one of which is its checkpoint; stage one has
            them at the same distance, for the curves.
        tenfold: how many times as many episodes stage two has where the schedule is "tenfold"; 1
            where it is long already.
        validations_tenfold: of such a stage two, and one at its end.
        validation_episodes: of each.
        test_episodes: of the frozen ones, from the first; all when None.
    """

    runs: dict[ModelName, RunConfig]
    validations: int = 6
    tenfold: int = 10
    validations_tenfold: int = 12
    validation_episodes: int = 600
    test_episodes: int | None = None
    stage1_if_penalised: dict[ModelName, int] = field(default_factory=dict)
    stage1_later: dict[ModelName, int] = field(default_factory=dict)

    def run(
        self, model: ModelName, method: MethodName, seed: int, schedule: Schedule = "usual"
    ) -> RunConfig:
        """What is trained.

        A method in which collisions cost in stage one is anyway trained "longer".
        """
        run = self.runs[model]
        hp = run.hyperparameters
        later = self.stage1_if_penalised.get(model, hp.stage1_episodes)
        if METHODS[method].stage1.collision_penalty:
            hp = replace(hp, stage1_episodes=later)
        elif schedule == "later":
            hp = replace(hp, stage1_episodes=self.stage1_later.get(model, hp.stage1_episodes))
        elif schedule == "longer":
            hp = replace(hp, stage2_episodes=hp.stage2_episodes + later - hp.stage1_episodes)
        if schedule == "tenfold":
            hp = replace(hp, stage2_episodes=self.tenfold * hp.stage2_episodes)
        return replace(run, model=model, method=method, seed=seed, hyperparameters=hp)


SHAPED = Hyperparameters(
    stage2_episodes=30_000, batch=64, rollout_length=10, lr=1e-3, episode_steps=50,
    entropy_weight=0.03,
)  # fmt: skip
"""For r_o that rewards steps on the way: many small updates, and no hour spent lost. With less
entropy, agents that pay for collisions from the start end up turning on the spot for ever."""

SPARSE = Hyperparameters(stage2_episodes=30_000, batch=32, rollout_length=20, lr=7e-4)
"""For r_o that rewards nothing but success: until an agent has learnt to leave its place to look
for the goal, a way that is cut short teaches nothing."""


def _small(numbers: Hyperparameters, stage1_episodes: int) -> RunConfig:
    """Half the published LSTM, synchronous."""
    return RunConfig(
        size=ModelSize(hidden=256, channels=64),
        predictor_hidden=128,
        hyperparameters=replace(numbers, stage1_episodes=stage1_episodes),
    )


SMALL: dict[ModelName, RunConfig] = {
    "baseline_label": _small(SPARSE, 125_000),
    "baseline_word": _small(SPARSE, 150_000),
    "hoz": _small(SPARSE, 80_000),
    "lstde": _small(SHAPED, 40_000),
    "akgvp": _small(SHAPED, 40_000),
    "mjolnir": _small(SHAPED, 100_000),
    "tdanet": _small(SHAPED, 30_000),
}
"""E_1 ends after training CF-SR has begun to rise steeply: a policy that only turns on the spot has
met no collisions to learn from. Until then episodes are short, so these numbers cost little."""

SMALL_PENALISED: dict[ModelName, int] = {"lstde": 90_000, "tdanet": 90_000}
"""L-sTDE's by the same rule, seen in Reward; TDANet's Reward Only was not tried and has its."""

SMALL_LATER: dict[ModelName, int] = {"hoz": 125_000}
"""The Baseline's of data1, which has the same r_o and numbers; nothing else was tried."""

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
    "small": Preset(SMALL, stage1_if_penalised=SMALL_PENALISED, stage1_later=SMALL_LATER),
    "full": Preset(
        dict.fromkeys(MODELS, FULL), validations=100, validation_episodes=1000, tenfold=1
    ),
    "tiny": Preset(
        dict.fromkeys(MODELS, TINY),
        validations=2,
        validation_episodes=20,
        test_episodes=40,
        tenfold=2,
        validations_tenfold=4,
    ),
}
