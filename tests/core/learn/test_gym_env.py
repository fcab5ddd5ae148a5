"""Gymnasium's own checkers, and the specification in the module's docstring."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import (
    ClipReward,
    DictInfoToList,
    FlattenObservation,
    RecordEpisodeStatistics,
)

from cfnav_core.learn.env import SceneBank
from cfnav_core.task.actions import Action
from tests.core.worlds import hall

NAME = "cfnav:cfnav/ObjectNav-v0"


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


def test_an_end_takes_no_info_from_the_episodes_that_go_on(scenes):
    env = gymnasium.make_vec(NAME, num_envs=3, scenes=scenes)
    env.reset(seed=1)
    inner = env._episodes.env
    inner.state[0] = int(np.nonzero(inner.bank.collided)[0][0])
    for collisions in (1, 2):
        info = env.step(np.array([Action.MoveAhead, Action.Done, Action.RotateLeft]))[4]
        assert info["collided"].tolist() == [True, False, False]
        assert info["collisions"].tolist() == [collisions, 0, 0]
        assert info["_final_info"].tolist() == [False, True, False]


def test_a_vector_does_what_gymnasium_does_with_single_ones(scenes):
    """Gymnasium has no checker for vectors; its own vector of single environments stands in.

    Starts are drawn in another order, so those of the vector are handed to the single ones.
    """
    n, rng = 4, np.random.default_rng(0)
    ours = gymnasium.make_vec(NAME, num_envs=n, scenes=scenes, collision_penalty=-0.5)
    theirs = SyncVectorEnv(
        [lambda: gymnasium.make(NAME, scenes=scenes, collision_penalty=-0.5)] * n,
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]

    def hand_over(which):
        for i in np.nonzero(which)[0]:
            one, all_of_them = theirs.envs[i].unwrapped._episodes, ours._episodes.env
            one.env.state[0], one.env.goal[0] = all_of_them.state[i], all_of_them.goal[i]
            one.shortest = one._fewest()

    _, first = ours.reset(seed=2)
    assert first.keys() == theirs.reset(seed=2)[1].keys()
    hand_over(np.ones(n, bool))
    ends = truncations = collided_beside_an_end = 0
    for t in range(250):
        # one episode in four never says Done
        actions = rng.integers([5, 6, 6, 6], size=n) if t % 3 else np.zeros(n, np.int64)
        (seen, *outcome, info), (seen2, *outcome2, info2) = ours.step(actions), theirs.step(actions)
        for a, b in zip(outcome, outcome2, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-6)
        ended = outcome[1] | outcome[2]
        for key in seen:
            np.testing.assert_array_equal(seen[key][~ended], seen2[key][~ended])
        assert info.keys() == info2.keys()
        for key in ("collided", "success", "collisions", "shortest"):
            np.testing.assert_array_equal(info[key][~ended], info2[key][~ended])
            assert info[f"_{key}"].all()
            assert info2[f"_{key}"].all()
            if ended.any():
                last, last2 = info["final_info"], info2["final_info"]
                np.testing.assert_array_equal(last[key][ended], last2[key][ended])
                np.testing.assert_array_equal(last[f"_{key}"], last2[f"_{key}"])
        for i in np.nonzero(ended)[0]:
            for key, value in info["final_obs"][i].items():
                np.testing.assert_array_equal(value, info2["final_obs"][i][key])
        ends, truncations = ends + ended.sum(), truncations + outcome[2].sum()
        collided_beside_an_end += ended.any() and info["collided"].any()
        hand_over(ended)
    assert ends > 20
    assert truncations > 0
    assert collided_beside_an_end > 0


def test_returns_and_lengths_recorded_by_gymnasium_are_those_summed_by_hand(scenes):
    env = RecordEpisodeStatistics(gymnasium.make_vec(NAME, num_envs=3, scenes=scenes))
    env.reset(seed=1)
    rng, returns, lengths, ends = np.random.default_rng(0), np.zeros(3), np.zeros(3, int), 0
    for _ in range(400):
        _, reward, terminated, truncated, info = env.step(
            rng.choice(6, 3, p=[0.4, 0.2, 0.2, 0.05, 0.05, 0.1])
        )
        returns, lengths, ended = returns + reward, lengths + 1, terminated | truncated
        if ended.any():
            np.testing.assert_allclose(info["episode"]["r"][ended], returns[ended], atol=1e-5)
            np.testing.assert_array_equal(info["episode"]["l"][ended], lengths[ended])
        returns[ended], lengths[ended], ends = 0.0, 0, ends + ended.sum()
    assert ends > 60


def test_gymnasiums_vector_wrappers(scenes):
    env = gymnasium.make_vec(NAME, num_envs=3, scenes=scenes)
    # those of observations refuse every vector that begins again in the same step
    with pytest.raises(ValueError, match="Expected autoreset_mode to be NEXT_STEP or DISABLED"):
        FlattenObservation(env)
    env = DictInfoToList(ClipReward(RecordEpisodeStatistics(env), 0.0, 1.0))
    _, infos = env.reset(seed=0)
    assert [set(info) for info in infos] == 3 * [{"collided", "success", "collisions", "shortest"}]
    env.step(np.full(3, int(Action.RotateLeft)))
    actions = np.array([Action.Done, Action.RotateLeft, Action.RotateLeft])
    _, reward, *_, infos = env.step(actions)
    assert (reward[1:] == 0).all()
    assert [("final_info" in info, "episode" in info) for info in infos] == [
        (True, True), (False, False), (False, False),
    ]  # fmt: skip
    assert infos[0]["episode"]["l"] == 2
