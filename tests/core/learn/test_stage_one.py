"""Stage one judged in rooms that nobody learns in, and ended by what is found there."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.agent.methods import PREDICT, Method, Stage
from cfnav_core.files.checkpoint import CheckpointError, load_tensors
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Trace
from cfnav_core.learn.run import Run
from cfnav_core.learn.run_files import BEST, CHECKPOINT, LOG, STAGE1
from cfnav_core.learn.stage_one import StageOne, predictor_figures
from cfnav_core.learn.train import train
from cfnav_core.models.size import ModelSize
from cfnav_core.task.actions import Action
from tests.core.worlds import hall, two_halls

SHARED = Method(PREDICT, Stage(feed_prediction=True), shared_encoder=True)
"""Its predictor reads the policy's own encoder, and would take that back with it."""


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return two_halls(tmp_path_factory.mktemp("halls"))


def options(scenes: Path, out: Path, method: str = "ours", **changes: object) -> TrainOptions:
    hp = Hyperparameters(stage1_episodes=60, stage2_episodes=60, batch=16, rollout_length=5)
    run = RunConfig(method, hyperparameters=hp, size=ModelSize(16), predictor_hidden=8)
    rule: dict[str, object] = {"stage1_most": 400, "stage1_rise": 0.01, "stage1_patience": 2}
    return TrainOptions(
        scenes, ("kitchen:0",), ("kitchen:1",), out, run=run, validation_every=30,
        validation_episodes=20, **(rule | changes),
    )  # fmt: skip


def test_a_gain_is_over_the_kept_one_at_the_same_steps():
    stage1, nan = StageOne(), math.nan
    said = [
        (stage1.gains(n, *aucs, 0.01), stage1.kept, stage1.without_gain)
        for n, aucs in enumerate(
            # neither can be told; the first; too little; harder steps, but better; cannot be told
            [(nan, nan), (0.9, nan), (0.905, 0.9), (0.8, 0.75), (nan, nan), (0.9, 0.95)],
            start=1,
        )
    ]
    assert said == [
        (False, None, 1), (True, 2, 0), (False, 2, 1), (True, 4, 0), (False, 4, 1), (False, 4, 2)
    ]  # fmt: skip


def test_a_state_counts_once_an_episode():
    bank = SceneBank([hall()])
    free, blocked = (int(np.flatnonzero(bank.collided == flag)[0]) for flag in (False, True))
    ahead, left = int(Action.MoveAhead), int(Action.RotateLeft)

    def step(states: list[int], actions: list[int], p: list[float]) -> Trace:
        return Trace(np.arange(2), np.array(states), np.array(actions), np.array(p, np.float32))

    trace = [
        step([blocked, free], [ahead, ahead], [0.75, 0.25]),
        step([blocked, free], [ahead, left], [0.25, 0.5]),  # stuck; no MoveAhead
        step([free, blocked], [ahead, ahead], [0.5, 0.25]),
    ]
    # counted: 0.75 and 0.25 before a wall, 0.25 and 0.5 elsewhere
    assert predictor_figures(bank, trace) == {
        "predictor_steps": 4, "predictor_blocked": 0.5, "predictor_auc": 0.625,
        "predictor_brier": pytest.approx((0.0625 + 0.5625 + 0.0625 + 0.25) / 4),
    }  # fmt: skip
    assert "predictor_auc" not in predictor_figures(bank, [trace[1]])
    assert predictor_figures(bank, [step([free, free], [left, left], [0, 0])]) == {
        "predictor_steps": 0
    }


def judged(
    monkeypatch: pytest.MonkeyPatch, aucs: list[tuple[float, float]]
) -> list[dict[str, torch.Tensor]]:
    """Let validations find these AUCs of the predictor and of the kept one; the predictors seen."""
    seen: list[dict[str, torch.Tensor]] = []

    def judge(run: Run) -> dict[str, float]:
        auc, kept = aucs[len(seen)]
        seen.append({k: v.clone() for k, v in run.predictor.state_dict().items()})
        return {"predictor_auc": auc} | ({"predictor_kept_auc": kept} if run.kept else {})

    monkeypatch.setattr(Run, "judge_predictor", judge)
    return seen


def same(tensors: dict[str, torch.Tensor], predictor: dict[str, torch.Tensor]) -> bool:
    return all((tensors[f"predictor.{k}"] == v).all() for k, v in predictor.items())


@pytest.mark.parametrize(("last", "frozen"), [(0.795, 3), (0.805, 5)])
def test_stage_one_ends_without_gain_and_keeps_the_better(
    scenes, tmp_path, monkeypatch, last, frozen
):
    """After the fourth the steps are harder; the last is below or above the kept one's 0.8."""
    aucs = [(0.6, 0), (0.7, 0.6), (0.8, 0.7), (0.9, 0.8), (0.79, 0.8), (last, 0.8), (0.5, 0.5)]
    seen = judged(monkeypatch, aucs)
    train(options(scenes, tmp_path))
    head = load_tensors(tmp_path / STAGE1)[1]
    log = [json.loads(line) for line in (tmp_path / LOG).read_text().splitlines()]
    stage1 = head["stage1"]
    assert [auc for _, auc in stage1["aucs"]] == [auc for auc, _ in aucs[:6]]
    assert stage1["ended"] == head["episodes"] == log[5]["episodes"] < 400
    assert stage1["frozen"] == [log[frozen]["episodes"], max(last, 0.8)]
    for name in (STAGE1, CHECKPOINT, BEST):
        there = load_tensors(tmp_path / name)[0]
        assert same(there, seen[frozen])
        assert not any(k.startswith("kept_predictor.") for k in there)
    assert any((seen[5][k] != v).any() for k, v in seen[3].items())
    for key in ("collision_loss", "predictor_auc"):
        assert key in log[5]
        assert key not in log[6]
    end = load_tensors(tmp_path / CHECKPOINT)[1]["episodes"]
    assert end >= head["episodes"] + 60 > end - 16


def test_the_most_ends_a_stage_one_that_still_gains(scenes, tmp_path, monkeypatch):
    judged(monkeypatch, [(0.9, 0.5)] * 20)
    train(options(scenes, tmp_path, stage1_most=150))
    _, head = load_tensors(tmp_path / STAGE1)
    assert 150 <= head["stage1"]["ended"] == head["episodes"] < 166


def test_another_method_takes_the_stage_one_as_long_as_it_was(scenes, tmp_path):
    first = options(scenes, tmp_path / "ours", stage1_most=120)
    train(first)
    tensors, head = load_tensors(first.out / STAGE1)
    ended = head["stage1"]["ended"]
    assert ended > 60
    for workers in (0, 1):
        out = tmp_path / f"plain{workers}"
        plain = options(
            scenes, out, "plain", stage1=first.out / STAGE1, stage1_most=0, workers=workers
        )
        run = Run(plain)
        if not workers:
            run.resume()
            assert (run.episodes, run.hp.stage1_episodes, run.total) == (ended, ended, ended + 60)
            assert not run.in_stage1
        train(plain)
        there, end = load_tensors(out / CHECKPOINT)
        assert end["episodes"] >= ended + 60
        assert end["stage1"] == head["stage1"]
        assert all((there[k] == v).all() for k, v in tensors.items() if k.startswith("predictor."))


def test_a_stage_one_that_goes_on_is_not_given(scenes, tmp_path):
    run = Run(options(scenes, tmp_path / "ours"))
    run.episodes = 90
    run.save(STAGE1)
    plain = options(scenes, tmp_path / "p", "plain", stage1=run.options.out / STAGE1, stage1_most=0)
    with pytest.raises(CheckpointError, match="after 90 episodes of a stage one that is to go on"):
        Run(plain).resume()


def test_a_run_keeps_its_rule(scenes, tmp_path):
    chosen = options(scenes, tmp_path)
    Run(chosen).save(CHECKPOINT)
    Run(chosen).resume()
    with pytest.raises(CheckpointError, match=r"found a run with stage1_rule \[400, 0.01, 2\] in"):
        Run(replace(chosen, stage1_patience=3)).resume()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"stage1_most": 59}, "found --stage1-most 59, expected at least the 60 episodes"),
        ({"stage1": Path("there")}, "found --stage1-most with the stage one of there"),
        ({"workers": 2}, "found --stage1-most with 2 asynchronous workers"),
        ({"method": "plain"}, "found --stage1-most with method plain, expected one whose"),
        ({"method": "cp_only"}, "found --stage1-most with method cp_only"),
        ({"stage1_patience": 0}, "found --stage1-patience 0, expected at least 1"),
        ({"stage1_rise": -0.1}, "found --stage1-rise -0.1, expected at least 0"),
        ({"method": f"{__file__}:SHARED"}, "found --stage1-most with method .*SHARED, expected"),
    ],
)
def test_a_rule_that_makes_no_sense(scenes, tmp_path, changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        Run(options(scenes, tmp_path, **changes))
