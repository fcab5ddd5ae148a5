"""Nothing is made on a device by accident: a GPU's run mixes no devices.

Where no GPU is, the default device is one that cannot compute, so that a tensor made without
naming its device fails the run.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from cfnav_core.agent.agent import new_agent
from cfnav_core.agent.config import Hyperparameters, RunConfig
from cfnav_core.agent.methods import METHODS
from cfnav_core.learn.algorithm import Memory, collect_rollout, losses
from cfnav_core.learn.env import ObjectNavEnv, SceneBank
from cfnav_core.learn.ranks import Ranks
from cfnav_core.models.parts.recurrent import weight_gradients_at_once
from cfnav_core.models.table import MODELS
from tests.core.model_samples import SMALL, knowledge
from tests.core.worlds import hall

CPU = torch.device("cpu")


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("method", ["ours", "xiao"])
def test_a_rollout_names_the_device_of_every_tensor(name, method):
    bank = SceneBank([hall()], device=CPU)
    tables = knowledge(len(bank.objects))
    known = replace(tables, parents=np.zeros_like(tables.layout))
    agent = new_agent(
        RunConfig(method, name, size=SMALL, predictor_hidden=8), bank.inputs, known, CPU
    )
    env = ObjectNavEnv(bank, 4, np.random.default_rng(0))
    generator, hp = torch.Generator().manual_seed(0), Hyperparameters()
    for stage in (METHODS[method].stage1, METHODS[method].stage2):
        with torch.device("meta"), weight_gradients_at_once(agent.model, agent.predictor):
            memory = Memory.zeros(env, agent)
            rollout = collect_rollout(env, agent, memory, stage, 8, generator)
            loss, collision, figures = losses(rollout, stage, hp)
            (loss if collision is None else loss + collision).backward()
        assert all(np.isfinite(v) for v in figures.values())
        assert all(p.device == CPU for p in agent.model.parameters())
        assert any(p.grad is not None and p.grad.any() for p in agent.model.parameters())


def test_what_auto_means_and_a_gpu_that_is_not_there(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert Ranks().device("auto") == CPU
    with pytest.raises(ValueError, match="found no GPU"):
        Ranks().device("cuda")
    with pytest.raises(ValueError, match="found --device tpu"):
        Ranks().device("tpu")
