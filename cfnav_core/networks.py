"""Policy and predictor as one step function, on ONNX Runtime or torch, recurrent state explicit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from cfnav_core.actions import NUM_ACTIONS
from cfnav_core.bundle import BundleError, BundleHead
from cfnav_core.onnx_session import open_session

if TYPE_CHECKING:
    from cfnav_core.collision_predictor import CollisionPredictor
    from cfnav_core.models import NavModel


@dataclass
class AgentState:
    """What N agents remember between steps, all float32.

    Attributes:
        h, c: [N, H]. predictor: [N, 4, H'].
        previous_action: [N, 6], one-hot of the executed action, zeros at the start.
    """

    h: np.ndarray
    c: np.ndarray
    predictor: np.ndarray
    previous_action: np.ndarray

    @classmethod
    def zeros(cls, n: int, hidden: tuple[int, int]) -> AgentState:
        """At the start of N episodes; ``hidden`` is (H, H')."""
        shapes = ((n, hidden[0]), (n, hidden[0]), (n, 4, hidden[1]), (n, NUM_ACTIONS))
        return cls(*(np.zeros(s, np.float32) for s in shapes))


class Networks(Protocol):
    """One step of N agents.

    ``step`` takes float32 features [N, F], detections [N, C, 5], goals [N, C] one-hot, the state
    (updated in place but for ``previous_action``) and p_hat [N] or None for the predictor's own;
    it returns action probabilities [N, 6] and the p_hat [N] that was given to the policy.
    """

    hidden: tuple[int, int]

    def step(
        self, features: np.ndarray, detections: np.ndarray, goals: np.ndarray, state: AgentState,
        collision_probability: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """See the class."""
        ...


class OnnxNetworks:
    """The networks of a bundle, which must have been checked by ``BundleHead.load``.

    Args:
        folder: the bundle. head: its head. threads: of ONNX Runtime.
    """

    def __init__(self, folder: Path, head: BundleHead, threads: int = 1) -> None:
        try:
            self._policy, self._predictor = (
                open_session((folder / name).read_bytes(), threads)
                for name in ("policy.onnx", "predictor.onnx")
            )
        except ValueError as error:
            raise BundleError(f"found networks in {folder} that do not load: {error}") from error
        self.hidden = head.hidden
        self._feeds = head.feeds_prediction

    def step(
        self, features: np.ndarray, detections: np.ndarray, goals: np.ndarray, state: AgentState,
        collision_probability: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """See ``Networks``."""
        p_hat = collision_probability
        if p_hat is None:
            logit, state.predictor = self._predictor.run(
                None,
                {
                    "features": features, "previous_action": state.previous_action,
                    "state": state.predictor,
                },
            )  # fmt: skip
            p_hat = 1 / (1 + np.exp(-logit[:, 0]))
        fed = p_hat if self._feeds else np.zeros_like(p_hat)
        logits, _, state.h, state.c = self._policy.run(
            None,
            {
                "features": features, "detections": detections, "goal": goals,
                "previous_action": state.previous_action, "h": state.h, "c": state.c,
                "collision_probability": fed[:, None].astype(np.float32),
            },
        )  # fmt: skip
        return _softmax(logits), p_hat.astype(np.float32)


class TorchNetworks:
    """The same over torch modules, for validation during training and for comparison."""

    def __init__(self, model: NavModel, predictor: CollisionPredictor, feeds: bool) -> None:
        self.model, self.predictor, self._feeds = model, predictor, feeds
        self.hidden = (model.hidden, predictor.hidden)

    def step(
        self, features: np.ndarray, detections: np.ndarray, goals: np.ndarray, state: AgentState,
        collision_probability: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """See ``Networks``."""
        import torch

        t = torch.from_numpy
        with torch.no_grad():
            p_hat = collision_probability
            if p_hat is None:
                logit, memory = self.predictor(
                    t(features), t(state.previous_action), t(state.predictor)
                )
                state.predictor, p_hat = memory.numpy(), torch.sigmoid(logit[:, 0]).numpy()
            fed = p_hat if self._feeds else np.zeros_like(p_hat)
            logits, _, h, c = self.model(
                t(features), t(detections), t(goals), t(state.previous_action),
                t(fed[:, None].astype(np.float32)), t(state.h), t(state.c),
            )  # fmt: skip
        state.h, state.c = h.numpy(), c.numpy()
        return _softmax(logits.numpy()), p_hat.astype(np.float32)


def _softmax(logits: np.ndarray) -> np.ndarray:
    e = np.exp(logits - logits.max(1, keepdims=True))
    return (e / e.sum(1, keepdims=True)).astype(np.float32)
