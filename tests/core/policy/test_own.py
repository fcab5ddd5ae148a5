"""A model, a method and an encoder of the user's own, from training to a bundle that drives."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from cfnav_core.agent.agent import TrainedAgent, new_agent
from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.agent.find import find_method, find_model
from cfnav_core.files.checkpoint import save_tensors
from cfnav_core.learn.export import export_bundle
from cfnav_core.learn.train import train
from cfnav_core.models.base import Knowledge, ObservationSpec
from cfnav_core.models.size import ModelSize
from cfnav_core.perception.describe import describe
from cfnav_core.perception.net import PerceptionNet, export_perception
from cfnav_core.perception.perception import OnnxPerception, PerceptionError
from cfnav_core.policy.bundle import BundleError, BundleHead
from cfnav_core.policy.policy import Policy
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.detections import SCORES
from cfnav_core.task.rooms import room_folder
from tests.core.worlds import hall

MINE = """
from cfnav_core.agent.methods import Method, Stage
from cfnav_core.models.compact import Compact


class Mine(Compact):
    title = "Mine"


LATE = Method(Stage(), Stage(collision_penalty=-0.2))
NOT_ONE = 3
"""
SMALL = ModelSize(hidden=16, channels=8)
WIDE = CameraSetUp(0.0, 0.5, (70.0, 42.95), (320, 180), (0.0,))


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    return path


def test_a_model_and_a_method_of_a_users_file_train_and_drive(tmp_path: Path, mine: Path) -> None:
    perception = tmp_path / "perception.onnx"
    export_perception(PerceptionNet(), perception)
    identity = OnnxPerception(perception).identity
    for seed in (0, 1):
        scene = replace(hall(seed=seed, name=f"kitchen:{seed}"), perception=identity)
        scene.save(room_folder(tmp_path / "scenes", "kitchen", seed))
    run = RunConfig(
        method=f"{mine}:LATE", model=f"{mine}:Mine", size=SMALL, predictor_hidden=8,
        hyperparameters=Hyperparameters(200, 200, batch=16),
    )  # fmt: skip
    best = train(TrainOptions(
        scenes=tmp_path / "scenes", train_rooms=("kitchen:0",), validation_rooms=("kitchen:1",),
        out=tmp_path / "run", run=run, validation_every=200, validation_episodes=20,
    ))  # fmt: skip
    assert type(TrainedAgent.load(best).agent.model).__name__ == "Mine"
    export_bundle(best, perception, tmp_path / "bundle", "mine")
    mine.unlink()  # a robot has no such file
    policy = Policy.load(tmp_path / "bundle")
    policy.reset(policy.goals[0])
    assert policy.act(np.zeros((300, 300, 3), np.uint8)).probabilities.shape == (6,)
    assert f"{mine}:Mine" in (tmp_path / "bundle/MODEL_CARD.md").read_text()


def test_a_module_on_the_path_serves_too() -> None:
    assert find_model("cfnav_core.models.compact:Compact") is find_model("compact")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("unheard", r"expected one of compact, .*FILE\.py:NAME"),
        ("nowhere.py:Mine", "found no usable module at nowhere.py"),
        ("no.such.module:Mine", "found no usable module"),
        ("{mine}:Other", "found no Other in"),
        ("{mine}:NOT_ONE", "expected a class made from NavModel"),
        ("{mine}:LATE", "expected a class made from NavModel"),
    ],
)
def test_a_model_that_is_none_is_one_sentence(mine: Path, name: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        find_model(name.format(mine=mine))


def test_a_method_that_is_none_is_one_sentence(mine: Path) -> None:
    with pytest.raises(ValueError, match="expected a Method"):
        find_method(f"{mine}:NOT_ONE")
    with pytest.raises(ValueError, match="expected one of ours, plain"):
        find_method("unheard")


class Encoder(nn.Module):
    """Stands for somebody's encoder and detector: 8 maps of a wide picture, two kinds of boxes."""

    def __init__(self, detects: bool = True) -> None:
        super().__init__()
        self.maps, self.detects = nn.Conv2d(3, 8, 5, 5), detects

    def forward(self, pictures: torch.Tensor) -> tuple[torch.Tensor, ...]:
        maps = self.maps(pictures.permute(0, 3, 1, 2).float() / 255)
        features = nn.functional.adaptive_avg_pool2d(maps, 4)
        table = features.flatten(1)[:, :10].reshape(-1, 2, 5)
        return (features, table) if self.detects else (features,)


FIELDS = ("x1", "y1", "x2", "y2", "confidence")


def encoder(path: Path, detects: bool = True) -> Path:
    torch.manual_seed(0)
    outputs = ["features", "detections"][: 1 + detects]
    torch.onnx.export(
        Encoder(detects).eval(), (torch.zeros(2, 20, 40, 3, dtype=torch.uint8),), str(path),
        dynamo=False, opset_version=17, input_names=["pictures"], output_names=outputs,
        dynamic_axes={k: {0: "n"} for k in ("pictures", *outputs)},
    )  # fmt: skip
    return path


def published(path: Path) -> Path:
    """A checkpoint as of a run on published features: no picture, no network's hash."""
    inputs = ObservationSpec((8, 4, 4), FIELDS, ("Mug", "Sink"), ("hall", "cellar"))
    config, known = RunConfig(model="baseline_label", size=SMALL, predictor_hidden=8), Knowledge()
    torch.manual_seed(0)
    agent = new_agent(config, inputs, known)
    save_tensors(path, agent.tensors(known), {
        "config": asdict(config), "episodes": 0, "steps": 0, "best": -1.0, "goals": ("Mug",),
        "perception": "data1: resnet18_featuremap, det_feature", "inputs": asdict(inputs),
        "camera": None, "commit": "none", "train_rooms": ("a",), "validation_rooms": ("b",),
    })  # fmt: skip
    return path


def test_a_model_of_published_features_drives_with_its_encoder(tmp_path: Path) -> None:
    """Its own objects, its own fields, its own room types, wide pictures, no tilt."""
    path = encoder(tmp_path / "encoder.onnx")
    describe(path, ("Mug", "Sink"), FIELDS, WIDE)
    checkpoint = published(tmp_path / "best.safetensors")
    head = export_bundle(checkpoint, path, tmp_path / "bundle", "theirs")
    again = BundleHead.load(tmp_path / "bundle")
    assert again == head
    assert (again.features, again.fields) == ((8, 4, 4), FIELDS)
    assert again.camera is not None
    assert again.camera.size == (320, 180)
    for backend in ("onnx", "torch"):
        policy = Policy.load(tmp_path / "bundle", backend)  # type: ignore[arg-type]
        policy.reset("Mug", "cellar")
        rgb = np.random.default_rng(0).integers(0, 256, (180, 360, 3), np.uint8)
        assert policy.act(rgb).probabilities.sum() == pytest.approx(1, abs=1e-5)
        with pytest.raises(PerceptionError, match=r"found a picture of 300x300 pixels, expected"):
            policy.act(np.zeros((300, 300, 3), np.uint8))
        with pytest.raises(ValueError, match="found room type 'kitchen', expected one that"):
            policy.reset("Mug", "kitchen")


def test_an_encoder_that_gives_something_else_is_refused(tmp_path: Path) -> None:
    path = encoder(tmp_path / "encoder.onnx")
    with pytest.raises(PerceptionError, match=r"no readable account .*perception\.describe"):
        OnnxPerception(path)
    describe(path, ("Mug",), FIELDS, None)
    with pytest.raises(PerceptionError, match=r"found detections \[2, 5\].*expected \[1, 5\]"):
        OnnxPerception(path)
    describe(path, ("Sink", "Mug"), FIELDS, None)
    with pytest.raises(BundleError, match=r"with objects Sink, Mug, but its networks read Mug, S"):
        export_bundle(published(tmp_path / "a"), path, tmp_path / "bundle", "theirs")
    describe(path, ("Mug", "Sink"), SCORES, None)
    with pytest.raises(BundleError, match=r"with fields score, score_x"):
        export_bundle(published(tmp_path / "a"), path, tmp_path / "bundle", "theirs")
    assert not (tmp_path / "bundle").exists()


WITH_NEW_WORDS = """
import sys
from cfnav_core.task import vocabulary
vocabulary.CATEGORIES = (*vocabulary.CATEGORIES, "Sofa")
vocabulary.ROOM_TYPES = (*vocabulary.ROOM_TYPES, "cellar")

import numpy as np
from cfnav_core.policy.policy import Policy
for backend in ("onnx", "torch"):
    policy = Policy.load("hoz", backend)
    policy.reset(policy.goals[0], "kitchen")
    print(policy.act(np.zeros((300, 300, 3), np.uint8)).action.name)
    for goal, room in (("Sofa", "kitchen"), (policy.goals[0], "cellar")):
        try:
            policy.reset(goal, room)
        except ValueError as error:
            print(error)
"""


def test_new_words_in_the_code_break_no_bundle() -> None:
    """The bundle's own names count, whatever the vocabulary has learnt since."""
    command = [sys.executable, "-c", WITH_NEW_WORDS]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert len(lines) == 6
    assert lines[:3] == lines[3:]
    assert lines[1].startswith("found goal 'Sofa', expected one of ")
    assert lines[2].startswith("found room type 'cellar', expected one that hoz knows: kitchen, ")


def test_the_shipped_bundle_learnt_from_the_mast() -> None:
    assert Policy.load().camera == MAST
