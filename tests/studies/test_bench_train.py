"""The figures of the training benchmark, on its smallest row."""

import numpy as np
import pytest
import torch

from cfnav_core.models.table import MODELS
from studies.bench.train import (
    BenchedAgent,
    Measurement,
    measure,
    measure_env,
    memory_gb_per_s,
    rows,
    synthetic_bank,
)


def test_a_row_is_measured_beside_its_bound():
    found = measure(Measurement("compact", "compact", "ours", parallel=4), 0.3)
    assert found["steps_per_cpu_s"] > 0
    # 20 steps of 4 episodes at least, and no more multiplications than the machine can do
    assert 0 < found["fraction_of_bound"] < 1.5
    # encoder 446 x 256, target 37 x 64, LSTM 331 x 1024 and 256 x 1024: forward and both gradients
    policy = 6 * (446 * 256 + 331 * 1024 + 256 * 1024) / 1e6
    assert found["mflop_per_step"] > policy
    assert found["peak_rss_mb"] > 50


def test_every_model_is_measured_at_both_widths():
    asked = {(row.model, row.width) for row in rows(quick=False)}
    for name in MODELS:
        assert (name, "compact") in asked
        assert name == "compact" or (name, "full") in asked
    assert any(row.ranks == 2 for row in rows(quick=True))


@pytest.mark.parametrize("shape", ["compact", "boxes"])
def test_the_synthetic_hall_is_a_scene(shape):
    bank = synthetic_bank(shape, positions=9)
    bank.scenes[0].check("memory", 9 * 16)
    assert len(bank.tasks.goal) > 0
    corner = bank.next_state[0]
    assert corner[0] == 1 * 16  # heading 0 leads to the next place in x
    assert bank.collided.any()
    assert (bank.next_state[bank.collided, 0] == np.nonzero(bank.collided)[0]).all()


def test_an_update_changes_the_weights():
    bench = BenchedAgent(Measurement("compact", "compact", "plain", parallel=2))
    before = [p.clone() for p in bench.agent.model.parameters()]
    assert bench.update() == 2 * bench.hp.rollout_length
    after = bench.agent.model.parameters()
    assert any((a != b).any() for a, b in zip(before, after, strict=True))


def test_the_environment_alone_is_measured():
    assert measure_env(8, 0.05) > 1000
    assert 0.1 < memory_gb_per_s(16) < 1000
    assert torch.get_num_threads() == 1
