"""The paper's asynchronous workers over shared weights."""

import json
from dataclasses import replace

import pytest
import torch

from cfnav_core.checkpoint import load_tensors
from cfnav_core.config import Hyperparameters, ModelSize, RunConfig, TrainOptions
from cfnav_core.run import BEST, CHECKPOINT, STAGE1, Run
from cfnav_core.train import train
from cfnav_core.workers import Shared, Workers, apply_gradients

from .worlds import hall


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


def test_every_worker_steps_the_same_weights(options):
    run = Run(options)
    shared = Shared.of(run.agent, 0.1)
    before = [p.clone() for p in shared.agent.model.parameters()]
    other = Run(options).agent
    loss = sum(p.sum() for p in other.model.parameters())
    apply_gradients(other, shared, loss, None, max_norm=1e9)
    for old, new in zip(before, shared.agent.model.parameters(), strict=True):
        assert (new < old).all()
        assert new.is_shared()
    state = shared.optimizer.state[next(iter(shared.agent.model.parameters()))]
    assert all(value.is_shared() for value in state.values())
    assert float(state["step"]) == 1.0


def test_a_dead_worker_ends_the_run(options):
    with Workers(Run(options)) as workers:
        workers.processes[0].kill()
        workers.processes[0].join()
        with pytest.raises(RuntimeError, match="worker 0 ended with code -9"):
            workers.round()
    assert all(process.exitcode is not None for process in workers.processes)
