"""``Policy``: all a robot needs. The same object answers in bags, in tests and on the robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.actions import NUM_ACTIONS, Action
from cfnav_core.bundle import BundleError, BundleHead, shipped_bundle
from cfnav_core.networks import AgentState, OnnxNetworks
from cfnav_core.perception import Perception, PerceptionError
from cfnav_core.vocabulary import CATEGORIES, CATEGORY_ID

__all__ = ["BundleError", "Decision", "Policy"]


@dataclass(frozen=True)
class Decision:
    """One answer.

    Attributes:
        action: what to do: the most probable action.
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
    """A bundle at work on one robot. Make it with ``Policy.load``."""

    def __init__(self, head: BundleHead, perception: Perception, networks: OnnxNetworks) -> None:
        self.name = head.name
        self.goals = head.goals
        self._perception, self._networks = perception, networks
        self._goal = -1
        self._state = AgentState.zeros(1, networks.hidden)

    @classmethod
    def load(cls, bundle: Path | str | None = None) -> Policy:
        """Load a bundle, the shipped one when None.

        Raises:
            BundleError: missing, damaged or of another version.
        """
        folder = Path(bundle) if bundle else shipped_bundle()
        head = BundleHead.load(folder)
        try:
            perception = Perception(folder / "perception.onnx")
        except PerceptionError as error:
            raise BundleError(str(error)) from error
        return cls(head, perception, OnnxNetworks(folder, head))

    def reset(self, goal: str, room_type: str | None = None) -> None:
        """Begin an episode.

        Args:
            goal: one of ``goals``.
            room_type: ignored by models that do not use it.

        Raises:
            ValueError: unknown goal.
        """
        del room_type
        if goal not in self.goals:
            raise ValueError(f"found goal {goal!r}, expected one of {', '.join(self.goals)}")
        self._goal = CATEGORY_ID[goal]
        self._state = AgentState.zeros(1, self._networks.hidden)

    def act(self, rgb: np.ndarray, collision_probability: float | None = None) -> Decision:
        """Decide on one picture.

        Args:
            rgb: uint8 [H, W, 3], square.
            collision_probability: p_hat from elsewhere, 0..1; the bundle's own RGB predictor
                supplies it when None.

        Raises:
            PerceptionError: the picture cannot be used.
            ValueError: no goal was set, or the probability is outside 0..1.
        """
        if self._goal < 0:
            raise ValueError("found no goal; call reset(goal) before act")
        given = None
        if collision_probability is not None:
            if not 0.0 <= collision_probability <= 1.0:
                raise ValueError(
                    f"found collision probability {collision_probability}, expected 0..1"
                )
            given = np.array([collision_probability], np.float32)
        seen = self._perception.observe(rgb)
        goal = np.eye(len(CATEGORIES), dtype=np.float32)[[self._goal]]
        pi, p_hat = self._networks.step(
            seen.features.astype(np.float32), seen.detections.astype(np.float32), goal,
            self._state, given,
        )  # fmt: skip
        action = Action(int(pi[0].argmax()))
        self.executed(action)
        return Decision(action, pi[0], float(p_hat[0]), float(seen.detections[0, self._goal, 0]))

    def executed(self, action: Action) -> None:
        """Say that another action than the last answer was executed (replay, veto)."""
        self._state.previous_action = np.eye(NUM_ACTIONS, dtype=np.float32)[[int(action)]]
