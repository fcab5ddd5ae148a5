"""A trained checkpoint and a perception network become a bundle."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import torch

from cfnav_core.actions import NUM_ACTIONS
from cfnav_core.bundle import NETWORKS, BundleHead, file_hash
from cfnav_core.checkpoint import load_module, load_tensors
from cfnav_core.collision_predictor import CollisionPredictor
from cfnav_core.methods import METHODS
from cfnav_core.model_card import model_card
from cfnav_core.models import MODELS, NavModel
from cfnav_core.perception import DETECTION_FIELDS, FEATURES, Perception
from cfnav_core.vocabulary import CATEGORIES

TRAINING_FIELDS = (
    "config", "commit", "episodes", "steps", "perception", "train_rooms", "validation_rooms",
)  # fmt: skip


def export_bundle(
    checkpoint: Path, perception: Path, out: Path, name: str, metrics: dict[str, Any] | None = None
) -> BundleHead:
    """Write a bundle; ``out`` appears only when complete.

    Raises:
        CheckpointError: the checkpoint is damaged or of another network.
        PerceptionError: the perception network is unusable.
        ValueError: another perception than it was trained with, or ``out`` is no bundle.
    """
    if out.exists() and not (out / "bundle.json").exists():
        raise ValueError(f"found {out}, which is no bundle; give a new folder or one to replace")
    tensors, head = load_tensors(checkpoint)
    identity = Perception(perception).identity
    if identity != head["perception"]:
        raise ValueError(
            f"found perception {identity} at {perception}, but {checkpoint} was trained with "
            f"{head['perception']}; give that one"
        )
    size = head["config"]["size"]
    model = MODELS[head["config"]["model"]](size["hidden"])
    predictor = CollisionPredictor(size["predictor_hidden"])
    load_module(checkpoint, "model", model, tensors)
    load_module(checkpoint, "predictor", predictor, tensors)
    partial = out.with_name(out.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    shutil.copyfile(perception, partial / "perception.onnx")
    export_networks(model, predictor, partial)
    method = head["config"]["method"]
    bundle = BundleHead(
        name, method, METHODS[method].stage2.feed_prediction, tuple(head["goals"]),
        (model.hidden, predictor.hidden), {n: file_hash(partial / n) for n in NETWORKS},
        {k: head[k] for k in TRAINING_FIELDS}, metrics or {},
    )  # fmt: skip
    bundle.save(partial)
    (partial / "MODEL_CARD.md").write_text(model_card(bundle))
    shutil.rmtree(out, ignore_errors=True)
    partial.replace(out)
    return bundle


def export_networks(model: NavModel, predictor: CollisionPredictor, folder: Path) -> None:
    """Write ``policy.onnx`` and ``predictor.onnx`` for any number of agents."""
    n, categories = 2, len(CATEGORIES)
    inputs = {
        "features": (n, FEATURES), "detections": (n, categories, len(DETECTION_FIELDS)),
        "goal": (n, categories), "previous_action": (n, NUM_ACTIONS),
        "collision_probability": (n, 1), "h": (n, model.hidden), "c": (n, model.hidden),
    }  # fmt: skip
    _export(model, inputs, ["logits", "value", "next_h", "next_c"], folder / "policy.onnx")
    inputs = {
        "features": (n, FEATURES), "previous_action": (n, NUM_ACTIONS),
        "state": (n, 4, predictor.hidden),
    }  # fmt: skip
    _export(predictor, inputs, ["logit", "next_state"], folder / "predictor.onnx")


def _export(
    module: torch.nn.Module, inputs: dict[str, tuple[int, ...]], outputs: list[str], path: Path
) -> None:
    torch.onnx.export(
        module.eval(), tuple(torch.zeros(s) for s in inputs.values()), str(path), dynamo=False,
        opset_version=17, input_names=list(inputs), output_names=outputs,
        dynamic_axes={k: {0: "n"} for k in (*inputs, *outputs)},
    )  # fmt: skip
