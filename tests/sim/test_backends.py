"""One policy, three ways: in evaluation, and as a bundle on ONNX Runtime and on torch.

All see the same rendered room along the same episodes. Evaluation reads the features of the room's
scene; a bundle gets the pictures themselves, as on the robot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from sim_bridge.data.dataset import Look, render_scene

from cfnav_core.learn.candidate import Candidate
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, run_episodes
from cfnav_core.learn.export import export_bundle
from cfnav_core.models.table import MODELS
from cfnav_core.policy.bundle import WEIGHTS, shipped_bundle, shipped_perception
from cfnav_core.policy.networks import AgentState, Networks, Observation
from cfnav_core.policy.policy import Decision, Policy
from cfnav_core.scenes.scene import PICTURES
from cfnav_core.task.actions import Action
from cfnav_core.task.camera import MAST
from cfnav_core.task.vocabulary import CATEGORIES
from tests.core.model_samples import save_fresh

TOLERANCE = 1e-5
"""Of probabilities: sums in another order, over an episode of carried state."""


@dataclass(frozen=True)
class Room:
    """A rendered room: its scene, and the picture of each of its states."""

    bank: SceneBank
    pictures: np.ndarray


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Room:
    folder = tmp_path_factory.mktemp("rooms")
    render_scene("bathroom", 0, folder, Look(MAST, shipped_perception(), keep_pictures=True))
    pictures = np.load(folder / "bathroom_00000" / PICTURES, mmap_mode="r")
    return Room(SceneBank.load(folder), pictures)


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Callable[[str], tuple[Path, Path]]:
    """A function: name of a model -> a checkpoint and the bundle that was exported from it."""
    root, perception = tmp_path_factory.mktemp("bundles"), shipped_perception()

    def make(name: str) -> tuple[Path, Path]:
        if name == "shipped":
            return shipped_bundle() / WEIGHTS, shipped_bundle()
        if (root / name).exists():
            return root / f"{name}.safetensors", root / name
        checkpoint = save_fresh(root / f"{name}.safetensors", name, perception, CATEGORIES)
        export_bundle(checkpoint, perception, root / name, name)
        return checkpoint, root / name

    return make


@dataclass
class Recording:
    """Networks that write down what one agent was answered, and what it did before."""

    networks: Networks
    answers: list[tuple[np.ndarray, float]] = field(default_factory=list)
    before: list[Action] = field(default_factory=list)

    def zero_state(self, n: int) -> AgentState:
        return self.networks.zero_state(n)

    def predict(self, sight: Observation, state: AgentState) -> np.ndarray:
        return self.networks.predict(sight, state)

    def step(
        self, sight: Observation, state: AgentState, collision_probability: np.ndarray
    ) -> np.ndarray:
        self.before.append(Action(int(state.previous_action[0].argmax())))
        pi = self.networks.step(sight, state, collision_probability)
        self.answers.append((pi[0], float(collision_probability[0])))
        return pi


def drive(
    policy: Policy, room: Room, episode: Episodes, actions: list[Action], p_hat: str
) -> list[Decision]:
    """Decisions from the start of an episode on, before and after each of the given actions."""
    bank, state = room.bank, int(episode.states[0])

    def decision() -> Decision:
        given = float(bank.collided[state]) if p_hat == "true" else None
        return policy.act(np.asarray(room.pictures[state]), given)

    policy.reset(bank.objects[int(episode.goals[0])], bank.scenes[0].room_type)
    decisions = [decision()]
    for action in actions:
        policy.executed(action)
        state = int(bank.next_state[state, action])
        decisions.append(decision())
    return decisions


def assert_same(answers: list[tuple[np.ndarray, float]], decisions: list[Decision]) -> None:
    assert len(answers) == len(decisions)
    for (pi, p_hat), decision in zip(answers, decisions, strict=True):
        np.testing.assert_allclose(decision.probabilities, pi, atol=TOLERANCE, rtol=0)
        assert decision.collision_probability == pytest.approx(p_hat, abs=TOLERANCE)
        assert decision.action == pi.argmax()


@pytest.mark.parametrize("p_hat", ["own", "true"])
@pytest.mark.parametrize("name", ["shipped", *sorted(MODELS)])
def test_evaluation_onnx_and_torch_answer_alike(name, p_hat, made, room):
    checkpoint, bundle = made(name)
    networks = Candidate.load(checkpoint).networks
    policies = [Policy.load(bundle, "onnx"), Policy.load(bundle, "torch")]
    drawn, answers = Episodes.draw(room.bank, 6, seed=0), []
    for i in range(6):
        episode = Episodes(drawn.states[[i]], drawn.goals[[i]])
        # the shipped policy drives as it decides; those that learnt nothing would turn for ever
        recording, seed = Recording(networks), None if name == "shipped" else i
        run_episodes(recording, room.bank, episode, seed, p_hat)
        for policy in policies:
            decisions = drive(policy, room, episode, recording.before[1:], p_hat)
            assert_same(recording.answers, decisions)
        answers += [pi for pi, _ in recording.answers]
    # what is compared says something: long enough, and not always the same answer
    assert len(answers) >= 12
    assert np.ptp(answers, axis=0).max() > 0.01
