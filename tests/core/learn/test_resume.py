"""Runs that are killed, go on, and meet others in their folder."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest
import torch
import torch.multiprocessing as mp

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.files.checkpoint import load_tensors, save_tensors
from cfnav_core.files.locks import locked
from cfnav_core.learn.carried import carried
from cfnav_core.learn.run import Run
from cfnav_core.learn.run_files import BEST, CHECKPOINT, LOCK, LOG, STAGE1
from cfnav_core.learn.run_log import RunLog
from cfnav_core.learn.train import Synchronous, train
from cfnav_core.models.size import ModelSize
from tests.conftest import DEADLINE_S, wait_until
from tests.core.worlds import two_halls


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return two_halls(tmp_path_factory.mktemp("halls"))


def options(scenes: Path, out: Path, stage2: int = 180, **changes: object) -> TrainOptions:
    """A run that draws from every stream: episodes, actions, and dropout in its network."""
    hp = Hyperparameters(stage1_episodes=120, stage2_episodes=stage2, batch=16, rollout_length=5)
    run = RunConfig(
        model="baseline_label", hyperparameters=hp, size=ModelSize(16, 8, 0.25), predictor_hidden=8
    )
    return TrainOptions(
        scenes, ("kitchen:0",), ("kitchen:1",), out, run=run, validation_every=60,
        validation_episodes=20, checkpoint_s=0, **changes,
    )  # fmt: skip


MOMENTS = {
    "round": (Synchronous, "round"), "carry": (Synchronous, "carried"), "save": (Run, "save"),
    "validation": (Run, "validate"), "line": (RunLog, "add"), "stage1": (Run, "keep_stage1"),
    "new file": (Path, "replace"),
}  # fmt: skip
"""What a run is killed before or after."""


def die(options: TrainOptions, moment: str, count: int, after: bool) -> None:
    """Train until a moment has come for the ``count``-th time, and be killed there."""
    owner, name = MOMENTS[moment]
    do, times = getattr(owner, name), 0

    def watched(*args: object, **kw: object) -> object:
        nonlocal times
        times += 1
        if times == count and not after:
            os.kill(os.getpid(), signal.SIGKILL)
        done = do(*args, **kw)
        if times == count:
            os.kill(os.getpid(), signal.SIGKILL)
        return done

    setattr(owner, name, watched)
    train(options)


def start(work: Callable[..., object], *arguments: object) -> BaseProcess:
    context = mp.get_context("forkserver")  # from a process that has imported everything
    context.set_forkserver_preload(["cfnav_core.learn.train", "torch._dynamo"])
    process = context.Process(target=work, args=arguments)
    process.start()
    return process


def kill(options: TrainOptions, moment: str, count: int, after: bool) -> None:
    process = start(die, options, moment, count, after)
    process.join(DEADLINE_S)
    assert process.exitcode == -signal.SIGKILL


OF_THE_MACHINE = ("steps_per_s", "cpu_s", "memory_mb", "peak_memory_mb")


def lines(folder: Path) -> list[dict[str, float]]:
    rows = [json.loads(line) for line in (folder / LOG).read_text().splitlines()]
    return [{k: v for k, v in row.items() if k not in OF_THE_MACHINE} for row in rows]


def assert_same(folder: Path, expected: Path) -> None:
    """All that two runs left agrees to the last bit, but for what the machine takes."""
    assert lines(folder) == lines(expected)
    for name in (CHECKPOINT, STAGE1, BEST):
        (found, head), (there, other) = (load_tensors(f / name) for f in (folder, expected))
        assert found.keys() == there.keys()
        assert [k for k in found if not torch.equal(found[k], there[k])] == []
        for said in (head, other):
            del said["cpu_s"], said["commit"]  # files may be edited while tests run
            said.get("progress", {}).get("sums", {}).pop("seconds", None)
        assert head == other


@pytest.fixture(scope="module")
def whole(scenes: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that nobody stopped."""
    out = tmp_path_factory.mktemp("whole")
    train(options(scenes, out))
    return out


@pytest.mark.parametrize(
    "kills",
    [
        # where rounds, checkpoints and lines of the log follow one another
        [("round", 3, False), ("carry", 2, True), ("line", 1, True), ("new file", 5, False)],
        # at the border of the stages: with its checkpoint, without stage one; in the validation
        [("stage1", 1, False), ("stage1", 1, True), ("validation", 1, False), ("line", 1, True)],
        # with the best weights, without the checkpoint that knows them; then at the end
        [("line", 3, True), ("save", 2, True), ("validation", 2, True), ("round", 1, True)],
    ],
)
def test_a_killed_run_ends_like_one_that_was_not(scenes, whole, tmp_path, kills):
    chosen = options(scenes, tmp_path)
    for moment in kills:
        kill(chosen, *moment)
    train(chosen)
    assert_same(tmp_path, whole)


def by_rule(scenes: Path, out: Path) -> TrainOptions:
    """A stage one that validations end: after its best one, and before its most."""
    return options(scenes, out, stage1_most=600, stage1_rise=0.1, stage1_patience=1)


@pytest.fixture(scope="module")
def whole_by_rule(scenes: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("by_rule")
    train(by_rule(scenes, out))
    stage1 = load_tensors(out / STAGE1)[1]["stage1"]
    assert 120 < stage1["ended"] < 600
    assert stage1["frozen"][0] < stage1["ended"]  # an earlier predictor comes back
    return out


@pytest.mark.parametrize(
    "kills",
    [
        # while a best predictor is kept that is not the present one
        [("validation", 2, True), ("round", 5, True), ("line", 2, False)],
        # at the end of stage one: before and after its checkpoint, before and after its copy
        [("stage1", 1, False), ("stage1", 1, True), ("round", 2, True)],
    ],
)
def test_a_killed_run_under_the_rule_ends_like_one_that_was_not(
    scenes, whole_by_rule, tmp_path, kills
):
    chosen = by_rule(scenes, tmp_path)
    for moment in kills:
        kill(chosen, *moment)
    train(chosen)
    assert_same(tmp_path, whole_by_rule)


def test_a_kill_in_the_last_validation_loses_nothing(scenes, tmp_path):
    chosen = options(scenes, tmp_path / "killed", stage2=0)
    chosen = replace(chosen, validation_every=1000)
    kill(chosen, "validation", 1, False)
    assert not (chosen.out / BEST).exists()
    assert load_tensors(chosen.out / CHECKPOINT)[1]["episodes"] >= 120
    assert train(chosen).exists()
    train(replace(chosen, out=tmp_path / "whole"))
    assert_same(tmp_path / "killed", tmp_path / "whole")
    head = load_tensors(chosen.out / BEST)[1]
    assert head["best"] == max(row["validation_cf_sr"] for row in lines(chosen.out))


def test_a_run_of_a_given_stage_one_alone_has_a_best_checkpoint(scenes, whole, tmp_path):
    chosen = options(scenes, tmp_path, stage2=0, stage1=whole / STAGE1)
    assert train(chosen).exists()
    assert len(lines(tmp_path)) == 1


def test_all_that_is_carried_comes_back(scenes, tmp_path):
    first = Synchronous(Run(options(scenes, tmp_path)))
    first.round()
    memory = first.learner.memory.reward  # this run's own reward remembers nothing
    memory.seen_parents[3, 2], memory.best_similarity[5] = True, 0.25
    kept = first.carried()
    run = Run(options(scenes, tmp_path))
    run.carried = {k: v.clone() for k, v in kept.items()}
    other = Synchronous(run)
    again = carried(other.learner)
    assert again.keys() == kept.keys()
    assert [k for k in kept if not torch.equal(again[k], kept[k])] == []
    assert sum(v.nbytes for v in kept.values()) < 32_000


@pytest.mark.parametrize("old", [True, False])
def test_a_run_without_its_episodes_says_so_and_goes_on(scenes, whole, tmp_path, capsys, old):
    tensors, head = load_tensors(whole / CHECKPOINT)
    if old:  # a checkpoint as they were before episodes were kept
        tensors = {k: v for k, v in tensors.items() if not k.startswith("carried.")}
        del head["progress"]
    save_tensors(tmp_path / CHECKPOINT, tensors, head)
    chosen = options(scenes, tmp_path, stage2=300)
    if not old:
        hp = replace(chosen.run.hyperparameters, batch=8)
        chosen = replace(chosen, run=replace(chosen.run, hyperparameters=hp))
    train(chosen)
    assert f"found no {8 if not old else 16} episodes under way in" in capsys.readouterr().err
    assert load_tensors(tmp_path / CHECKPOINT)[1]["episodes"] >= 420


@pytest.mark.parametrize("workers", [0, 1])
def test_a_second_run_in_the_same_folder_is_refused(scenes, tmp_path, workers):
    first = start(train, options(scenes, tmp_path, stage2=10**6, workers=workers))
    try:
        wait_until((tmp_path / CHECKPOINT).exists, "a checkpoint")
        command = [
            sys.executable, "-m", "cfnav.cli", "train", "--scenes", str(scenes), "--train-rooms",
            "kitchen:0", "--validation-rooms", "kitchen:1", "--out", str(tmp_path),
        ]  # fmt: skip
        second = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S)
        assert first.is_alive()
    finally:
        first.kill()
        first.join()
    assert second.returncode == 2
    assert second.stderr == (
        f"cfnav: found {tmp_path / LOCK} held by another process; let that end, or stop it, then "
        "go on\n"
    )
    with locked(tmp_path / LOCK):  # free at once
        pass
