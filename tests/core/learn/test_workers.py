"""The paper's asynchronous workers over shared weights."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.files.checkpoint import CheckpointError, load_tensors
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.run import Run
from cfnav_core.learn.run_files import BEST, CHECKPOINT, STAGE1
from cfnav_core.learn.train import train
from cfnav_core.learn.workers import EPS, LOOK_S, Copy, Workers
from cfnav_core.models.size import ModelSize
from tests.conftest import DEADLINE_S, wait_until
from tests.core.worlds import hall


@pytest.fixture
def options(tmp_path) -> TrainOptions:
    for seed in range(2):
        folder = tmp_path / "scenes" / f"kitchen_{seed:05d}"
        hall(4, 3, seed=0, name=f"kitchen:{seed}").save(folder)
    hp = Hyperparameters(stage1_episodes=150, stage2_episodes=150, rollout_length=10, lr=1e-3)
    run = RunConfig(hyperparameters=hp, size=ModelSize(32), predictor_hidden=16)
    return TrainOptions(
        tmp_path / "scenes", ("kitchen:0",), ("kitchen:1",), tmp_path / "run", run=run, workers=2,
        validation_every=100, validation_episodes=20,
    )  # fmt: skip


def test_a_run_with_workers_ends_and_can_be_exported(options):
    train(options)
    tensors, head = load_tensors(options.out / CHECKPOINT)
    assert head["episodes"] >= 300
    start = Run(replace(options, out=options.out / "fresh")).agent
    assert any((tensors[f"model.{k}"] != v).any() for k, v in start.model.state_dict().items())
    # what the predictor learnt in stage one stays as it was in stage two
    first, _ = load_tensors(options.out / STAGE1)
    best, _ = load_tensors(options.out / BEST)
    assert any(
        (tensors[f"predictor.{k}"] != v).any() for k, v in start.predictor.state_dict().items()
    )
    for key in (k for k in first if k.startswith("predictor.")):
        torch.testing.assert_close(best[key], tensors[key], rtol=0, atol=0)
    log = [json.loads(line) for line in (options.out / "log.jsonl").read_text().splitlines()]
    assert log[-1]["episodes"] >= 300
    assert log[-1]["steps"] > 0


def test_every_worker_steps_the_same_weights_as_adam_does(options):
    """Two copies in turn do what one Adam does on the plain network."""
    run, plain = Run(options), Run(options).agent
    shared = Workers(run).shared
    reference = torch.optim.Adam(plain.model.parameters(), 1e-2, eps=EPS, amsgrad=True)
    agents = [Run(options).agent for _ in range(2)]
    copies = [Copy(shared.policy, a.parameters()[0], 1e-2, 1.0) for a in agents]
    for agent, copy in zip(agents, copies, strict=True):
        copy.fetch()
        for model in (agent.model, plain.model):
            sum((p**2).sum() + p.sum() for p in model.parameters()).backward()
        copy.update()
        torch.nn.utils.clip_grad_norm_(plain.model.parameters(), 1.0)
        reference.step()
        reference.zero_grad()
    for ours, expected in zip(run.model.parameters(), plain.model.parameters(), strict=True):
        torch.testing.assert_close(ours, expected)
        assert ours.is_shared()
    assert float(shared.policy.step) == 2
    row = run.optimizer.state[next(iter(run.model.parameters()))]
    expected = reference.state[next(iter(plain.model.parameters()))]
    for key, value in row.items():
        torch.testing.assert_close(value, expected[key])


def test_what_is_judged_is_what_is_saved_while_workers_go_on(options):
    workers = Workers(Run(options))
    weight = next(workers.run.model.parameters())
    with workers.still():
        before = weight.clone()
        workers.shared.policy.weights.add_(1.0)
        assert torch.equal(weight, before)
    assert torch.equal(weight, before + 1.0)


def test_no_worker_begins_stage_two_before_stage_one_is_kept(options):
    with Workers(Run(options)) as workers:
        episodes = options.run.hyperparameters.stage1_episodes
        wait_until(lambda: workers.shared.episodes >= episodes, "the end of stage one")
        wait_until(lambda: sleeps(workers), "the workers to wait, or to have ended")
        assert workers.shared.episodes < 300
        workers.run.episodes = int(workers.shared.episodes)
        workers.round()
        wait_until(lambda: workers.shared.episodes >= 300, "stage two")


def sleeps(workers: Workers) -> bool:
    """Whether nothing was counted for longer than a worker waits before it looks again."""
    before = workers.shared.counts.clone()
    time.sleep(30 * LOOK_S)
    return torch.equal(workers.shared.counts, before)


def test_a_checkpoint_brings_back_weights_and_optimizer(options):
    train(options)
    tensors, head = load_tensors(options.out / CHECKPOINT)
    run = Run(options)
    shared = Workers(run).shared
    assert shared.episodes == head["episodes"]
    assert float(shared.policy.step) == tensors["optimizer.0.step"] > 0
    for k, key in enumerate(("exp_avg", "exp_avg_sq", "max_exp_avg_sq")):
        stored = [tensors[f"optimizer.{i}.{key}"] for i, _ in enumerate(run.model.parameters())]
        torch.testing.assert_close(
            shared.policy.moments[k], torch.cat([t.flatten() for t in stored]), rtol=0, atol=0
        )
        assert (shared.policy.moments[k] != 0).any()
    run.save("again")
    again, _ = load_tensors(options.out / "again")
    assert again.keys() == tensors.keys()
    assert all((again[key] == tensors[key]).all() for key in tensors)


def test_workers_go_on_from_a_synchronous_stage_one(options):
    train(replace(options, workers=0))
    stage1 = options.out / STAGE1
    workers = Workers(Run(replace(options, out=options.out / "next", stage1=stage1)))
    _, second, largest = workers.shared.policy.moments
    assert (second > 0).any()
    assert (largest == second).all()


def start(options: TrainOptions, workers: int, **changes: object) -> subprocess.Popen:
    """``cfnav train`` as the head of a session of its own."""
    given = {"stage1-episodes": 60, "stage2-episodes": 100_000, "rollout-length": 10} | changes
    command = [
        sys.executable, "-m", "cfnav.cli", "train", "--scenes", str(options.scenes),
        "--train-rooms", "kitchen:0", "--validation-rooms", "kitchen:1", "--out", str(options.out),
        "--workers", str(workers), "--checkpoint-s", "0.2", "--validation-episodes", "20",
        "--validation-every", "50", "--hidden", "16", "--predictor-hidden", "8",
        *(text for k, v in given.items() for text in (f"--{k}", str(v))),
    ]  # fmt: skip
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)


def episodes(options: TrainOptions) -> int:
    try:
        return load_tensors(options.out / CHECKPOINT)[1]["episodes"]
    except CheckpointError:
        return 0


def members(session: int) -> list[int]:
    """Living processes of a session, the youngest last."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append((int(fields[19]), int(stat.parent.name)))
    return [pid for _, pid in sorted(found)]


def end_all(session: int) -> None:
    for pid in members(session):
        os.kill(pid, signal.SIGKILL)


def test_a_killed_run_leaves_no_worker_and_goes_on(options):
    written = options.out / "log.jsonl"
    process = start(options, 2)
    try:
        # the first checkpoint of stage two may stand before the first line of the log
        wait_until(lambda: episodes(options) > 90 and written.exists(), "checkpoint and log")
        assert len(members(process.pid)) >= 3
        process.kill()
        process.wait()
        wait_until(lambda: not members(process.pid), "end of the workers")
    finally:
        end_all(process.pid)
    killed, head = load_tensors(options.out / CHECKPOINT)
    before = len(written.read_text().splitlines())
    total = 60 + head["episodes"]
    process = start(options, 2, **{"stage2-episodes": head["episodes"]})
    _, text = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, text
    assert f"{head['episodes']}/{total}" in text
    tensors, after = load_tensors(options.out / CHECKPOINT)
    assert after["episodes"] >= total
    assert after["steps"] > head["steps"]
    assert tensors["optimizer.0.step"] > killed["optimizer.0.step"]
    # the predictor was frozen before the kill, and is after it
    key = "predictor.head.weight"
    assert (tensors[key] == killed[key]).all()
    log = [json.loads(line) for line in written.read_text().splitlines()]
    assert len(log) > before
    # a validation that the kill cut short is made up for: its row is of the checkpoint
    assert all(row["episodes"] >= head["episodes"] for row in log[before:])


@pytest.mark.parametrize(
    ("workers", "number"), [(2, signal.SIGINT), (2, signal.SIGTERM), (0, signal.SIGTERM)]
)
def test_a_run_that_is_told_to_stop_writes_a_checkpoint(options, workers, number):
    process = start(options, workers)
    try:
        wait_until(lambda: episodes(options) > 0, "checkpoint")
        os.killpg(process.pid, number)  # as a terminal does, workers included
        _, text = process.communicate(timeout=DEADLINE_S)
        wait_until(lambda: not members(process.pid), "end of the workers")
    finally:
        end_all(process.pid)
    assert process.returncode == 130, text
    assert "Traceback" not in text
    said = re.search(r"cfnav: stopped after (\d+) of 100060 episodes", text)
    assert said, text
    assert int(said[1]) == episodes(options)


def test_a_dead_worker_ends_the_run(options):
    process = start(options, 3)
    try:
        wait_until(lambda: episodes(options) > 0, "checkpoint")
        os.kill(members(process.pid)[-1], signal.SIGKILL)
        _, text = process.communicate(timeout=DEADLINE_S)
        wait_until(lambda: not members(process.pid), "end of the workers")
    finally:
        end_all(process.pid)
    assert process.returncode == 2
    assert "Traceback" not in text
    assert re.search(r"cfnav: found worker \d of 3 ended with SIGKILL", text), text
    assert episodes(options) > 0


def test_what_is_no_number_ends_the_run_with_its_place(options):
    path = options.scenes / "kitchen_00000" / "features.npy"
    features = np.load(path)
    features[:, 3] = np.nan  # whatever it visits
    np.save(path, features)
    with pytest.raises(ValueError, match="found features of state 0 of kitchen:0 in"):
        train(options)


def test_what_stays_mapped_is_what_is_joined(options):
    rooms = ("kitchen:0", "kitchen:1")
    joined = SceneBank.load(options.scenes, rooms)
    mapped = SceneBank.load(options.scenes, rooms, in_memory=False)
    states = torch.arange(len(joined.scene)).flip(0)
    for ours, expected in zip(mapped.observe(states), joined.observe(states), strict=True):
        torch.testing.assert_close(ours, expected, rtol=0, atol=0)
