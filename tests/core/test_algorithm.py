import numpy as np
import pytest
import torch

from cfnav_core.algorithm import Memory, Rollout, collect_rollout, compute_returns, losses
from cfnav_core.collision_predictor import CollisionPredictor, collision_loss
from cfnav_core.config import Hyperparameters
from cfnav_core.env import ObjectNavEnv, SceneBank
from cfnav_core.methods import METHODS, Stage
from cfnav_core.models import MODELS
from cfnav_core.reward import nav_reward, total_reward

from .worlds import hall


def rollout(rewards, values, ended, cut, bootstrap) -> Rollout:
    def t(rows):
        return [torch.tensor([x], dtype=torch.float32) for x in rows]

    return Rollout([], [], t(values), t(rewards), t(cut), [e > 0 for e in t(ended)], [], [], [],
                   torch.tensor([bootstrap]), 0, 0, 0, 0)  # fmt: skip


def test_returns_equal_those_of_the_printed_algorithm():
    # no end inside: R = r + gamma R, started from V
    r = rollout([1.0, 2.0, 3.0], [0.5, 0.5, 0.5], [0, 0, 0], [0, 0, 0], 10.0)
    returns, delta = compute_returns(r, 0.9, 1.0)
    expected = [1 + 0.9 * (2 + 0.9 * (3 + 0.9 * 10)), 2 + 0.9 * (3 + 0.9 * 10), 3 + 0.9 * 10]
    torch.testing.assert_close(returns[:, 0], torch.tensor(expected))
    torch.testing.assert_close(delta[:, 0], torch.tensor(expected) - 0.5)


def test_done_leads_to_zero_and_a_cut_episode_to_its_value():
    r = rollout([0.0, 5.0, 0.0], [0.0, 0.0, 0.0], [0, 1, 1], [0, 0, 7.0], 100.0)
    returns, _ = compute_returns(r, 0.5, 1.0)
    torch.testing.assert_close(returns[:, 0], torch.tensor([2.5, 5.0, 3.5]))


def test_lambda_returns_by_hand():
    r = rollout([1.0, 1.0], [2.0, 4.0], [0, 0], [0, 0], 6.0)
    _, delta = compute_returns(r, 0.5, 0.5)
    last = 1 + 0.5 * 6 - 4
    torch.testing.assert_close(
        delta[:, 0], torch.tensor([1 + 0.5 * 4 - 2 + 0.5 * 0.5 * last, last])
    )


def test_reward_of_equation_4():
    r_o = nav_reward(torch.tensor([True, False]))
    torch.testing.assert_close(r_o, torch.tensor([5.0, -0.01]))
    r = total_reward(r_o, torch.tensor([False, True]), -0.5)
    torch.testing.assert_close(r, torch.tensor([5.0, -0.51]))


def test_collision_loss_counts_only_steps_that_moved_ahead():
    logit = torch.tensor([0.0, 2.0, -1.0], requires_grad=True)
    loss = collision_loss(
        logit, torch.tensor([True, True, False]), torch.tensor([True, False, True])
    )
    expected = (-np.log(0.5) - np.log(1 - 1 / (1 + np.exp(1.0)))) / 2
    assert loss.item() == pytest.approx(expected)
    loss.backward()
    assert logit.grad[1] == 0
    nothing = collision_loss(logit, torch.ones(3).bool(), torch.zeros(3).bool())
    assert nothing.item() == 0


@pytest.fixture
def parts():
    torch.manual_seed(0)
    env = ObjectNavEnv(SceneBank([hall()]), 32, np.random.default_rng(0))
    model, predictor = MODELS["baseline"](32), CollisionPredictor(16)
    return env, model, predictor, Memory.zeros(32, model, predictor)


def fed_probabilities(parts, stage: Stage) -> torch.Tensor:
    env, model, predictor, memory = parts
    seen = []
    hook = model.register_forward_pre_hook(lambda _, args: seen.append(args[4]))
    collect_rollout(env, model, predictor, memory, stage, 5, torch.Generator().manual_seed(0))
    hook.remove()
    return torch.cat(seen)


@pytest.mark.parametrize("name", METHODS)
def test_stage_rules(parts, name):
    """p_hat is zero in stage one; the predictor learns in stage one only; r_c as the table says."""
    env, model, predictor, memory = parts
    method = METHODS[name]
    assert (fed_probabilities(parts, method.stage1) == 0).all()
    fed = fed_probabilities(parts, method.stage2)
    assert (fed > 0).all() if method.stage2.feed_prediction else (fed == 0).all()
    assert not method.stage2.train_predictor
    for stage in (method.stage1, method.stage2):
        memory.detach()
        r = collect_rollout(env, model, predictor, memory, stage, 20, torch.Generator())
        predictor.zero_grad()
        loss, collision, _ = losses(r, stage, Hyperparameters())
        assert (collision is not None) == stage.train_predictor
        loss.backward(retain_graph=collision is not None)
        # the policy's loss never reaches the predictor
        assert all(p.grad is None or (p.grad == 0).all() for p in predictor.parameters())
        if collision is not None:
            collision.backward()
            assert any((p.grad != 0).any() for p in predictor.parameters())
        collided, reward = torch.stack(r.collided), torch.stack(r.reward)
        assert collided.any()
        # a blocked MoveAhead is never a success, so r_o is the step reward there
        expected = torch.full_like(reward[collided], -0.01 + stage.collision_penalty)
        torch.testing.assert_close(reward[collided], expected)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_reads_the_collision_probability(name):
    torch.manual_seed(0)
    model = MODELS[name](32)
    inputs = [torch.randn(3, 256), torch.rand(3, 38, 5), torch.eye(38)[:3], torch.zeros(3, 6)]
    state = [torch.zeros(3, 32), torch.zeros(3, 32)]
    low = model(*inputs, torch.zeros(3, 1), *state)
    high = model(*inputs, torch.ones(3, 1), *state)
    assert low[0].shape == (3, 6)
    assert low[1].shape == (3, 1)
    assert (low[0] != high[0]).any(1).all()


def test_bootstrap_advances_no_memory(parts):
    env, model, predictor, memory = parts
    stage = METHODS["ours"].stage2
    calls = []
    predictor.register_forward_hook(lambda *_: calls.append(1))
    collect_rollout(env, model, predictor, memory, stage, 7, torch.Generator().manual_seed(0))
    assert len(calls) == 7
