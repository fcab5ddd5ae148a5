"""A trained checkpoint and a perception network become a bundle."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import onnx
import torch
from onnx.external_data_helper import set_external_data
from torch import Tensor, nn

from cfnav_core.agent.agent import Agent, TrainedAgent
from cfnav_core.agent.find import find_model
from cfnav_core.detect.sightings import SightingEyes
from cfnav_core.files.checkpoint import load_tensors, save_tensors
from cfnav_core.files.provenance import sha256
from cfnav_core.files.whole import whole, writing
from cfnav_core.learn.candidate import origin
from cfnav_core.learn.further import with_further
from cfnav_core.learn.model_card import model_card
from cfnav_core.models.base import ModelInput, NavModel, ObservationSpec
from cfnav_core.perception.perception import OnnxPerception, Percept
from cfnav_core.policy.bundle import CARD, PERCEPTION, WEIGHTS, BundleHead
from cfnav_core.policy.networks import SEEN
from cfnav_core.policy.policy import check_fits
from cfnav_core.task.actions import NUM_ACTIONS
from cfnav_core.task.detections import SIGHTINGS

WEIGHTS_OF = ("model", "predictor", "knowledge")
"""What of a checkpoint a bundle keeps."""

TRAINING_FIELDS = (
    "config", "commit", "episodes", "steps", "perception", "train_rooms", "validation_rooms",
    "stage1",
)  # fmt: skip


def export_bundle(
    checkpoint: Path, perception: Path | None, out: Path, name: str,
    metrics: dict[str, Any] | None = None, commands: str = "", also: Sequence[str] = (),
) -> BundleHead:  # fmt: skip
    """Write a bundle; ``out`` appears only when complete.

    One that reads sightings has no ``perception``, and every other needs one. ``metrics`` and where
    the ``commands`` stand that made it are kept for its card. It may be asked for the names in
    ``also``, too (``further.py``).

    Raises:
        CheckpointError: the checkpoint is damaged or of another network.
        PerceptionError: the perception network is unusable.
        ValueError: another perception than it was trained with, none where it needs one, figures
            of another policy, or ``out`` is no bundle.
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    if out.exists() and not (out / "bundle.json").exists():
        raise ValueError(f"found {out}, which is no bundle; give a new folder or one to replace")
    with TemporaryDirectory() as scratch:
        source = with_further(checkpoint, also, Path(scratch, "wider")) if also else checkpoint
        return _export_bundle(source, perception, out, name, metrics, commands)


def _export_bundle(
    checkpoint: Path, perception: Path | None, out: Path, name: str,
    metrics: dict[str, Any] | None, commands: str,
) -> BundleHead:  # fmt: skip
    trained = TrainedAgent.load(checkpoint)
    head, inputs = trained.head, trained.inputs
    _check_figures(metrics or {}, origin(head), checkpoint)
    gives = _percept(trained, checkpoint, perception)
    with writing(out), whole(out) as partial:
        partial.mkdir(parents=True)
        if perception is not None:
            shutil.copyfile(perception, partial / PERCEPTION)
        export_networks(trained.agent, inputs, partial)
        if perception is None:
            _check_blind(partial / "policy.onnx", checkpoint)
        _export_weights(checkpoint, partial)
        bundle = BundleHead(
            name, head["config"]["method"], trained.feeds_prediction, inputs.objects,
            tuple(head["goals"]), {f.name: sha256(f) for f in sorted(partial.iterdir())},
            {k: head[k] for k in TRAINING_FIELDS if k in head}
            | ({"commands": commands} if commands else {}),
            metrics or {},
            find_model(head["config"]["model"]).zero_shot, inputs.features, inputs.fields,
            inputs.room_types, trained.camera or gives.camera, tuple(head.get("further", ())),
        )  # fmt: skip
        check_fits(gives, bundle, str(perception or checkpoint))
        bundle.save(partial)
        (partial / CARD).write_text(model_card(bundle))
    return bundle


def _percept(trained: TrainedAgent, checkpoint: Path, path: Path | None) -> Percept:
    """What a checkpoint's eyes give, which must be those that it was trained with.

    Published features bear the name of their data set instead of a network's hash: then the given
    encoder is believed to be theirs, if it gives what the networks read.

    Raises:
        ValueError: another perception than it was trained with, or one too many or too few.
    """
    inputs = trained.inputs
    if (inputs.fields == SIGHTINGS) != (path is None):
        raise ValueError(
            f"found {path or 'no perception'} for {checkpoint}, which reads "
            f"{', '.join(inputs.fields)}; give "
            + ("the perception that its scenes were made with" if path is None else
               "no --perception: a detector says these on the robot")
        )  # fmt: skip
    if path is None:
        return SightingEyes(inputs.objects, inputs.features).gives
    observer = OnnxPerception(path)
    expected = trained.head["perception"]
    is_hash = len(expected) == len(observer.identity) and " " not in expected
    if is_hash and observer.identity != expected:
        raise ValueError(
            f"found perception {observer.identity} at {path}, but {checkpoint} was trained with "
            f"{expected}; give that one"
        )
    return observer.gives


def _check_figures(metrics: dict[str, Any], own: dict[str, Any], checkpoint: Path) -> None:
    """See that figures are those of the policy beside which they are to stand.

    Raises:
        ValueError: they are another one's.
    """
    for key, value in own.items():
        if metrics.get(key, value) != value:
            raise ValueError(
                f"found figures of a policy with {key} {metrics[key]} for {checkpoint} with "
                f"{value}; give those of this one (cfnav evaluate)"
            )


def _check_blind(network: Path, checkpoint: Path) -> None:
    """See that a policy that is to read sightings reads nothing of pictures.

    Raises:
        ValueError: it does.
    """
    if "features" in {given.name for given in onnx.load(network).graph.input}:
        raise ValueError(
            f"found a model in {checkpoint} that reads features of pictures beside sightings, "
            "which nobody has on the robot; train one that reads none, such as --model tdanet"
        )


class _Flat(nn.Module):
    """A model whose inputs and outputs have names instead of places in dataclasses."""

    def __init__(self, model: NavModel) -> None:
        super().__init__()
        self.model = model

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        """Fields of ``ModelInput``, then memory; logits, value, then the next memory."""
        seen, memory = tensors[: len(SEEN)], tensors[len(SEEN) :]
        state = dict(zip(self.model.state_shapes, memory, strict=True))
        logits, value, following = self.model(ModelInput(*seen), state)
        return logits, value, *(following[name] for name in state)


def export_networks(agent: Agent, inputs: ObservationSpec, folder: Path) -> None:
    """Write ``policy.onnx`` and ``predictor.onnx`` for any number of agents."""
    n, objects = 2, len(inputs.objects)
    memory = {k: (n, *shape) for k, shape in agent.model.state_shapes.items()}
    seen = {
        "features": (n, *inputs.features), "detections": (n, objects, inputs.detections),
        "goal": (n, objects), "room": (n, len(inputs.room_types)),
        "previous_action": (n, NUM_ACTIONS), "collision_probability": (n, 1),
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
    head.pop("progress", None)
    save_tensors(folder / WEIGHTS, kept, head)
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
