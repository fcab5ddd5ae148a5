"""Random knowledge and random views for the tests of the models."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import one_hot

from cfnav_core.agent.agent import new_agent
from cfnav_core.agent.config import ModelName, RunConfig
from cfnav_core.files.checkpoint import save_tensors
from cfnav_core.models.base import Knowledge, ModelInput, NavModel, ObservationSpec
from cfnav_core.models.parts.reading import columns_of
from cfnav_core.models.size import ModelSize
from cfnav_core.perception.perception import OnnxPerception
from cfnav_core.policy.bundle import PERCEPTION, SHIPPED, BundleHead
from cfnav_core.task.actions import NUM_ACTIONS
from cfnav_core.task.detections import BOXES, HULLS, SCORES, SIGHTINGS
from cfnav_core.task.vocabulary import CATEGORIES, DATA1_TARGETS, ROOM_TYPES

ROOMS = len(ROOM_TYPES)
SMALL = ModelSize(hidden=16, channels=4)
BUILT_IN = ObservationSpec((256,), SCORES, CATEGORIES)
SIGHTED = ObservationSpec((256,), SIGHTINGS, CATEGORIES)
DATA1 = ObservationSpec((512, 7, 7), BOXES, DATA1_TARGETS)
DATA1_CLIP = ObservationSpec((2048, 7, 7), BOXES, DATA1_TARGETS)
DATA2 = ObservationSpec((512, 7, 7), HULLS, tuple(f"Object{i}" for i in range(101)))


def older_perception() -> Path:
    """The network of the bundles of the paper's tables, which gives no boxes."""
    folder = SHIPPED / "tdanet"
    return BundleHead.load(folder).file(folder, PERCEPTION)


def knowledge(objects: int, word: int = 12, text: int = 10, zones: int = 8) -> Knowledge:
    """All tables for so many objects, the same at every call."""
    rng = np.random.default_rng(1)

    def table(*shape: int) -> np.ndarray:
        return rng.random(shape).astype(np.float32)

    edges, layout = (
        0.05 + 0.1 * table(ROOMS, zones, zones),
        np.ceil(99 * table(ROOMS, objects, objects)),
    )
    for room in range(ROOMS):
        np.fill_diagonal(edges[room], 1)
        np.fill_diagonal(layout[room], 0)
    return Knowledge(
        words=table(objects, word) - 0.5, text=table(objects, text) - 0.5,
        zones=table(ROOMS, zones, objects), zone_edges=edges, layout=layout,
        adjacency=(table(objects, objects) > 0.7).astype(np.float32),
        parents=table(ROOMS, objects, objects),
    )  # fmt: skip


def views(inputs: ObservationSpec, batch: int, seed: int = 0) -> ModelInput:
    """Random views; about half of the objects are seen."""
    g = torch.Generator().manual_seed(seed)
    objects, columns = len(inputs.objects), columns_of(inputs.fields)
    detections = torch.rand(batch, objects, inputs.detections, generator=g)
    there = torch.rand(batch, objects, 1, generator=g) > 0.5
    detections = torch.where(there, detections, 0)
    detections[:, :, columns.confidence] = there[:, :, 0] * (
        0.6 + 0.4 * detections[:, :, columns.confidence]
    )

    def pick(n: int) -> torch.Tensor:
        return one_hot(torch.randint(n, (batch,), generator=g), n).float()

    return ModelInput(
        torch.rand(batch, *inputs.features, generator=g), detections, pick(objects), pick(ROOMS),
        torch.softmax(torch.randn(batch, NUM_ACTIONS, generator=g), 1),
        torch.rand(batch, 1, generator=g),
    )  # fmt: skip


def rows_of(seen: ModelInput, which: slice) -> ModelInput:
    """Some of the episodes."""
    return ModelInput(*(value[which] for value in vars(seen).values()))


def outspoken(model: NavModel) -> NavModel:
    """Let a fresh policy answer by what it sees; it gives all actions nearly the same chance."""
    with torch.no_grad():
        for name, weight in model.named_parameters():
            if name.endswith("actor.weight"):
                weight.normal_(std=2)
    return model


def save_fresh(
    path: Path, model: ModelName, perception: Path | None, goals: tuple[str, ...],
    known: Knowledge | None = None,
) -> Path:  # fmt: skip
    """A checkpoint, as a run would write it, of a small agent that has learnt nothing.

    Without perception it is one that reads sightings.
    """
    inputs = BUILT_IN if perception else SIGHTED
    seen_by = OnnxPerception(perception).identity if perception else "boxes of a test"
    config = RunConfig(model=model, size=SMALL, predictor_hidden=16)
    known = known or knowledge(len(CATEGORIES))
    torch.manual_seed(0)
    agent = new_agent(config, inputs, known)
    outspoken(agent.model)
    with torch.no_grad():
        agent.predictor.head.weight *= 10
    save_tensors(path, agent.tensors(known), {
        "config": asdict(config), "episodes": 0, "steps": 0, "best": -1.0, "goals": goals,
        "perception": seen_by, "inputs": asdict(inputs),
        "commit": "none", "train_rooms": ("kitchen:0",), "validation_rooms": ("kitchen:1",),
    })  # fmt: skip
    return path
