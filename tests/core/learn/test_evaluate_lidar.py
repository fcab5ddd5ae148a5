"""What the LiDAR does in offline episodes: its probability for p_hat, its veto."""

from __future__ import annotations

import numpy as np
import pytest

from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, Trace, run_episodes
from cfnav_core.policy.networks import AgentState
from cfnav_core.scenes.scene import LIDAR, SceneError
from cfnav_core.scenes.select import lidar_of
from cfnav_core.task.actions import Action
from cfnav_core.task.limits import VETO_PROBABILITY
from cfnav_core.task.rooms import room_folder
from tests.core.worlds import hall


class Pusher:
    """Networks that always go ahead, and write down the p_hat that they were given."""

    def __init__(self) -> None:
        self.given: list[np.ndarray] = []
        self.own = 0.0

    def zero_state(self, n: int) -> AgentState:
        return AgentState({}, np.zeros((n, 1), np.float32), np.zeros((n, 6), np.float32))

    def predict(self, sight, state):
        return np.full(len(sight.goal), self.own, np.float32)

    def step(self, sight, state, collision_probability):
        self.given.append(collision_probability)
        pi = np.zeros((len(sight.goal), 6), np.float32)
        pi[:, Action.MoveAhead] = 1
        return pi


@pytest.fixture
def bank() -> SceneBank:
    return SceneBank([hall()])


def test_a_veto_forbids_what_the_lidar_expects_to_collide(bank: SceneBank) -> None:
    episodes = Episodes.draw(bank, 20, 0)
    truth = bank.collided.astype(np.float32)
    pushed = run_episodes(Pusher(), bank, episodes)
    vetoed = run_episodes(Pusher(), bank, episodes, lidar=truth, veto=True)
    assert all(r.collisions > 50 for r in pushed)
    assert all(r.collisions == 0 for r in vetoed)
    assert [r.path_length for r in vetoed] == [r.path_length for r in pushed]


def test_a_veto_also_stops_what_would_have_been_free(bank: SceneBank) -> None:
    episodes = Episodes.draw(bank, 20, 0)
    afraid = np.full(len(bank.collided), VETO_PROBABILITY, np.float32)
    trace: list[Trace] = []
    results = run_episodes(Pusher(), bank, episodes, lidar=afraid, veto=True, trace=trace)
    assert all((step.states == episodes.states).all() for step in trace)
    assert all(r.collisions == 0 for r in results)
    calm = np.nextafter(afraid, 0)
    assert any(r.collisions for r in run_episodes(Pusher(), bank, episodes, lidar=calm, veto=True))


def test_what_was_met_is_not_met_again_under_the_veto(bank: SceneBank) -> None:
    """A LiDAR that sees nothing: the first touch is one, and the veto keeps from a second."""
    episodes = Episodes.draw(bank, 20, 0)
    blind = np.zeros(len(bank.collided), np.float32)
    results = run_episodes(Pusher(), bank, episodes, lidar=blind, veto=True)
    assert {r.collisions for r in results} == {1}


class Wanderer(Pusher):
    """Draws its actions."""

    def step(self, sight, state, collision_probability):
        pi = super().step(sight, state, collision_probability)
        return (np.full_like(pi, 1 / 5) * (np.arange(6) != Action.Done)).astype(np.float32)


def test_a_way_that_an_episode_met_is_told_from_its_place_and_heading_at_any_tilt() -> None:
    bank = SceneBank([hall(), hall(4, 4, name="bedroom:3")])
    episodes, trace = Episodes.draw(bank, 30, 0), list[Trace]()
    lidar = np.zeros(len(bank.collided), np.float32)
    run_episodes(Wanderer(), bank, episodes, sample_seed=0, p_hat="lidar", lidar=lidar, trace=trace)
    place = np.concatenate([[f"{k} {p}" for p in s.position] for k, s in enumerate(bank.scenes)])
    heading = np.concatenate([s.heading for s in bank.scenes])
    met: set[tuple[int, str, int]] = set()
    tilts = set()
    for step in trace:
        rows = zip(step.episodes, step.states, step.actions, step.p_hat, strict=True)
        for episode, state, action, p_hat in rows:
            way = episode, place[state], heading[state]
            assert p_hat == (way in met)
            if p_hat:
                tilts.add(state % 2)
            if action == Action.MoveAhead and bank.collided[state]:
                met.add(way)
    assert len(tilts) == 2


def test_the_policy_is_given_what_the_lidar_says_where_it_is(bank: SceneBank) -> None:
    episodes, networks, trace = Episodes.draw(bank, 20, 0), Pusher(), list[Trace]()
    lidar = np.random.default_rng(0).random(len(bank.collided)).astype(np.float32)
    run_episodes(networks, bank, episodes, p_hat="lidar", lidar=lidar, trace=trace)
    assert len(networks.given) == len(trace)
    for given, step in zip(networks.given, trace, strict=True):
        np.testing.assert_array_equal(given[given < 1], lidar[step.states][given < 1])
    assert (networks.given[0] < 1).all()


def test_the_policy_is_given_the_larger_of_lidar_and_its_own(bank: SceneBank) -> None:
    episodes, networks, trace = Episodes.draw(bank, 20, 0), Pusher(), list[Trace]()
    networks.own = 0.5
    lidar = np.random.default_rng(0).random(len(bank.collided)).astype(np.float32)
    run_episodes(networks, bank, episodes, p_hat="both", lidar=lidar, trace=trace)
    for given, step in zip(networks.given, trace, strict=True):
        np.testing.assert_array_equal(given[given < 1], lidar[step.states].clip(0.5)[given < 1])
    assert {0.5} < set(np.concatenate(networks.given))


def test_lidar_arrays_are_those_of_the_scenes(tmp_path) -> None:
    rooms = {"kitchen:0": hall(), "bedroom:3": hall(4, 4, name="bedroom:3")}
    folders = [room_folder(tmp_path, "kitchen", 0), room_folder(tmp_path, "bedroom", 3)]
    for folder, scene, value in zip(folders, rooms.values(), (0.25, 0.75), strict=True):
        scene.save(folder)
        np.save(folder / LIDAR, np.full(scene.num_states, value, np.float32))
    found = lidar_of(tmp_path, tuple(rooms))
    sizes = [scene.num_states for scene in rooms.values()]
    np.testing.assert_array_equal(found, np.repeat(np.float32([0.25, 0.75]), sizes))
    np.save(folders[0] / LIDAR, np.zeros(5, np.float32))
    with pytest.raises(SceneError, match=r"found lidar.npy of shape \(5,\)"):
        lidar_of(tmp_path, ("kitchen:0",))
    (folders[0] / LIDAR).unlink()
    with pytest.raises(SceneError, match=r"--rooms kitchen:0, then cfnav data lidar"):
        lidar_of(tmp_path, ("kitchen:0",))
