"""A run goes on only as what it was, and a stage one serves only runs whose own it could be."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.files.checkpoint import CheckpointError, load_tensors
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.run import Run
from cfnav_core.learn.run_files import BEST, CHECKPOINT, STAGE1
from cfnav_core.learn.train import train
from cfnav_core.models.size import ModelSize
from cfnav_core.scenes.scene import SceneError
from tests.core.worlds import hall


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenes")
    for seed in range(3):
        hall(4, 3, seed=0, name=f"kitchen:{seed}").save(folder / f"kitchen_{seed:05d}")
    return folder


def options(scenes: Path, out: Path, e1: int = 40, e2: int = 40, **more: object) -> TrainOptions:
    hp = Hyperparameters(stage1_episodes=e1, stage2_episodes=e2, batch=16, rollout_length=10)
    run = RunConfig("ours", hyperparameters=hp, size=ModelSize(16), predictor_hidden=8)
    chosen = TrainOptions(
        scenes, ("kitchen:0",), ("kitchen:1",), out, run=run, validation_every=40,
        validation_episodes=20,
    )  # fmt: skip
    return replace(chosen, **more)


@pytest.fixture(scope="module")
def trained(scenes: Path, tmp_path_factory: pytest.TempPathFactory) -> TrainOptions:
    """Of a whole run."""
    chosen = options(scenes, tmp_path_factory.mktemp("runs") / "ours")
    train(chosen)
    return chosen


@pytest.fixture
def again(trained: TrainOptions, tmp_path: Path) -> TrainOptions:
    """Of the same run, in a folder of its own."""
    shutil.copytree(trained.out, tmp_path / "again")
    return replace(trained, out=tmp_path / "again")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"leave_out": ("Mug",)}, r"run with leave_out \[\]"),
        ({"validation_episodes": 5}, "run with validation_episodes 20 in .*, but 5 is asked"),
    ],
)
def test_goals_and_what_chooses_stay_the_same(
    again: TrainOptions, change: dict, sentence: str
) -> None:
    with pytest.raises(CheckpointError, match=sentence):
        Run(replace(again, **change)).resume()


def test_goals_that_were_kept_from_a_run_stay_so(scenes: Path, tmp_path: Path) -> None:
    chosen = options(scenes, tmp_path / "without", leave_out=("Mug",))
    train(chosen)
    assert load_tensors(chosen.out / CHECKPOINT)[1]["leave_out"] == ["Mug"]
    with pytest.raises(CheckpointError, match=r"run with leave_out \['Mug'\]"):
        Run(replace(chosen, leave_out=())).resume()
    asked = options(scenes, tmp_path / "plain", stage1=chosen.out / STAGE1)
    with pytest.raises(CheckpointError, match="run with goals "):
        Run(asked).resume()


@pytest.mark.parametrize("e1", [30, 400])
def test_the_length_of_a_stage_one_that_is_over_stays(again: TrainOptions, e1: int) -> None:
    changed = options(again.scenes, again.out, e1=e1)
    with pytest.raises(CheckpointError, match=f"stage one of 40, but {e1} are asked for"):
        Run(changed).resume()
    longer = options(again.scenes, again.out, e2=60)
    run = Run(longer)
    run.resume()
    assert run.episodes >= 80


@pytest.mark.parametrize("file", [BEST, CHECKPOINT])
def test_what_has_left_stage_one_is_none(trained: TrainOptions, file: str, tmp_path: Path) -> None:
    other = options(trained.scenes, tmp_path / "plain", stage1=trained.out / file)
    with pytest.raises(CheckpointError, match="which is no longer stage one; give stage1"):
        Run(replace(other, run=replace(other.run, method="plain"))).resume()


def test_a_stage_one_has_the_length_that_is_asked_for(
    trained: TrainOptions, tmp_path: Path
) -> None:
    other = options(trained.scenes, tmp_path / "other", e1=10, stage1=trained.out / STAGE1)
    with pytest.raises(CheckpointError, match="of 40 episodes, expected 10; give --stage1-epi"):
        Run(other).resume()


def test_a_stage_one_is_of_the_same_rooms(trained: TrainOptions, tmp_path: Path) -> None:
    other = options(
        trained.scenes, tmp_path / "other", stage1=trained.out / STAGE1,
        train_rooms=("kitchen:2",), validation_rooms=("kitchen:0",),
    )  # fmt: skip
    with pytest.raises(CheckpointError, match=r"run with train_rooms \['kitchen:0'\]"):
        Run(other).resume()
    same = options(
        trained.scenes, tmp_path / "same", stage1=trained.out / STAGE1,
        train_rooms=("kitchen:0-0",), validation_rooms=("kitchen:2",),
    )  # fmt: skip
    Run(same).resume()


def test_a_run_that_began_otherwise_does_not_take_a_stage_one(
    trained: TrainOptions, again: TrainOptions, tmp_path: Path
) -> None:
    with pytest.raises(CheckpointError, match=r"that did not begin with .*stage1"):
        Run(replace(again, stage1=trained.out / STAGE1)).resume()
    with pytest.raises(CheckpointError, match=r"found no readable stage one at .*none"):
        Run(replace(again, stage1=tmp_path / "none")).resume()
    begun = options(trained.scenes, tmp_path / "begun", stage1=trained.out / STAGE1)
    train(begun)
    Run(begun).resume()
    Run(replace(begun, stage1=None)).resume()


def test_validation_rooms_are_seen_by_the_same_eyes(scenes: Path, tmp_path: Path) -> None:
    for seed in range(2):
        shutil.copytree(scenes / f"kitchen_{seed:05d}", tmp_path / f"kitchen_{seed:05d}")
    other = replace(hall(4, 3, name="kitchen:1"), perception="other eyes")
    other.save(tmp_path / "kitchen_00001")
    with pytest.raises(SceneError, match="validation rooms of perception other eyes and training"):
        Run(options(tmp_path, tmp_path / "run"))


def test_what_is_left_out_brings_no_reward(scenes: Path) -> None:
    bank = SceneBank.load(scenes, ["kitchen:0"], leave_out=["Mug"])
    row = bank.objects.index("Mug")
    assert SceneBank.load(scenes, ["kitchen:0"]).visible[:, row].any()
    assert not bank.visible[:, row].any()
    assert bank.visible.any()
