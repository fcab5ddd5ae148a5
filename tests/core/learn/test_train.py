import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from cfnav_core.agent.config import (
    Hyperparameters,
    RewardName,
    RunConfig,
    TrainOptions,
)
from cfnav_core.agent.methods import METHODS
from cfnav_core.agent.reward import REWARDS
from cfnav_core.files.checkpoint import CheckpointError, load_tensors, save_tensors
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, run_episodes
from cfnav_core.learn.run import Run
from cfnav_core.learn.run_files import BEST, CHECKPOINT, LOG, STAGE1
from cfnav_core.learn.train import train
from cfnav_core.models.base import Knowledge
from cfnav_core.models.size import ModelSize
from cfnav_core.models.table import MODELS
from cfnav_core.policy.networks import TorchNetworks
from cfnav_core.task.metrics import cf_sr
from tests.core.worlds import hall

ROOMS = (("kitchen:0",), ("kitchen:1",))


@pytest.fixture
def scenes(tmp_path) -> Path:
    for seed in range(2):
        hall(4, 3, seed=0, name=f"kitchen:{seed}").save(tmp_path / "scenes" / f"kitchen_{seed:05d}")
    return tmp_path / "scenes"


def options(scenes: Path, method: str, e1: int, e2: int, **kw) -> TrainOptions:
    hp = Hyperparameters(
        stage1_episodes=e1, stage2_episodes=e2, batch=16, rollout_length=10, lr=3e-3
    )  # fmt: skip
    run = RunConfig(method, hyperparameters=hp, size=ModelSize(64), predictor_hidden=16)
    return TrainOptions(scenes, *ROOMS, out=scenes.parent / method, run=run,
                        validation_every=1000, validation_episodes=50, **kw)  # fmt: skip


def test_learns_a_small_hall_and_collides_less(scenes):
    """Same hall for training and validation: CF-SR must rise far above where it began."""
    chosen = options(scenes, "ours", 3000, 2500)
    best = train(chosen)
    log = [json.loads(line) for line in (chosen.out / "log.jsonl").read_text().splitlines()]
    assert log[0]["cf_sr"] < 0.25
    assert log[-1]["cf_sr"] > log[0]["cf_sr"] + 0.4
    stage1 = [row for row in log if row["episodes"] <= 3200]
    assert stage1[-1]["collision_loss"] < stage1[0]["collision_loss"]
    assert log[-1]["collisions_per_episode"] < stage1[-1]["collisions_per_episode"]
    assert "collision_loss" not in log[-1]
    assert log[0]["steps_per_s"] > 0
    assert 0 < log[0]["cpu_s"] < log[-1]["cpu_s"]
    assert 50 < log[0]["peak_memory_mb"] < 4000
    board = EventAccumulator(str(chosen.out)).Reload()
    curve = [(point.step, point.value) for point in board.Scalars("validation_cf_sr")]
    assert curve == [(row["episodes"], pytest.approx(row["validation_cf_sr"])) for row in log]
    run = Run(chosen)
    fresh = run.cpu_s
    run.resume()
    assert run.cpu_s > fresh + log[-1]["cpu_s"] - log[0]["cpu_s"]
    bank = SceneBank.load(scenes, ["kitchen:0"])
    episodes = Episodes.draw(bank, 200, 0)
    networks = TorchNetworks(run.model, run.predictor, feeds=True)
    assert cf_sr(run_episodes(networks, bank, episodes)) > 0.6
    assert best.exists()


def test_stage_one_is_shared_and_the_predictor_frozen_after_it(scenes):
    first = options(scenes, "ours", 300, 200)
    train(first)
    other = options(scenes, "stage_only", 300, 200, stage1=first.out / STAGE1)
    train(other)
    at_stage1, _ = load_tensors(first.out / STAGE1)
    for folder in (first.out, other.out):
        at_end, head = load_tensors(folder / CHECKPOINT)
        assert head["episodes"] >= 500
        assert all(
            (at_stage1[k] == at_end[k]).all() for k in at_stage1 if k.startswith("predictor.")
        )
        assert any((at_stage1[k] != at_end[k]).any() for k in at_end if k.startswith("model."))


def test_a_run_goes_on_only_as_what_it_was(scenes):
    chosen = options(scenes, "ours", 40, 40)
    train(chosen)
    longer = replace(chosen.run.hyperparameters, stage2_episodes=60)
    run = Run(replace(chosen, run=replace(chosen.run, hyperparameters=longer)))
    run.resume()
    assert run.episodes >= 80
    other = Run(replace(chosen, run=replace(chosen.run, method="plain")))
    with pytest.raises(CheckpointError, match="found a run with method 'ours'"):
        other.resume()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"train_rooms": ("kitchen:0", "kitchen:2")}, "found a run with train_rooms"),
        ({"validation_rooms": ("kitchen:2",)}, "found a run with validation_rooms"),
    ],
)
def test_a_run_keeps_its_rooms(scenes, change, sentence):
    hall(4, 3, seed=2, name="kitchen:2").save(scenes / "kitchen_00002")
    chosen = options(scenes, "ours", 40, 40)
    train(chosen)
    with pytest.raises(CheckpointError, match=sentence):
        Run(replace(chosen, **change)).resume()


def test_a_run_keeps_what_it_knew(scenes):
    chosen = options(scenes, "plain", 40, 40)
    run = Run(chosen)
    run.save(CHECKPOINT)
    run.resume()
    known = [Knowledge(layout=np.ones((4, n, n), np.float32)) for n in (38, 39)]
    for now in known:
        run.knowledge = now
        with pytest.raises(CheckpointError, match="knew something else"):
            run.resume()
    run.save(CHECKPOINT)
    run.resume()
    run.knowledge = known[0]  # the same tables, of another shape
    with pytest.raises(CheckpointError, match="knew something else"):
        run.resume()


@pytest.mark.parametrize(
    ("source", "target", "sentence"),
    [
        ("ours", "plain", None), ("ours", "stage_only", None), ("ours", "ours", None),
        ("plain", "ours", "method 'plain'"), ("reward", "stage_only", "method 'reward'"),
        ("wu", "plain", "method 'wu'"), ("cp_only", "ours", "method 'cp_only'"),
    ],
)  # fmt: skip
def test_stage_one_comes_from_a_run_with_the_same_stage_one(scenes, source, target, sentence):
    first = options(scenes, source, 0, 10)
    if source == "wu":
        first = replace(first, run=replace(first.run, model="baseline_label"))
    Run(first).save(STAGE1)
    other = options(scenes, target, 0, 20, stage1=first.out / STAGE1)
    other = replace(other, run=replace(other.run, model=first.run.model),
                    out=scenes.parent / "other")  # fmt: skip
    if sentence is None:
        Run(other).resume()
    else:
        with pytest.raises(CheckpointError, match=sentence):
            Run(other).resume()


def test_stage_one_must_be_whole_and_of_the_same_seed(scenes):
    first = options(scenes, "ours", 100, 10)
    Run(first).save(STAGE1)
    other = options(scenes, "plain", 100, 10, stage1=first.out / STAGE1)
    with pytest.raises(CheckpointError, match="after 0 episodes, expected all 100"):
        Run(other).resume()
    with pytest.raises(CheckpointError, match="with seed 0"):
        Run(replace(other, run=replace(other.run, seed=7))).resume()


def test_what_is_no_number_ends_the_run_with_its_place(scenes):
    features = np.load(scenes / "kitchen_00000" / "features.npy")
    features[5, 3] = np.nan
    np.save(scenes / "kitchen_00000" / "features.npy", features)
    chosen = options(scenes, "ours", 400, 40)
    with pytest.raises(ValueError, match="found features of state 5 of kitchen:0 in"):
        train(chosen)
    assert not (chosen.out / CHECKPOINT).exists()


def test_files_that_are_no_checkpoints_of_a_run(tmp_path):
    save_tensors(tmp_path / "other", {}, {}, "supervised")
    with pytest.raises(CheckpointError, match="of kind 'supervised' and schema 1"):
        load_tensors(tmp_path / "other")
    save_file({}, tmp_path / "old", {"head": "{}"})
    with pytest.raises(CheckpointError, match="no readable checkpoint"):
        load_tensors(tmp_path / "old")
    save_tensors(tmp_path / "new", {}, {"schema": 9})
    with pytest.raises(CheckpointError, match="schema 9"):
        load_tensors(tmp_path / "new")


def test_a_torn_line_of_the_log_is_told_and_forgotten(scenes, capsys):
    chosen = options(scenes, "plain", 40, 40)
    train(chosen)
    log = chosen.out / LOG
    whole = log.read_text()
    lines = whole.count("\n")
    Run(chosen).resume()
    assert "found line" not in capsys.readouterr().err
    log.write_text(whole + '{"episodes": 3, "sr": 0.')
    Run(chosen).resume()
    assert f"found line {lines + 1} of {log}, the last one, cut short" in capsys.readouterr().err
    assert log.read_text() == whole
    (chosen.out / CHECKPOINT).unlink()
    Run(chosen).resume()  # from nothing
    assert log.read_text() == ""


def test_damaged_lines_of_the_log_are_told_and_kept(scenes):
    chosen = options(scenes, "plain", 40, 40)
    chosen.out.mkdir(parents=True)
    damaged = b'{"episodes": 0}\n{a}\n{"episodes\xff": 0}\n{"sr": 1}\n{"episodes": 0}\n'
    (chosen.out / LOG).write_bytes(damaged)
    with pytest.raises(OSError, match=r"found 3 of 5 lines of .* damaged \(line 2, 3, 4\)"):
        train(chosen)
    assert (chosen.out / LOG).read_bytes() == damaged


def test_the_best_checkpoint_is_of_stage_two(scenes):
    """A validation at the border, after the round that ends stage one, chooses nothing."""
    chosen = options(scenes, "ours", 40, 400)
    train(replace(chosen, validation_every=40))
    _, best = load_tensors(chosen.out / BEST)
    _, stage1 = load_tensors(chosen.out / STAGE1)
    assert best["episodes"] > stage1["episodes"]
    assert {row["episodes"] // 40 for row in map(json.loads, (chosen.out / LOG).open())} >= {1, 2}


@pytest.mark.parametrize(
    ("name", "value"), [("batch", 0), ("rollout_length", 0), ("validation_episodes", 0)]
)
def test_numbers_that_make_no_sense(scenes, name, value):
    chosen = options(scenes, "ours", 40, 40)
    hp = chosen.run.hyperparameters
    if name == "validation_episodes":
        wrong = replace(chosen, validation_episodes=value)
    else:
        run = replace(chosen.run, hyperparameters=replace(hp, **{name: value}))
        wrong = replace(chosen, run=run)
    with pytest.raises(ValueError, match=f"found --{name.replace('_', '-')} 0, expected"):
        Run(wrong)


def test_validation_feeds_what_the_stage_feeds(scenes):
    """CP Only feeds its prediction in stage one already; ours does not."""
    fed = {}
    for method in ("cp_only", "ours"):
        run = Run(options(scenes, method, 40, 40))
        seen = []
        run.model.register_forward_pre_hook(
            lambda _, args, seen=seen: seen.append(float(args[0].collision_probability.max()))
        )
        run.validate()
        fed[method] = max(seen)
    assert fed["cp_only"] > 0
    assert fed["ours"] == 0


def test_rooms_cannot_both_train_and_validate(scenes):
    with pytest.raises(ValueError, match="both training and validation"):
        train(replace(options(scenes, "ours", 10, 10), validation_rooms=("kitchen:0",)))


def test_damaged_checkpoint_says_so(scenes):
    chosen = options(scenes, "plain", 100, 100)
    chosen.out.mkdir(parents=True)
    (chosen.out / CHECKPOINT).write_bytes(b"\0" * 100)
    with pytest.raises(CheckpointError, match="delete it"):
        train(chosen)


def test_killed_run_goes_on(scenes):
    out = scenes.parent / "killed"
    command = [
        sys.executable, "-m", "cfnav.cli", "train", "--scenes", str(scenes),
        "--train-rooms", "kitchen:0", "--validation-rooms", "kitchen:1", "--out", str(out),
        "--stage1-episodes", "400", "--stage2-episodes",
        "1500", "--batch", "32", "--hidden", "16",
        "--predictor-hidden", "8", "--checkpoint-s", "0.2", "--validation-episodes", "20",
        "--validation-every", "400",
    ]  # fmt: skip
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        while process.poll() is None:
            try:
                _, head = load_tensors(out / CHECKPOINT)
            except CheckpointError:
                continue
            if head["episodes"] > 450:
                break
    finally:
        process.kill()
        process.wait()
    _, killed_at = load_tensors(out / CHECKPOINT)
    with (out / LOG).open("a") as file:  # as if it had got further than its checkpoint
        file.write(json.dumps({"episodes": 10**6, "sr": 1.0}) + "\n")
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    _, head = load_tensors(out / CHECKPOINT)
    assert head["episodes"] >= 1900
    assert f"{killed_at['episodes']}/1900" in done.stderr
    assert (out / BEST).exists()
    logged = [json.loads(line)["episodes"] for line in (out / LOG).read_text().splitlines()]
    assert logged == sorted(set(logged))
    assert logged[-1] == head["episodes"]


FULL_DISK = """
import resource, sys
from pathlib import Path
import torch
from cfnav_core.files.checkpoint import save_tensors
from cfnav_core.files.whole import WriteError
path = Path(sys.argv[1])
save_tensors(path, {"a": torch.ones(3)}, {})
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, resource.RLIM_INFINITY))
try:
    save_tensors(path, {"a": torch.ones(3000)}, {})
except WriteError as error:
    print(error)
"""


REPLACE = """
import os, sys
path, *others = sys.argv[1:]
while True:
    for other in others:
        os.link(other, path + ".next")
        os.replace(path + ".next", path)
"""


def test_a_checkpoint_is_read_whole_while_the_next_one_takes_its_place(tmp_path):
    path, others = tmp_path / CHECKPOINT, [tmp_path / "short", tmp_path / "long"]
    for length, other in enumerate(others, start=1):
        save_tensors(other, {"a": torch.ones(length)}, {"episodes": length})
    shutil.copy(others[0], path)
    replacing = subprocess.Popen([sys.executable, "-c", REPLACE, path, *others])
    try:
        found = set()
        while len(found) < 2:
            assert replacing.poll() is None
            for _ in range(1000):
                tensors, head = load_tensors(path)
                assert len(tensors["a"]) == head["episodes"]
                found.add(head["episodes"])
    finally:
        replacing.kill()
        replacing.wait()


def test_a_full_disk_leaves_the_checkpoint_that_was_there(tmp_path):
    path = tmp_path / CHECKPOINT
    # the kernel refuses to write files beyond 5000 bytes
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(path)], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith(f"found no way to write {path} (")
    assert done.stdout.endswith("); make room and run the same command again\n")
    assert list(tmp_path.iterdir()) == [path]
    assert load_tensors(path)[0]["a"].tolist() == [1, 1, 1]


def test_help_names_every_option():
    done = subprocess.run(
        [sys.executable, "-m", "cfnav.cli", "train", "--help"],
        capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "100"},
    )  # fmt: skip
    asked = [f.name for c in (TrainOptions, RunConfig, Hyperparameters, ModelSize)
             for f in fields(c) if f.name not in ("run", "hyperparameters", "size")]  # fmt: skip
    for name in asked:
        assert re.search(rf"--{name.replace('_', '-')}[ ,\n]", done.stdout), name
    words = set(re.findall(r"\w+", done.stdout))
    assert {*METHODS, *MODELS, *REWARDS} <= words
    assert get_args(RewardName) == tuple(REWARDS)
