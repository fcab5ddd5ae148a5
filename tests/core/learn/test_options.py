"""The numbers of a training run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions

SOUND = TrainOptions(Path("scenes"), ("kitchen:0",), ("kitchen:1",), Path("run"))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"max_grad_norm": 0.0}, "found --max-grad-norm 0.0, expected more than 0"),
        ({"max_grad_norm": float("nan")}, "found --max-grad-norm nan, expected more than 0"),
        ({"gae_lambda": 1.5}, "found --gae-lambda 1.5, expected 0 to 1"),
        ({"gamma": -0.1}, "found --gamma -0.1, expected 0 to 1"),
        ({"value_weight": float("nan")}, "found --value-weight nan, expected at least 0"),
    ],
)
def test_numbers_that_would_train_nothing_are_told(
    changes: dict[str, float], sentence: str
) -> None:
    SOUND.check()
    run = RunConfig(hyperparameters=Hyperparameters(**changes))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=sentence):
        replace(SOUND, run=run).check()
