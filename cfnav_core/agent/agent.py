"""What acts and learns in a run: policy, collision predictor and the reward they learn from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import nn

from cfnav_core.agent.collision_predictor import CollisionPredictor
from cfnav_core.agent.config import RunConfig
from cfnav_core.agent.find import find_method, find_model
from cfnav_core.agent.reward import REWARDS, Reward, RewardTables
from cfnav_core.files.checkpoint import load_module, load_tensors
from cfnav_core.models.base import Knowledge, NavModel, ObservationSpec
from cfnav_core.models.listening import Listening
from cfnav_core.task.camera import MAST, CameraSetUp


@dataclass(frozen=True)
class Agent:
    """Networks and reward.

    Attributes:
        model: pi and V. predictor: P(I_t; phi).
        reward: r_o, a row of ``REWARDS``, and the tables it reads.
    """

    model: NavModel
    predictor: CollisionPredictor
    reward: Reward
    tables: RewardTables

    def parameters(self) -> tuple[list[nn.Parameter], list[nn.Parameter]]:
        """Theta with theta_v, and phi without what it shares with them."""
        policy = list(self.model.parameters())
        held = {id(p) for p in policy}
        return policy, [p for p in self.predictor.parameters() if id(p) not in held]

    def tensors(self, knowledge: Knowledge) -> dict[str, torch.Tensor]:
        """What a checkpoint keeps of it, with the knowledge that it was made with."""
        named = {f"model.{k}": v for k, v in self.model.state_dict().items()}
        named |= {f"predictor.{k}": v for k, v in self.predictor.state_dict().items()}
        return named | {
            f"knowledge.{k}": torch.from_numpy(v) for k, v in knowledge.arrays().items()
        }


def new_agent(
    config: RunConfig,
    inputs: ObservationSpec,
    knowledge: Knowledge,
    device: torch.device | str = "cpu",
    learns: bool = True,
) -> Agent:
    """Networks with fresh weights, drawn on the CPU so that they are the same on every device.

    One that only acts, ``learns`` false, has no tables of rewards.

    Raises:
        ValueError: an unknown name, knowledge that is missing, or no encoder to share.
    """
    if config.reward is not None and config.reward not in REWARDS:
        raise ValueError(f"found reward {config.reward!r}, expected one of {', '.join(REWARDS)}")
    model = find_model(config.model)(inputs, config.size, knowledge)
    shared = find_method(config.method).shared_encoder
    predictor = CollisionPredictor(
        inputs.features, config.predictor_hidden, model.picture_encoder() if shared else None
    )
    reward = config.reward or model.reward
    if config.listening:
        model = Listening(model)
    tables = RewardTables.of(reward if learns else "", knowledge).to(torch.device(device))
    return Agent(model.to(device), predictor.to(device), REWARDS[reward], tables)


@dataclass(frozen=True)
class TrainedAgent:
    """A checkpoint of a run, ready to act.

    Attributes:
        agent: in its test phase, on the CPU.
        inputs: what its scenes offered.
        head: of the checkpoint, see ``Run.save``.
    """

    agent: Agent
    inputs: ObservationSpec
    head: dict[str, Any]

    @classmethod
    def load(cls, checkpoint: Path) -> TrainedAgent:
        """Networks with the weights and the knowledge of a checkpoint.

        Raises:
            CheckpointError: it is missing, damaged or of another network.
        """
        tensors, head = load_tensors(checkpoint)
        inputs = ObservationSpec.read(head["inputs"])
        tables = {k: v.numpy() for k, v in tensors.items() if k.startswith("knowledge.")}
        knowledge = Knowledge(**{k.removeprefix("knowledge."): v for k, v in tables.items()})
        agent = new_agent(RunConfig.read(head["config"]), inputs, knowledge, learns=False)
        load_module(checkpoint, "model", agent.model, tensors)
        load_module(checkpoint, "predictor", agent.predictor, tensors)
        agent.model.eval()
        agent.predictor.eval()
        return cls(agent, inputs, head)

    @property
    def camera(self) -> CameraSetUp | None:
        """That its scenes were seen by; None where they do not say. Once all were the mast's."""
        said = self.head.get("camera", MAST.to_json())
        return CameraSetUp.from_json(said) if said else None

    @property
    def feeds_prediction(self) -> bool:
        """Whether the policy reads p_hat after training; it gets zero otherwise."""
        return find_method(self.head["config"]["method"]).stage2.feed_prediction
