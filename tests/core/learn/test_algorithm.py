from dataclasses import replace

import numpy as np
import pytest
import torch

from cfnav_core.agent.agent import Agent, new_agent
from cfnav_core.agent.collision_predictor import collision_loss
from cfnav_core.agent.config import Hyperparameters, RunConfig
from cfnav_core.agent.methods import METHODS, Stage
from cfnav_core.agent.reward import nav_reward, total_reward
from cfnav_core.learn.algorithm import Memory, Rollout, collect_rollout, compute_returns, losses
from cfnav_core.learn.env import ObjectNavEnv, SceneBank
from cfnav_core.models.base import Knowledge, ModelInput
from cfnav_core.models.size import ModelSize
from tests.core.worlds import hall


def rollout(rewards, values, ended, cut, bootstrap) -> Rollout:
    def t(rows):
        return [torch.tensor([x], dtype=torch.float32) for x in rows]

    return Rollout(
        value=t(values), reward=t(rewards), next_value_if_cut=t(cut),
        ended=[e > 0 for e in t(ended)], bootstrap=torch.tensor([bootstrap]),
    )  # fmt: skip


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


SMALL = RunConfig(model="baseline_label", size=ModelSize(32, 8), predictor_hidden=16)


def parts(method: str = "ours", **changes) -> tuple[ObjectNavEnv, Agent, Memory]:
    torch.manual_seed(0)
    bank = SceneBank([hall()])
    env = ObjectNavEnv(bank, 32, np.random.default_rng(0))
    agent = new_agent(replace(SMALL, method=method, **changes), bank.inputs, Knowledge())
    return env, agent, Memory.zeros(env, agent)


def fed_probabilities(env, agent, memory, stage: Stage) -> torch.Tensor:
    seen = []
    hook = agent.model.register_forward_pre_hook(
        lambda _, args: seen.append(args[0].collision_probability)
    )
    collect_rollout(env, agent, memory, stage, 5, torch.Generator().manual_seed(0))
    hook.remove()
    return torch.cat(seen)


def test_truth_is_told_before_the_step():
    """Told that a MoveAhead would collide, it collides; told otherwise, it moves."""
    env, agent, memory = parts("truth")
    told = fed_probabilities(env, agent, memory, METHODS["truth"].stage2)
    told = told[: 5 * env.batch].view(5, -1).bool()
    env, agent, memory = parts("truth")
    r = collect_rollout(
        env, agent, memory, METHODS["truth"].stage2, 5, torch.Generator().manual_seed(0)
    )
    ahead, collided = torch.stack(r.moved_ahead), torch.stack(r.collided)
    assert (ahead & told).any()
    assert (ahead & ~told).any()
    assert torch.equal(collided, ahead & told)


def test_the_true_flag_is_given_only_where_p_hat_is():
    assert Stage(feed_truth=True).p_hat == "zero"
    assert Stage(feed_truth=True, feed_prediction=True).p_hat == "true"


@pytest.mark.parametrize("name", METHODS)
def test_stage_rules(name):
    """p_hat and predictor as the method's stages say; r_c and shaping as the table says."""
    env, agent, memory = parts(name)
    method, own = METHODS[name], own_parameters(agent)
    for stage in (method.stage1, method.stage2):
        fed = fed_probabilities(env, agent, memory, stage)
        if stage.feed_truth:
            assert set(fed.unique().tolist()) == {0.0, 1.0}
        else:
            assert (fed > 0).all() if stage.feed_prediction else (fed == 0).all()
        memory.detach()
        r = collect_rollout(env, agent, memory, stage, 20, torch.Generator())
        loss, collision, _ = losses(r, stage, Hyperparameters())
        assert (collision is not None) == stage.train_predictor
        agent.predictor.zero_grad()
        loss.backward(retain_graph=collision is not None)
        # the policy's loss never reaches the predictor's own weights
        assert all(p.grad is None or (p.grad == 0).all() for p in own)
        if collision is not None:
            collision.backward()
            assert any((p.grad != 0).any() for p in own)
        collided, reward = torch.stack(r.collided), torch.stack(r.reward)
        assert collided.any()
        # a blocked MoveAhead is never a success and leads nowhere, so r_o is what a move costs: 0
        expected = torch.full_like(reward[collided], stage.collision_penalty)
        torch.testing.assert_close(reward[collided], expected)


def own_parameters(agent: Agent) -> list[torch.Tensor]:
    shared = {id(p) for p in agent.model.parameters()}
    return [p for p in agent.predictor.parameters() if id(p) not in shared]


def test_only_ours_freezes_its_predictor_and_only_wu_shares_an_encoder():
    assert METHODS["ours"].stage1.train_predictor
    assert not METHODS["ours"].stage2.train_predictor
    for name in METHODS:
        _, agent, _ = parts(name)
        shared = agent.predictor.picture is agent.model.picture
        assert shared == (name == "wu")


def test_the_prediction_trains_a_shared_encoder():
    env, agent, memory = parts("wu")
    r = collect_rollout(env, agent, memory, METHODS["wu"].stage1, 20, torch.Generator())
    _, collision, _ = losses(r, METHODS["wu"].stage1, Hyperparameters())
    collision.backward()
    assert all((p.grad != 0).any() for p in agent.model.picture.parameters())
    assert agent.model.fusion.pointwise.weight.grad is None


def test_shaping_pays_each_metre_of_the_way():
    env, agent, memory = parts("xiao", reward="baseline")
    stage = METHODS["xiao"].stage1
    before = env.state.clone()
    r = collect_rollout(env, agent, memory, stage, 1, torch.Generator().manual_seed(1))
    paths, goal = env.bank.paths, env.goal
    still = ~r.ended[0]
    way = (paths[before, goal] - paths[env.state, goal])[still]
    assert (way != 0).any()
    plain = -0.01 - 0.1 * r.collided[0][still].float()
    torch.testing.assert_close(r.reward[0][still], plain + 0.01 * way)


def test_bootstrap_advances_no_memory():
    env, agent, memory = parts()
    stage = METHODS["ours"].stage2
    calls = []
    agent.predictor.register_forward_hook(lambda *_: calls.append(1))
    collect_rollout(env, agent, memory, stage, 7, torch.Generator().manual_seed(0))
    assert len(calls) == 7


def test_a_cut_episode_is_worth_what_the_state_is_that_it_reached(monkeypatch):
    _, agent, _ = parts()
    env = ObjectNavEnv(SceneBank([hall()]), 32, np.random.default_rng(0), most_steps=3)
    memory, step, restart = Memory.zeros(env, agent), env.step, env.restart
    cut, values = [], []

    def stepped(action):
        outcome = step(action)
        cut.append(outcome.truncated)
        return outcome

    def restarted(ended):
        """Judge the states that were reached, before episodes begin anew."""
        seen = ModelInput(
            *env.observe(), env.goal_one_hot, env.room_one_hot, memory.previous_action,
            torch.zeros(env.batch, 1),
        )  # fmt: skip
        with torch.no_grad():
            values.append(agent.model(seen, memory.policy)[1][:, 0])
        restart(ended)

    monkeypatch.setattr(env, "step", stepped)
    monkeypatch.setattr(env, "restart", restarted)
    generator = torch.Generator().manual_seed(0)
    r = collect_rollout(env, agent, memory, METHODS["plain"].stage1, 7, generator)
    assert cut[2].any()
    for where, value, found in zip(cut, values, r.next_value_if_cut, strict=True):
        torch.testing.assert_close(found, torch.where(where, value, 0.0))
    kept = ~r.ended[-1]
    torch.testing.assert_close(r.bootstrap[kept], values[-1][kept])
