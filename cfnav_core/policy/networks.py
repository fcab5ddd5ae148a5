"""Policy and predictor as one step function, on ONNX Runtime or torch, recurrent state explicit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from cfnav_core.perception.onnx_session import open_session
from cfnav_core.policy.bundle import WEIGHTS, BundleError, BundleHead
from cfnav_core.task.actions import NUM_ACTIONS

if TYPE_CHECKING:
    from torch import Tensor

    from cfnav_core.agent.collision_predictor import CollisionPredictor
    from cfnav_core.models.base import NavModel

Backend = Literal["onnx", "torch"]

SEEN = ("features", "detections", "goal", "room", "previous_action", "collision_probability")
"""What a policy may read (``models.base.ModelInput``); what else policy.onnx takes is memory."""


@dataclass
class AgentState:
    """What N agents remember between steps, all float32.

    Attributes:
        policy: by name, [N, ...] each.
        predictor: [N, ...].
        previous_action: [N, 6], one-hot of the executed action, zeros at the start.
    """

    policy: dict[str, np.ndarray]
    predictor: np.ndarray
    previous_action: np.ndarray

    def rows(self, chosen: np.ndarray) -> AgentState:
        """The chosen agents (bool or int [N]), copied."""
        return AgentState(
            {k: v[chosen] for k, v in self.policy.items()}, self.predictor[chosen],
            self.previous_action[chosen],
        )  # fmt: skip


@dataclass(frozen=True)
class Observation:
    """What N agents see, float32.

    Attributes:
        features: [N, *F]. detections: [N, C, D].
        goal: [N, C], one-hot. room: [N, 4], one-hot.
    """

    features: np.ndarray
    detections: np.ndarray
    goal: np.ndarray
    room: np.ndarray


class Networks(Protocol):
    """One step of N agents; ``zero_state`` is theirs at the start of an episode."""

    def zero_state(self, n: int) -> AgentState:
        """Of N agents."""
        ...

    def predict(self, observation: Observation, state: AgentState) -> np.ndarray:
        """The predictor's own p_hat, float32 [N].

        Args:
            observation: what is seen.
            state: what the predictor remembers is updated in place; nothing else is read but
                ``previous_action``.
        """
        ...

    def step(
        self, observation: Observation, state: AgentState, collision_probability: np.ndarray
    ) -> np.ndarray:
        """Decide.

        Args:
            observation: what is seen.
            state: updated in place but for ``previous_action``; what the predictor remembers stays
                as it is.
            collision_probability: p_hat, float32 [N]; a policy that reads none is given zero.

        Returns:
            Action probabilities, float32 [N, 6].
        """
        ...


def sampled(pi: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw actions.

    Args:
        pi: float32 [N, 6], probabilities.
        rng: gives N numbers.

    Returns:
        int64 [N].
    """
    return (pi.cumsum(1) < rng.random((len(pi), 1))).sum(1).clip(max=NUM_ACTIONS - 1)


def open_networks(folder: Path, head: BundleHead, backend: Backend = "onnx") -> Networks:
    """Policy and predictor of a bundle, which must have been checked by ``BundleHead.load``.

    Raises:
        BundleError: they do not load, or torch is asked for and something it needs is not there.
        ValueError: another back end.
    """
    if backend == "onnx":
        return OnnxNetworks(folder, head)
    if backend == "torch":
        return TorchNetworks.load(folder, head)
    raise ValueError(f"found back end {backend!r}, expected onnx or torch")


def reads_room(folder: Path) -> bool:
    """Whether the policy of a bundle, checked by ``BundleHead.load``, reads the type of room."""
    return "room" in {given.name for given in open_session(folder / "policy.onnx").get_inputs()}


class OnnxNetworks:
    """The networks of a bundle, which must have been checked by ``BundleHead.load``.

    Args:
        folder: the bundle. head: its head. threads: of ONNX Runtime.
    """

    def __init__(self, folder: Path, head: BundleHead, threads: int = 1) -> None:
        try:
            self._policy, self._predictor = (
                open_session(folder / name, threads) for name in ("policy.onnx", "predictor.onnx")
            )
        except ValueError as error:
            raise BundleError(f"found networks in {folder} that do not load: {error}") from error
        self._feeds = head.feeds_prediction
        shapes = {i.name: tuple(i.shape[1:]) for i in self._policy.get_inputs()}
        self._reads = [name for name in shapes if name in SEEN]
        self._memory = {name: shape for name, shape in shapes.items() if name not in SEEN}
        inputs = {i.name: tuple(i.shape[1:]) for i in self._predictor.get_inputs()}
        self._predictor_memory = inputs["state"]

    def zero_state(self, n: int) -> AgentState:
        """See ``Networks``."""
        return AgentState(
            {k: np.zeros((n, *shape), np.float32) for k, shape in self._memory.items()},
            np.zeros((n, *self._predictor_memory), np.float32),
            np.zeros((n, NUM_ACTIONS), np.float32),
        )

    def predict(self, observation: Observation, state: AgentState) -> np.ndarray:
        """See ``Networks``."""
        logit, state.predictor = self._predictor.run(
            None,
            {
                "features": observation.features, "previous_action": state.previous_action,
                "state": state.predictor,
            },
        )  # fmt: skip
        return 1 / (1 + np.exp(-logit[:, 0]))

    def step(
        self, observation: Observation, state: AgentState, collision_probability: np.ndarray
    ) -> np.ndarray:
        """See ``Networks``."""
        seen = {
            **vars(observation), "previous_action": state.previous_action,
            "collision_probability": _read(collision_probability, self._feeds),
        }  # fmt: skip
        names = ["logits", *(f"next_{name}" for name in self._memory)]
        logits, *following = self._policy.run(
            names, {name: seen[name] for name in self._reads} | state.policy
        )
        state.policy = dict(zip(self._memory, following, strict=True))
        return _softmax(logits)


class TorchNetworks:
    """The same over torch modules: in training's validation, and as the other back end."""

    def __init__(self, model: NavModel, predictor: CollisionPredictor, feeds: bool) -> None:
        self._model, self._predictor, self._feeds = model, predictor, feeds

    @classmethod
    def load(cls, folder: Path, head: BundleHead) -> TorchNetworks:
        """The models themselves with the weights of a bundle, on the CPU.

        Raises:
            BundleError: the bundle has no weights that can be used, or torch is not installed.
        """
        if WEIGHTS not in head.files:
            raise BundleError(
                f"found no {WEIGHTS} in {folder}, which back end torch reads; export the bundle "
                "again with cfnav export, or choose back end onnx"
            )
        try:
            # a robot has no torch, so it is imported only where it was asked for
            from cfnav_core.agent.agent import TrainedAgent

            trained = TrainedAgent.load(folder / WEIGHTS)
        except ImportError as error:
            raise BundleError(
                f"found no {error.name}, which back end torch needs; install it with pip install "
                "'cfnav[train]', or choose back end onnx"
            ) from error
        except ValueError as error:
            raise BundleError(f"found weights in {folder} that do not load: {error}") from error
        return cls(trained.agent.model, trained.agent.predictor, head.feeds_prediction)

    def zero_state(self, n: int) -> AgentState:
        """See ``Networks``."""
        return AgentState(
            {k: v.cpu().numpy() for k, v in self._model.zero_state(n).items()},
            np.zeros((n, *self._predictor.state_shape), np.float32),
            np.zeros((n, NUM_ACTIONS), np.float32),
        )

    def predict(self, observation: Observation, state: AgentState) -> np.ndarray:
        """See ``Networks``."""
        import torch

        # an encoder that it shares with the model is in the model's phase
        with self._test_phase(), torch.no_grad():
            logit, memory = self._predictor(
                self._tensor(observation.features), self._tensor(state.previous_action),
                self._tensor(state.predictor),
            )  # fmt: skip
            state.predictor = memory.cpu().numpy()
            return torch.sigmoid(logit[:, 0]).cpu().numpy()

    @contextmanager
    def _test_phase(self) -> Iterator[None]:
        was_training = self._model.training
        self._model.eval()
        try:
            yield
        finally:
            self._model.train(was_training)

    def _tensor(self, array: np.ndarray) -> Tensor:
        import torch

        return torch.from_numpy(array).to(next(self._model.parameters()).device)

    def step(
        self, observation: Observation, state: AgentState, collision_probability: np.ndarray
    ) -> np.ndarray:
        """See ``Networks``; the model answers in its test phase."""
        import torch

        from cfnav_core.models.base import ModelInput

        t = self._tensor
        with self._test_phase(), torch.no_grad():
            seen = ModelInput(
                **{k: t(v) for k, v in vars(observation).items()},
                previous_action=t(state.previous_action),
                collision_probability=t(_read(collision_probability, self._feeds)),
            )
            logits, _, following = self._model(seen, {k: t(v) for k, v in state.policy.items()})
        state.policy = {k: v.cpu().numpy() for k, v in following.items()}
        return _softmax(logits.cpu().numpy())


def _read(p_hat: np.ndarray, feeds: bool) -> np.ndarray:
    """What the policy reads of p_hat, float32 [N, 1]."""
    return (p_hat if feeds else np.zeros_like(p_hat))[:, None].astype(np.float32)


def _softmax(logits: np.ndarray) -> np.ndarray:
    e = np.exp(logits - logits.max(1, keepdims=True))
    return (e / e.sum(1, keepdims=True)).astype(np.float32)
