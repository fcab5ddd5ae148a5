"""Train a little, export, and ask the same question of torch, ONNX, Policy and evaluation."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from cfnav_core.agent.agent import new_agent
from cfnav_core.files.checkpoint import CheckpointError
from cfnav_core.files.provenance import sha256
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, evaluate, paired_difference, run_episodes
from cfnav_core.models.base import Knowledge
from cfnav_core.perception.perception import BUILT_IN, OnnxPerception, PerceptionError
from cfnav_core.policy.bundle import (
    NETWORKS,
    WEIGHTS,
    BundleError,
    BundleHead,
    bundle_elsewhere,
    find_bundle,
    shipped_bundle,
)
from cfnav_core.policy.networks import AgentState, Observation, OnnxNetworks, TorchNetworks
from cfnav_core.policy.policy import Policy
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.task.actions import Action
from cfnav_core.task.limits import step_limit
from tests.core.policy.conftest import SMALL
from tests.core.worlds import hall


def test_a_shipped_bundle_is_found_elsewhere_by_its_name(tmp_path):
    for said in (None, "default", shipped_bundle()):
        assert bundle_elsewhere(said) == "default"
    assert bundle_elsewhere(tmp_path / "mine/../default") == str(tmp_path / "default")


def test_bundle_is_small_and_complete(made):
    head = BundleHead.load(made / "bundle")
    assert head.goals == ("Laptop", "Mug")
    assert head.feeds_prediction
    assert head.training["episodes"] > 300
    assert sum(f.stat().st_size for f in (made / "bundle").iterdir()) < 12e6


def test_torch_and_onnx_answer_alike(made):
    torch.manual_seed(1)
    head = BundleHead.load(made / "bundle")
    onnx = OnnxNetworks(made / "bundle", head)
    from cfnav_core.files.checkpoint import load_module, load_tensors

    tensors, _ = load_tensors(made / "run" / "best.safetensors")
    agent = new_agent(SMALL, SceneBank([hall()]).inputs, Knowledge())
    load_module(made, "model", agent.model, tensors)
    load_module(made, "predictor", agent.predictor, tensors)
    both = (onnx, TorchNetworks(agent.model, agent.predictor, feeds=True))
    rng = np.random.default_rng(0)
    states = [networks.zero_state(5) for networks in both]
    for _ in range(6):
        sight = Observation(
            rng.normal(size=(5, 256)).astype(np.float32),
            rng.random((5, 38, 5)).astype(np.float32),
            np.eye(38, dtype=np.float32)[rng.integers(38, size=5)],
            np.eye(4, dtype=np.float32)[rng.integers(4, size=5)],
        )
        previous = np.eye(6, dtype=np.float32)[rng.integers(6, size=5)]
        answers = []
        for networks, state in zip(both, states, strict=True):
            state.previous_action = previous
            p_hat = networks.predict(sight, state)
            answers.append((networks.step(sight, state, p_hat), p_hat))
        np.testing.assert_allclose(answers[0][0], answers[1][0], atol=1e-5)
        np.testing.assert_allclose(answers[0][1], answers[1][1], atol=1e-5)
        np.testing.assert_allclose(states[0].policy["h"], states[1].policy["h"], atol=1e-5)


def test_policy_answers_as_offline_evaluation_does(made):
    """Pictures through ``Policy`` one by one, and their features through the batched networks."""
    head = BundleHead.load(made / "bundle")
    networks = OnnxNetworks(made / "bundle", head)
    perception = OnnxPerception(made / "bundle" / "perception.onnx")
    policy = Policy.load(made / "bundle")
    pictures = np.random.default_rng(0).integers(0, 255, (8, 300, 300, 3), np.uint8)
    seen = perception(np.stack([BUILT_IN.preprocess(p) for p in pictures]))
    state = networks.zero_state(1)
    policy.reset("Mug")
    goal = np.eye(38, dtype=np.float32)[[21]]
    for i, picture in enumerate(pictures):
        p_hat = None if i % 2 else 0.25
        decision = policy.act(picture, p_hat)
        sight = Observation(
            seen.features[[i]].astype(np.float32), seen.detections[[i]].astype(np.float32), goal,
            np.zeros((1, 4), np.float32),
        )  # fmt: skip
        given = np.array([p_hat], np.float32) if p_hat else networks.predict(sight, state)
        pi = networks.step(sight, state, given)
        state.previous_action = np.eye(6, dtype=np.float32)[[int(decision.action)]]
        np.testing.assert_allclose(decision.probabilities, pi[0], atol=1e-4)
        assert decision.collision_probability == pytest.approx(float(given[0]), abs=1e-4)
        assert decision.action == Action(int(pi[0].argmax()))


def test_drawn_actions_follow_their_probabilities(made):
    perception = OnnxPerception(made / "bundle" / "perception.onnx")
    seen = perception.observe(np.full((300, 300, 3), 99, np.uint8))

    def decisions(seed):
        policy = Policy.load(made / "bundle", sample_seed=seed)
        policy.reset("Mug")
        return [policy.decide(seen) for _ in range(600)]

    first = decisions(1)
    actions = [decision.action for decision in first]
    assert actions == [decision.action for decision in decisions(1)]
    assert actions != [decision.action for decision in decisions(2)]
    expected = np.sum([decision.probabilities for decision in first], 0)
    assert np.bincount(actions, minlength=6) == pytest.approx(expected, abs=4 * 600**0.5 / 2)
    assert expected.max() < 400, "a distribution that tells nothing"


def test_policy_needs_a_known_goal_and_a_usable_picture(made):
    policy = Policy.load(made / "bundle")
    with pytest.raises(ValueError, match="reset"):
        policy.act(np.zeros((300, 300, 3), np.uint8))
    with pytest.raises(ValueError, match="expected one of Laptop, Mug"):
        policy.reset("Unicorn")
    policy.reset("Mug")
    with pytest.raises(PerceptionError, match="uint8"):
        policy.act(np.zeros((300, 300, 3), np.float32))
    with pytest.raises(PerceptionError, match="square"):
        policy.act(np.zeros((480, 640, 3), np.uint8))
    with pytest.raises(ValueError, match=r"expected 0\.\.1"):
        policy.act(np.zeros((300, 300, 3), np.uint8), float("nan"))


@pytest.mark.parametrize("damage", ["no_folder", "json", "network", "schema"])
def test_damaged_bundle_says_what_to_do(made, tmp_path, damage):
    folder = tmp_path / "b"
    if damage != "no_folder":
        shutil.copytree(made / "bundle", folder)
        path = folder / "bundle.json"
        if damage == "json":
            path.write_text(path.read_text()[:-20])
        elif damage == "network":
            (folder / "policy.onnx").write_bytes(b"nonsense")
        else:
            path.write_text(json.dumps(json.loads(path.read_text()) | {"schema": 99}))
    with pytest.raises(BundleError, match="cfnav export"):
        Policy.load(folder)


def change_head(folder: Path, **fields) -> None:
    path = folder / "bundle.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))


@pytest.mark.parametrize("kept", ["networks", "networks of schema 2", "weights unread"])
def test_a_bundle_whose_weights_have_no_hash_is_refused(made, tmp_path, kept):
    folder = tmp_path / "b"
    shutil.copytree(made / "bundle", folder)
    hashes = {name: sha256(folder / name) for name in NETWORKS}
    if kept == "networks":
        change_head(folder, files=hashes)
        words = "found weights.safetensors .* expected None"
    elif kept == "networks of schema 2":
        change_head(folder, files=hashes, schema=2)
        words = "found policy.onnx .* takes numbers from a file without a hash"
    else:
        other = (folder / "policy.onnx").read_bytes().replace(b"weights.saf", b"another.saf")
        (folder / "policy.onnx").write_bytes(other)
        (folder / "another.safetensors").write_bytes((folder / WEIGHTS).read_bytes())
        hashes |= {n: sha256(folder / n) for n in ("policy.onnx", WEIGHTS)}
        change_head(folder, files=hashes)
        words = "found policy.onnx .* expected from weights.safetensors alone"
    with pytest.raises(BundleError, match=words):
        Policy.load(folder)


def test_evaluation_is_frozen_and_paired(made):
    first = evaluate(made / "bundle", made / "scenes", 60, seed=5)
    again = evaluate(made / "bundle", made / "scenes", 60, seed=5)
    assert first.summary() == again.summary()
    assert paired_difference(first, again)["cf_sr_difference"] == 0
    other = evaluate(made / "bundle", made / "scenes", 60, seed=6)
    with pytest.raises(ValueError, match="different episodes"):
        paired_difference(first, other)
    summary = first.summary()
    assert {"sr", "spl", "cf_sr", "cf_spl"} <= set(summary)
    rooms = first.rooms
    assert set(rooms) == {"kitchen:0", "kitchen:1"}
    split = len(hall().next_state)
    expected = np.where(first.episodes.states >= split, "kitchen:1", "kitchen:0")
    np.testing.assert_array_equal(rooms, expected)


def test_a_failure_is_a_wrong_done_or_comes_with_the_step_limit(made):
    found = evaluate(made / "bundle", made / "scenes", 200, seed=5, sample=True)
    early = [not r.success and r.path_length < step_limit("kitchen") for r in found.results]
    assert found.wrong_done == found.summary()["wrong_done"] == pytest.approx(np.mean(early))
    assert 0 < found.wrong_done < 1 - found.summary()["sr"] + 1e-9


def test_a_checkpoint_is_evaluated_like_its_bundle(made):
    best = made / "run" / "best.safetensors"
    of_run, of_bundle = (evaluate(p, made / "scenes", 60, seed=5) for p in (best, made / "bundle"))
    first, second = of_run.summary(), of_bundle.summary()
    assert first.pop("checkpoint") == str(best)
    assert second.pop("bundle") == str(made / "bundle")
    assert first == second
    assert (first["model"], first["method"], first["seed"]) == ("compact", "ours", 0)
    assert first["training_episodes"] > 300
    assert paired_difference(of_run, of_bundle)["cf_sr_difference"] == 0
    fed = evaluate(best, made / "scenes", 60, seed=5, p_hat="true").summary()
    assert fed["episodes_identity"] == first["episodes_identity"]


def test_a_checkpoint_wants_its_perception_and_objects(made, tmp_path):
    best = made / "run" / "best.safetensors"
    hall().save(tmp_path / "other" / "kitchen_00000")
    with pytest.raises(SceneError, match="give scenes of the perception that it was trained with"):
        evaluate(best, tmp_path / "other", 10, 0)
    scene = OfflineScene.load(made / "scenes" / "kitchen_00000")
    first, second, *others = scene.objects
    turned = replace(scene, objects=(second, first, *others))
    turned.save(tmp_path / "turned" / "kitchen_00000")
    for path in (best, made / "bundle"):
        with pytest.raises(SceneError, match="38 others or in another order"):
            evaluate(path, tmp_path / "turned", 10, 0)
    with pytest.raises(CheckpointError, match="found no readable checkpoint"):
        evaluate(made / "perception.onnx", made / "scenes", 10, 0)


def test_scenes_of_another_perception_are_refused(made, tmp_path):
    hall().save(tmp_path / "kitchen_00000")
    with pytest.raises(SceneError, match=r"cfnav rooms make --perception"):
        evaluate(made / "bundle", tmp_path, 10, 0)


class Oracle:
    """Networks that follow the shortest way: knows the tables, needs no features."""

    def __init__(self, bank: SceneBank) -> None:
        rows = bank.observe(torch.arange(len(bank.scene)))[0].numpy()
        self.codes = {row.tobytes(): s for s, row in enumerate(rows)}
        self.bank = bank

    def zero_state(self, n: int) -> AgentState:
        return AgentState({}, np.zeros((n, 1), np.float32), np.zeros((n, 6), np.float32))

    def predict(self, sight, state):
        return np.zeros(len(sight.features), np.float32)

    def step(self, sight, state, collision_probability):
        pi = np.zeros((len(sight.features), 6), np.float32)
        for i, row in enumerate(sight.features):
            s, goal = self.codes[row.tobytes()], int(sight.goal[i].argmax())
            ahead = self.bank.actions_to[self.bank.next_state[s, :5], goal]
            best = Action.Done if self.bank.visible[s, goal] else int(ahead.argmin())
            pi[i, best] = 1
        return pi


def test_an_oracle_scores_one_in_everything():
    bank = SceneBank([hall()])
    results = run_episodes(Oracle(bank), bank, Episodes.draw(bank, 200, 0))
    assert all(r.cf_success and r.path_length == r.shortest_path_length for r in results)


def test_bundles_are_found_by_folder_and_by_shipped_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for nothing in (None, "", Path("default"), "default"):
        assert find_bundle(nothing) == shipped_bundle()
    assert find_bundle(tmp_path / "default") == tmp_path / "default"
    assert find_bundle("./other") == Path("other")
    assert find_bundle("..") == Path("..")
    (tmp_path / "default").mkdir()  # one's own goes first
    assert find_bundle("default") == Path("default")
