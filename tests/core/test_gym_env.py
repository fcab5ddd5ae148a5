"""Gymnasium's own checkers, and the specification in the module's docstring."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from cfnav_core.actions import Action
from cfnav_core.env import SceneBank

from .worlds import hall

NAME = "cfnav_core.gym_env:cfnav/ObjectNav-v0"


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    for seed in range(2):
        hall(4, 3, seed=seed, name=f"kitchen:{seed}").save(folder / f"kitchen_{seed:05d}")
    return folder


@pytest.mark.filterwarnings("error", "ignore:.*[Bb]ox.*infinity")
def test_gymnasium_accepts_it(scenes):
    check_env(gymnasium.make(NAME, scenes=scenes).unwrapped, skip_render_check=True)


def test_an_episode_by_the_tables(scenes):
    env = gymnasium.make(NAME, scenes=scenes, rooms=("kitchen:0",), collision_penalty=-0.5)
    bank = SceneBank.load(scenes, ["kitchen:0"])
    seen, info = env.reset(seed=3)
    inner = env.unwrapped._episodes.env
    goal, total, actions = int(seen["goal"]), 0.0, 0
    while not bank.visible[(state := int(inner.state[0])), goal]:
        action = int(bank.actions_to[bank.next_state[state, :5], goal].argmin())
        seen, reward, terminated, truncated, info = env.step(action)
        total, actions = total + reward, actions + 1
        assert not terminated
        assert not truncated
        assert not info["collided"]
    seen, reward, terminated, _, info = env.step(int(Action.Done))
    assert terminated
    assert info["success"]
    assert reward == pytest.approx(5.0)
    assert total == pytest.approx(-0.01 * actions)
    assert info["shortest"] == actions + 1


def test_a_blocked_move_costs_the_penalty(scenes):
    env = gymnasium.make(NAME, scenes=scenes, collision_penalty=-0.5)
    env.reset(seed=0)
    inner = env.unwrapped._episodes.env
    inner.state[0] = int(np.nonzero(inner.bank.collided)[0][0])
    _, reward, terminated, truncated, info = env.step(int(Action.MoveAhead))
    assert reward == pytest.approx(-0.51)
    assert info["collided"]
    assert info["collisions"] == 1
    assert not terminated
    assert not truncated


def test_a_vector_restarts_in_the_same_step(scenes):
    env = gymnasium.make_vec(NAME, num_envs=5, scenes=scenes)
    seen, _ = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    before = seen["features"].copy()
    actions = np.array([5, 1, 5, 1, 1])
    after, reward, terminated, truncated, info = env.step(actions)
    assert env.observation_space.contains(after)
    assert terminated.tolist() == [True, False, True, False, False]
    assert not truncated.any()
    assert info["_final_obs"].tolist() == terminated.tolist()
    # Done moves nothing: the old episodes' last pictures are those they had
    np.testing.assert_array_equal(info["final_obs"][2]["features"], before[2])
    assert info["final_obs"][1] is None
    assert info["final_info"]["_success"].tolist() == terminated.tolist()
    assert (reward[[1, 3, 4]] == np.float32(-0.01)).all()
    assert (info["collisions"] == 0).all()


def test_a_seed_repeats_everything(scenes):
    def run(seed):
        env = gymnasium.make_vec(NAME, num_envs=3, scenes=scenes)
        seen, _ = env.reset(seed=seed)
        out, rng = [seen["goal"]], np.random.default_rng(0)
        for _ in range(40):
            seen, *_ = env.step(rng.integers(6, size=3))
            out.append(seen["goal"])
        return np.array(out)

    np.testing.assert_array_equal(run(4), run(4))
    assert (run(4) != run(5)).any()
