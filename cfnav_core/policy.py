"""``Policy``: all a robot needs. The same object answers in bags, in tests and on the robot.

Back end onnx runs on ONNX Runtime alone. Back end torch runs the models themselves, as training
and evaluation do. Perception is ONNX Runtime's in both: it made the features of the scenes that
every policy was trained on, and they are rounded to float16, so that another's last digits could
become other features.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.actions import NUM_ACTIONS, Action
from cfnav_core.bundle import BundleError, BundleHead, find_bundle
from cfnav_core.goals import refusal
from cfnav_core.networks import AgentState, Backend, Networks, Sight, open_networks, sampled
from cfnav_core.perception import Observation, Perception, PerceptionError
from cfnav_core.vocabulary import ROOM_TYPES

__all__ = ["BundleError", "Decision", "Policy"]


NO_ROOM = np.zeros((1, len(ROOM_TYPES)), np.float32)


@dataclass(frozen=True)
class Decision:
    """One answer.

    Attributes:
        action: what to do: the most probable action, or a drawn one.
        probabilities: float32 [6], pi(a | I, g, p_hat).
        collision_probability: p_hat that the policy was given (or would have been, when its
            method feeds none).
        detection_score: 0..1, how surely the goal is seen in this picture.
    """

    action: Action
    probabilities: np.ndarray
    collision_probability: float
    detection_score: float


class Policy:
    """A bundle at work on one robot. Make it with ``Policy.load``.

    Attributes:
        name: of the bundle.
        goals: objects that it was trained to find; ``admits`` knows whether it takes others.
        perception: identity of its perception network; what policies of the same one ``look`` at,
            each of them can ``decide`` on.
    """

    def __init__(
        self,
        head: BundleHead,
        perception: Perception,
        networks: Networks,
        sample_seed: int | None = None,
    ) -> None:
        self.name, self.perception = head.name, perception.identity
        self.goals = head.goals
        self._head = head
        self._objects = head.objects
        self._perception, self._networks = perception, networks
        self._rng = None if sample_seed is None else np.random.default_rng(sample_seed)
        self._goal, self._room = -1, NO_ROOM
        self._state = networks.zero_state(1)
        self._watching = networks.zero_state(1).predictor

    @classmethod
    def load(
        cls,
        bundle: Path | str | None = None,
        backend: Backend = "onnx",
        sample_seed: int | None = None,
    ) -> Policy:
        """Load a bundle, the default when None.

        Args:
            bundle: its folder, or the name of a shipped one.
            backend: what runs policy and predictor, see the module.
            sample_seed: draw actions with this seed, other ones in each episode; argmax when None.

        Raises:
            BundleError: missing, damaged, of another version, or without what the back end needs.
            ValueError: another back end.
        """
        folder = find_bundle(bundle)
        head = BundleHead.load(folder)
        try:
            perception = Perception(folder / "perception.onnx")
        except PerceptionError as error:
            raise BundleError(str(error)) from error
        return cls(head, perception, open_networks(folder, head, backend), sample_seed)

    def admits(self, goal: str) -> str:
        """Why ``reset`` would refuse a goal, as one sentence; "" when it takes it.

        It takes what it was trained to find and, when its model allows that, all else that its
        perception detects; never a word for something that its perception cannot detect.
        """
        return refusal(goal, self._head)

    def reset(self, goal: str, room_type: str | None = None) -> None:
        """Begin an episode.

        Args:
            goal: one that it ``admits``.
            room_type: one of ``ROOM_TYPES``; only models that look it up need it.

        Raises:
            ValueError: a goal or room type that it does not take.
        """
        if refused := self.admits(goal):
            raise ValueError(refused)
        if room_type not in (None, *ROOM_TYPES):
            raise ValueError(f"found room type {room_type!r}, expected {', '.join(ROOM_TYPES)}")
        self._room = NO_ROOM.copy()
        if room_type is not None:
            self._room[0, ROOM_TYPES.index(room_type)] = 1
        self._goal = self._objects.index(goal)
        self._state = self._networks.zero_state(1)
        self._watching = self._networks.zero_state(1).predictor

    def act(
        self, rgb: np.ndarray, collision_probability: float | None = None, own_too: bool = False
    ) -> Decision:
        """Decide on one picture.

        Args:
            rgb: uint8 [H, W, 3], square.
            collision_probability: p_hat from elsewhere, 0..1; the bundle's own RGB predictor
                supplies it when None.
            own_too: its own counts where it is larger.

        Raises:
            PerceptionError: the picture cannot be used.
            ValueError: no goal was set, or the probability is outside 0..1.
        """
        self._check(collision_probability)
        return self.decide(self.look(rgb), collision_probability, own_too)

    def look(self, rgb: np.ndarray) -> Observation:
        """Observe one picture, uint8 [H, W, 3], square; remembers nothing.

        Raises:
            PerceptionError: the picture cannot be used.
        """
        return self._perception.observe(rgb)

    def decide(
        self, seen: Observation, collision_probability: float | None = None, own_too: bool = False
    ) -> Decision:
        """Decide on what one picture shows, see ``act``.

        Args:
            seen: one picture of a policy with the same perception.
            collision_probability: as for ``act``. own_too: as for ``act``.

        Raises:
            ValueError: as for ``act``.
        """
        self._check(collision_probability)
        given = None
        if collision_probability is not None:
            given = np.array([collision_probability], np.float32)
        sight = self._sight(seen)
        if given is not None and own_too:
            given = np.maximum(given, self._networks.predict(sight, self._state))
        pi, p_hat = self._networks.step(sight, self._state, given)
        action = Action(int(pi[0].argmax() if self._rng is None else sampled(pi, self._rng)[0]))
        self.executed(action)
        return Decision(action, pi[0], float(p_hat[0]), float(seen.detections[0, self._goal, 0]))

    def predict_collision(self, seen: Observation) -> float:
        """What the bundle's own RGB predictor says, whoever supplies p_hat to ``act``.

        It has a memory of its own for this: call it once a picture, before the decision. No answer
        of ``act`` depends on it.

        Args:
            seen: one picture of a policy with the same perception.

        Raises:
            ValueError: no goal was set.
        """
        self._check(None)
        state = AgentState({}, self._watching, self._state.previous_action)
        p_hat = self._networks.predict(self._sight(seen), state)
        self._watching = state.predictor
        return float(p_hat[0])

    def _check(self, collision_probability: float | None) -> None:
        if self._goal < 0:
            raise ValueError("found no goal; call reset(goal) before act")
        if collision_probability is not None and not 0.0 <= collision_probability <= 1.0:
            raise ValueError(f"found collision probability {collision_probability}, expected 0..1")

    def _sight(self, seen: Observation) -> Sight:
        goal = np.eye(len(self._objects), dtype=np.float32)[[self._goal]]
        features, detections = (a.astype(np.float32) for a in (seen.features, seen.detections))
        return Sight(features, detections, goal, self._room)

    def executed(self, action: Action) -> None:
        """Say that another action than the last answer was executed (replay, veto)."""
        self._state.previous_action = np.eye(NUM_ACTIONS, dtype=np.float32)[[int(action)]]
