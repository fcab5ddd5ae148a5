"""A policy takes names that it never trained with: ``cfnav export --also``.

Where no weight of a model belongs to one object (``NavModel.zero_shot``), a further object is a
further row of what it sees and a further word vector. What it does with rows that are empty is
unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from cfnav_core import words
from cfnav_core.agent.find import find_model
from cfnav_core.detect.labels import load_labels, shipped
from cfnav_core.files.checkpoint import load_tensors, save_tensors
from cfnav_core.models.base import ObservationSpec
from cfnav_core.task.detections import SIGHTINGS

WORDS = "knowledge.words"


def names_of(given: Sequence[str]) -> tuple[str, ...]:
    """Names as cfnav has them, and in place of a shipped map of labels those of its classes."""
    maps = [load_labels(name) for name in shipped()]
    other = {name: meant for labels in maps for name, meant in labels.categories.items()}
    out: list[str] = []
    for one in given:
        if one in shipped():
            labels = load_labels(one)
            out += [labels.category(name) for name in labels.names.values()]
        else:
            out.append(other.get(one, one))
    return tuple(dict.fromkeys(out))


def with_further(checkpoint: Path, given: Sequence[str], out: Path) -> Path:
    """Write a checkpoint that knows further names.

    Args:
        checkpoint: of a run.
        given: names, or maps of labels (``names_of``); those that it knows change nothing.
        out: the file to write.

    Raises:
        CheckpointError: the checkpoint is damaged.
        ValueError: its model has weights for single objects, its pictures are looked at by a
            perception, which detects what it learnt, or its words are not the shipped ones.
        WordError: a name has no word vector.
    """
    tensors, head = load_tensors(checkpoint)
    inputs = ObservationSpec.read(head["inputs"])
    model = head["config"]["model"]
    if not find_model(model).zero_shot:
        raise ValueError(
            f"found model {model} in {checkpoint}, which has weights for single objects; leave "
            "--also out, or train one that takes other goals, such as --model tdanet"
        )
    if inputs.fields != SIGHTINGS:
        raise ValueError(
            f"found {checkpoint} that reads what a perception detects, and that detects what it "
            "learnt; leave --also out, or train on sightings (cfnav rooms boxes)"
        )
    known, ours = tensors.get(WORDS, torch.empty(0)).numpy(), words.vectors(inputs.objects)
    if known.shape != ours.shape or not np.allclose(known, ours, atol=1e-3):
        raise ValueError(
            f"found other word vectors in {checkpoint} than those that come with cfnav, which "
            "further names would be described by; leave --also out"
        )
    further = [name for name in names_of(given) if name not in inputs.objects]
    if further:
        added = torch.from_numpy(np.concatenate([known, words.vectors(further)]))
        # of what a run knows of its objects beforehand, such a model reads the words alone
        kept = {k: v for k, v in tensors.items() if not k.startswith("knowledge.")}
        tensors = kept | {WORDS: added}
    objects = [*inputs.objects, *further]
    inputs_of = {**head["inputs"], "objects": objects}
    further = [*head.get("further", ()), *further]
    save_tensors(out, tensors, {**head, "inputs": inputs_of, "further": further})
    return out
