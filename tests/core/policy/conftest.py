"""A bundle of a small run in two halls, with its scenes and its perception."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.learn.export import export_bundle
from cfnav_core.learn.train import train
from cfnav_core.models.size import ModelSize
from cfnav_core.perception.net import PerceptionNet, export_perception
from cfnav_core.perception.perception import OnnxPerception
from tests.core.worlds import hall

SMALL = RunConfig(
    hyperparameters=Hyperparameters(stage1_episodes=300, stage2_episodes=300, batch=32),
    size=ModelSize(hidden=32),
    predictor_hidden=16,
)


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """A folder with perception.onnx, scenes, a run and its bundle."""
    root = tmp_path_factory.mktemp("bundle")
    torch.manual_seed(0)
    export_perception(PerceptionNet(), root / "perception.onnx")
    identity = OnnxPerception(root / "perception.onnx").identity
    for seed in range(2):
        scene = replace(hall(seed=seed, name=f"kitchen:{seed}"), perception=identity)
        scene.save(root / "scenes" / f"kitchen_{seed:05d}")
    options = TrainOptions(
        root / "scenes", ("kitchen:0",), ("kitchen:1",), root / "run", run=SMALL,
        validation_every=200, validation_episodes=20,
    )  # fmt: skip
    best = train(options)
    export_bundle(best, root / "perception.onnx", root / "bundle", "test")
    return root
