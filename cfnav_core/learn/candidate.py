"""A policy to evaluate: a bundle's networks or a checkpoint's, and what they read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cfnav_core.agent.agent import TrainedAgent
from cfnav_core.learn.env import SceneBank
from cfnav_core.models.table import MODELS
from cfnav_core.policy.bundle import PERCEPTION, BundleHead, find_bundle
from cfnav_core.policy.networks import (
    AgentState,
    Networks,
    Observation,
    OnnxNetworks,
    TorchNetworks,
)
from cfnav_core.policy.policy import eyes_of
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.detections import SIGHTINGS


class _Wider:
    """Networks that know further objects, of which the scenes have none, behind those of these.

    Args:
        networks: whose. further: how many.
    """

    def __init__(self, networks: Networks, further: int) -> None:
        self._networks, self._further = networks, further
        self.zero_state = networks.zero_state

    def predict(self, observation: Observation, state: AgentState) -> np.ndarray:
        """See ``Networks``."""
        return self._networks.predict(observation, state)

    def step(
        self, observation: Observation, state: AgentState, collision_probability: np.ndarray
    ) -> np.ndarray:
        """See ``Networks``."""
        more, seen = (0, self._further), observation.detections
        wider = replace(
            observation, detections=np.pad(seen, ((0, 0), more, (0, 0))),
            goal=np.pad(observation.goal, ((0, 0), more)),
        )  # fmt: skip
        return self._networks.step(wider, state, collision_probability)


@dataclass(frozen=True)
class Candidate:
    """A policy to evaluate.

    Attributes:
        networks: its own.
        perception: identity of what made the pictures' features that it reads.
        objects: what it reads detections of, but for names that training had nothing of.
        goals: those that it was trained to find.
        what: see ``Evaluation``.
        reads_sightings: whoever made them.
    """

    networks: Networks
    perception: str
    objects: tuple[str, ...]
    goals: tuple[str, ...]
    what: dict[str, Any]
    reads_sightings: bool

    @classmethod
    def load(cls, path: Path) -> Candidate:
        """Open a bundle, by folder or shipped name, or a checkpoint's file.

        Raises:
            BundleError: the bundle cannot be used.
            CheckpointError: the checkpoint cannot be used.
        """
        if path.is_file():
            trained = TrainedAgent.load(path)
            learnt: Networks = TorchNetworks(
                trained.agent.model, trained.agent.predictor, trained.feeds_prediction
            )
            further = len(trained.head.get("further", ()))
            if further:
                learnt = _Wider(learnt, further)
            what = {"checkpoint": str(path), **origin(trained.head)}
            inputs, made_by = trained.inputs, trained.head["perception"]
            goals, sightings = tuple(trained.head["goals"]), inputs.fields == SIGHTINGS
            objects = inputs.objects[: len(inputs.objects) - further]
            return cls(learnt, made_by, objects, goals, what, sightings)
        folder = find_bundle(path)
        head = BundleHead.load(folder)
        sightings, what = head.reads_sightings, {"bundle": str(path), **origin(head.training)}
        perception = "" if sightings else eyes_of(folder, head).identity
        networks: Networks = OnnxNetworks(folder, head)
        if head.further:
            networks = _Wider(networks, len(head.further))
        objects = head.objects[: len(head.objects) - len(head.further)]
        return cls(networks, perception, objects, head.goals, what, sightings)


def origin(head: dict[str, Any]) -> dict[str, Any]:
    """What tells the training of a checkpoint or a bundle from others, of its head."""
    config = head["config"]
    name = config["model"]
    # a bundle may be another version's
    title = MODELS[name].title if name in MODELS else name
    return {
        "model": title, "method": config["method"], "seed": config["seed"],
        "commit": head["commit"], "training_episodes": head["episodes"],
    }  # fmt: skip


def check_fits(candidate: Candidate, path: Path, bank: SceneBank, scenes: Path) -> None:
    """See that a policy can be asked in scenes.

    Raises:
        SceneError: they were made with another perception, or with other objects.
    """
    if candidate.reads_sightings and bank.inputs.fields != SIGHTINGS:
        raise SceneError(
            f"found scenes in {scenes} with {', '.join(bank.inputs.fields)}, but {path} reads "
            "sightings; make them with cfnav rooms boxes"
        )
    if not candidate.reads_sightings and bank.perception != candidate.perception:
        remedy = "give scenes of the perception that it was trained with"
        if "bundle" in candidate.what:
            folder = find_bundle(path)
            own = BundleHead.load(folder).file(folder, PERCEPTION)
            remedy = f"make them with cfnav rooms make --perception {own}"
        raise SceneError(
            f"found scenes in {scenes} made with perception {bank.perception}, but {path} has "
            f"{candidate.perception}; {remedy}"
        )
    if bank.objects != candidate.objects:
        raise SceneError(
            f"found scenes in {scenes} with {len(bank.objects)} objects, but {path} knows "
            f"{len(candidate.objects)} others or in another order; give scenes with its own"
        )
