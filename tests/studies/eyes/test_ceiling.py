"""What the truth is worth to a policy."""

from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.learn.evaluate import evaluate
from cfnav_core.learn.train import train
from cfnav_core.models.size import ModelSize
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.detections import HULLS, SCORES
from studies.eyes import ceiling
from studies.eyes.ceiling import CeilingOptions, true_near
from tests.core.worlds import hall

NEAR, SCORE = SCORES.index("near"), SCORES.index("score")


def seen(seed: int, blind: bool = False):
    """A hall by the fields of perception, which never tells what is near when it is blind."""
    made = hall(4, 3, seed=seed, name=f"kitchen:{seed}")
    detections = np.zeros((made.num_states, len(made.objects), len(SCORES)), np.float16)
    detections[..., SCORE] = detections[..., NEAR] = made.visible
    detections[..., NEAR] *= not blind
    return replace(made, room_type="kitchen", detections=detections, fields=SCORES)


def test_only_near_is_told_truly():
    blind = seen(1, blind=True)
    told = true_near(blind)
    assert (told.detections[..., NEAR] == blind.visible).all()
    same = [column for column in range(len(SCORES)) if column != NEAR]
    assert (told.detections[..., same] == blind.detections[..., same]).all()
    assert blind.detections[..., NEAR].max() == 0


def test_what_does_not_say_near_is_refused():
    with pytest.raises(SceneError, match="detections of visible, x, y, area, expected such as"):
        true_near(replace(seen(1), fields=HULLS))


def test_four_ways_of_the_same_episodes(tmp_path, monkeypatch):
    for number in range(4):
        seen(number, blind=True).save(tmp_path / "scenes" / f"kitchen_{number:05d}")
    small = RunConfig(
        hyperparameters=Hyperparameters(stage1_episodes=20, stage2_episodes=20, batch=8),
        size=ModelSize(hidden=16, channels=8), predictor_hidden=8,
    )  # fmt: skip
    policy = train(
        TrainOptions(
            tmp_path / "scenes", ("kitchen:0-1",), ("kitchen:2",), tmp_path / "run", run=small,
            validation_every=20, validation_episodes=20,
        )
    )  # fmt: skip
    evaluations: list = []

    def kept(*args, **options):
        evaluations.append(evaluate(*args, **options))
        return evaluations[-1]

    monkeypatch.setattr(ceiling, "evaluate", kept)
    found = list(ceiling.rows(CeilingOptions(policy, tmp_path / "scenes", ("kitchen:3",), 30)))
    told = [(row["given"], of, row) for row, of in zip(found, evaluations, strict=True)]
    for words, of, row in told:
        knows_near = words in ("the truth of what is near", "both")
        near = of.bank.scenes[0].detections[..., NEAR]
        assert (near == of.bank.scenes[0].visible).all() == knows_near
        knows_touch = words in ("the true collision flag", "both")
        given = np.concatenate([step.p_hat for step in of.trace])
        truth = of.bank.collided[np.concatenate([step.states for step in of.trace])]
        assert (given == truth).all() == knows_touch
        assert row["wrong_done"] == of.wrong_done
        if words == "what it perceives":
            assert "gain" not in row
        else:
            gain = row["gain"]["cf_sr_difference"]
            assert gain == pytest.approx(row["cf_sr"] - found[0]["cf_sr"])
    assert len(told) == 4
