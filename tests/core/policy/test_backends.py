"""What a bundle holds for torch, what it does not hold twice, and what it says when torch cannot.

That both back ends answer alike is asked in ``tests/sim/test_backends.py``, on a rendered room.
"""

from __future__ import annotations

import json
import os
import shutil
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx.numpy_helper import to_array
from safetensors.numpy import load_file

from cfnav_core.agent.agent import TrainedAgent
from cfnav_core.files.checkpoint import load_tensors
from cfnav_core.files.provenance import sha256
from cfnav_core.learn.export import export_bundle
from cfnav_core.learn.model_card import model_card
from cfnav_core.policy.bundle import (
    NETWORKS,
    WEIGHTS,
    BundleError,
    BundleHead,
    shipped_bundle,
    shipped_perception,
)
from cfnav_core.policy.policy import Policy
from cfnav_core.task.vocabulary import CATEGORIES
from tests.core.model_samples import save_fresh

SHIPPED = shipped_bundle()
PERCEPTION = shipped_perception()


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Path:
    """Of a model that knows words, trained, so it says, to find a mug."""
    root = tmp_path_factory.mktemp("bundle")
    checkpoint = save_fresh(root / "best.safetensors", "tdanet", PERCEPTION, ("Mug",))
    export_bundle(checkpoint, PERCEPTION, root / "bundle", "words")
    return root / "bundle"


@pytest.fixture
def old(bundle, tmp_path) -> Path:
    """The same as earlier versions wrote it: every number in the ONNX files, no weights."""
    folder = tmp_path / "old"
    shutil.copytree(bundle, folder)
    for name in NETWORKS[1:]:
        onnx.save(onnx.load(folder / name), folder / name)  # what it refers to is now its own
    (folder / WEIGHTS).unlink()
    head = json.loads((folder / "bundle.json").read_text())
    head |= {"schema": 2, "files": {name: sha256(folder / name) for name in NETWORKS}}
    del head["zero_shot"]
    (folder / "bundle.json").write_text(json.dumps(head))
    return folder


@pytest.mark.parametrize(
    "folder", sorted(p.parent for p in SHIPPED.parent.glob("*/bundle.json")), ids=lambda of: of.name
)
def test_a_shipped_bundle_is_small_and_its_networks_share_their_weights(folder: Path):
    head = BundleHead.load(folder)
    assert head.metrics
    assert (folder / "MODEL_CARD.md").read_text() == model_card(head)
    size = sum(head.file(folder, name).stat().st_size for name in head.files)
    assert size < 12e6
    weights = load_file(folder / WEIGHTS)
    assert not [name for name in weights if "optimizer" in name]
    for name, prefix in (("policy.onnx", ""), ("predictor.onnx", "predictor.")):
        # the graph, what a model knows of rooms beforehand, and weights that export turned round
        assert (folder / name).stat().st_size < 450_000
        graph = onnx.load(folder / name)
        own = {prefix + t.name: to_array(t) for t in graph.graph.initializer}
        shared = own.keys() & weights.keys()
        assert sum(own[k].nbytes for k in shared) > 0.9 * sum(v.nbytes for v in own.values())
        assert all(np.array_equal(own[k], weights[k]) for k in shared)


def test_everybody_may_read_a_bundle(bundle):
    modes = {stat.S_IMODE(f.stat().st_mode) for f in bundle.iterdir()}
    assert modes == {stat.S_IMODE((bundle / "bundle.json").stat().st_mode)}


def test_a_bundle_is_exported_again_from_its_own_weights(bundle, tmp_path):
    trained = TrainedAgent.load(bundle / WEIGHTS)
    assert (trained.head["config"]["model"], trained.inputs.objects) == ("tdanet", CATEGORIES)
    again = export_bundle(bundle / WEIGHTS, PERCEPTION, tmp_path / "again", "words")
    shipped = BundleHead.load(bundle)
    # The shipped weights were written before checkpoints had checksums; their numbers are the same.
    assert replace(again, files=again.files | {WEIGHTS: shipped.files[WEIGHTS]}) == shipped
    (before, _), (after, _) = (load_tensors(f / WEIGHTS) for f in (bundle, tmp_path / "again"))
    assert before.keys() == after.keys()
    assert all(torch.equal(before[name], after[name]) for name in before)


def test_bundles_without_weights_run_on_onnx_alone(bundle, old):
    picture = np.random.default_rng(0).integers(0, 255, (300, 300, 3), np.uint8)
    answers = []
    for folder in (bundle, old):
        policy = Policy.load(folder)
        policy.reset("Mug")
        answers.append(policy.act(picture).probabilities)
    np.testing.assert_array_equal(*answers)
    # they did not say whether their model takes other goals
    assert Policy.load(bundle).admits("Chair") == ""
    assert "was not trained to find" in Policy.load(old).admits("Chair")
    with pytest.raises(BundleError, match=r"no weights\.safetensors .* again with cfnav export"):
        Policy.load(old, "torch")


def test_the_card_names_what_a_zero_shot_model_takes(bundle, old):
    card = model_card(BundleHead.load(bundle))
    assert "Goals: Mug." in card
    assert "not trained to find: AlarmClock, Apple," in card
    assert "not trained to find" not in model_card(BundleHead.load(old))


@pytest.mark.parametrize("backend", ["onnx", "torch"])
def test_damaged_weights_are_found(bundle, tmp_path, backend):
    folder = tmp_path / "damaged"
    shutil.copytree(bundle, folder)
    content = bytearray((folder / WEIGHTS).read_bytes())
    content[-1] ^= 1
    (folder / WEIGHTS).write_bytes(content)
    with pytest.raises(BundleError, match=r"weights\.safetensors .* damaged: export it again"):
        Policy.load(folder, backend)
    (folder / WEIGHTS).unlink()
    with pytest.raises(BundleError, match="hash nothing"):
        Policy.load(folder, backend)


@pytest.mark.parametrize("content", [b"", b"nonsense"])
def test_weights_that_are_none_are_one_sentence(bundle, tmp_path, content):
    folder = tmp_path / "none"
    shutil.copytree(bundle, folder)
    (folder / WEIGHTS).write_bytes(content)
    head = json.loads((folder / "bundle.json").read_text())
    head["files"][WEIGHTS] = sha256(folder / WEIGHTS)
    (folder / "bundle.json").write_text(json.dumps(head))
    for backend in ("onnx", "torch"):
        with pytest.raises(BundleError, match=f"in {folder} that do not load"):
            Policy.load(folder, backend)


def test_another_back_end_is_refused():
    with pytest.raises(ValueError, match="found back end 'jax', expected onnx or torch"):
        Policy.load(SHIPPED, "jax")


WITHOUT_TORCH = """
import sys
import numpy as np
sys.modules["torch"] = None  # as where it is not installed
from cfnav_core.policy.policy import Policy
policy = Policy.load()
policy.reset("Mug")
print(policy.act(np.zeros((300, 300, 3), np.uint8)).action.name)
Policy.load(backend="torch")
"""


def test_without_torch_onnx_runs_and_torch_says_what_to_install():
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_TORCH], capture_output=True, text=True, timeout=120,
        env={**os.environ, "PYTHONPATH": str(root)},
    )  # fmt: skip
    assert done.returncode == 1
    assert len(done.stdout.split()) == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith(
        "cfnav_core.policy.bundle.BundleError: found no torch, which back end torch"
    )
    assert "pip install 'cfnav[train]'" in last
