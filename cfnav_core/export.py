"""A trained checkpoint and a perception network become a bundle."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import onnx
import torch
from onnx.external_data_helper import set_external_data
from torch import Tensor, nn

from cfnav_core.actions import NUM_ACTIONS
from cfnav_core.agent import Agent, TrainedAgent
from cfnav_core.bundle import NETWORKS, WEIGHTS, BundleHead, file_hash
from cfnav_core.checkpoint import load_tensors, save_tensors
from cfnav_core.model_card import model_card
from cfnav_core.models import MODELS, Inputs, NavModel, Seen
from cfnav_core.networks import SEEN
from cfnav_core.perception import Perception
from cfnav_core.vocabulary import ROOM_TYPES
from cfnav_core.whole import whole, writing

WEIGHTS_OF = ("model", "predictor", "knowledge")
"""What of a checkpoint a bundle keeps."""

TRAINING_FIELDS = (
    "config", "commit", "episodes", "steps", "perception", "train_rooms", "validation_rooms",
)  # fmt: skip


def export_bundle(
    checkpoint: Path, perception: Path, out: Path, name: str,
    metrics: dict[str, Any] | None = None, commands: str = "",
) -> BundleHead:  # fmt: skip
    """Write a bundle; ``out`` appears only when complete.

    ``metrics`` and where the ``commands`` stand that made it are kept for its card.

    Raises:
        CheckpointError: the checkpoint is damaged or of another network.
        PerceptionError: the perception network is unusable.
        ValueError: another perception than it was trained with, or ``out`` is no bundle.
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    if out.exists() and not (out / "bundle.json").exists():
        raise ValueError(f"found {out}, which is no bundle; give a new folder or one to replace")
    trained = TrainedAgent.load(checkpoint)
    head, inputs = trained.head, trained.inputs
    identity = Perception(perception).identity
    if identity != head["perception"]:
        raise ValueError(
            f"found perception {identity} at {perception}, but {checkpoint} was trained with "
            f"{head['perception']}; give that one"
        )
    with writing(out), whole(out) as partial:
        partial.mkdir(parents=True)
        shutil.copyfile(perception, partial / "perception.onnx")
        export_networks(trained.agent, inputs, partial)
        _export_weights(checkpoint, partial)
        bundle = BundleHead(
            name, head["config"]["method"], trained.feeds_prediction, inputs.objects,
            tuple(head["goals"]), {n: file_hash(partial / n) for n in (*NETWORKS, WEIGHTS)},
            {k: head[k] for k in TRAINING_FIELDS} | ({"commands": commands} if commands else {}),
            metrics or {},
            MODELS[head["config"]["model"]].zero_shot,
        )  # fmt: skip
        bundle.save(partial)
        (partial / "MODEL_CARD.md").write_text(model_card(bundle))
    return bundle


class _Flat(nn.Module):
    """A model whose inputs and outputs have names instead of places in dataclasses."""

    def __init__(self, model: NavModel) -> None:
        super().__init__()
        self.model = model

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        """Fields of ``Seen``, then memory; logits, value, then the next memory."""
        seen, memory = tensors[: len(SEEN)], tensors[len(SEEN) :]
        state = dict(zip(self.model.state_shapes, memory, strict=True))
        logits, value, following = self.model(Seen(*seen), state)
        return logits, value, *(following[name] for name in state)


def export_networks(agent: Agent, inputs: Inputs, folder: Path) -> None:
    """Write ``policy.onnx`` and ``predictor.onnx`` for any number of agents."""
    n, objects = 2, len(inputs.objects)
    memory = {k: (n, *shape) for k, shape in agent.model.state_shapes.items()}
    seen = {
        "features": (n, *inputs.features), "detections": (n, objects, inputs.detections),
        "goal": (n, objects), "room": (n, len(ROOM_TYPES)), "previous_action": (n, NUM_ACTIONS),
        "collision_probability": (n, 1),
    }  # fmt: skip
    outputs = ["logits", "value", *(f"next_{name}" for name in memory)]
    _export(_Flat(agent.model), seen | memory, outputs, folder / "policy.onnx")
    seen = {
        "features": (n, *inputs.features), "previous_action": (n, NUM_ACTIONS),
        "state": (n, *agent.predictor.state_shape),
    }  # fmt: skip
    _export(agent.predictor, seen, ["logit", "next_state"], folder / "predictor.onnx")


def _export(
    module: torch.nn.Module, inputs: dict[str, tuple[int, ...]], outputs: list[str], path: Path
) -> None:
    torch.onnx.export(
        module.eval(), tuple(torch.zeros(s) for s in inputs.values()), str(path), dynamo=False,
        opset_version=17, input_names=list(inputs), output_names=outputs,
        dynamic_axes={k: {0: "n"} for k in (*inputs, *outputs)},
    )  # fmt: skip


def _export_weights(checkpoint: Path, folder: Path) -> None:
    """Write the checkpoint without its optimizer's state, and let the networks refer to it."""
    tensors, head = load_tensors(checkpoint)
    kept = {k: v for k, v in tensors.items() if k.split(".")[0] in WEIGHTS_OF}
    save_tensors(folder / WEIGHTS, kept, head)
    # safetensors makes files that only their owner reads
    shutil.copymode(folder / "policy.onnx", folder / WEIGHTS)
    _refer(folder / "policy.onnx", folder / WEIGHTS, "")
    _refer(folder / "predictor.onnx", folder / WEIGHTS, "predictor.")


def _refer(network: Path, weights: Path, prefix: str) -> None:
    """Replace the numbers of an ONNX file that stand in the weights too by their place there.

    What the export folded into other numbers stays in the ONNX file.
    """
    content, graph = weights.read_bytes(), onnx.load(network)
    # a safetensors file: length of the table of names, 8 bytes; the table; numbers as in memory
    start = 8 + int.from_bytes(content[:8], "little")
    places = json.loads(content[8:start])
    for tensor in graph.graph.initializer:
        first, last = places.get(prefix + tensor.name, {}).get("data_offsets", (0, 0))
        if tensor.raw_data and tensor.raw_data == content[start + first : start + last]:
            set_external_data(tensor, weights.name, start + first, last - first)
            tensor.ClearField("raw_data")
    network.write_bytes(graph.SerializeToString())
