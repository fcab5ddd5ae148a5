"""Every model, with the knowledge made by the project's own command, learns a small task."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.config import Hyperparameters, ModelSize, RunConfig, TrainOptions
from cfnav_core.env import SceneBank
from cfnav_core.evaluate import Episodes, run_episodes
from cfnav_core.metrics import cf_sr, sr
from cfnav_core.models import MODELS
from cfnav_core.networks import TorchNetworks
from cfnav_core.run import Run
from cfnav_core.train import train
from cfnav_core.vocabulary import CATEGORY_ID

from .worlds import seen_hall

TRAIN, VALIDATION, TEST = ("kitchen:0-15",), ("kitchen:16-23",), ("kitchen:24-31",)
LEARNT = {"sr": 0.8, "cf_sr": 0.7}
"""Least figures in halls never trained in; untrained networks have 0.03 to 0.04."""


@pytest.fixture(scope="module")
def halls(tmp_path_factory):
    """32 halls whose picture features also say what is detected, for models without detections."""
    folder = tmp_path_factory.mktemp("halls")
    for seed in range(32):
        scene = seen_hall(seed, f"kitchen:{seed}")
        rows = scene.detections[:, [CATEGORY_ID["Laptop"], CATEGORY_ID["Mug"]]]
        features = scene.features.copy()
        features[:, 16:26] = rows.reshape(len(rows), -1)
        replace(scene, features=features).save(folder / "scenes" / f"kitchen_{seed:05d}")
    np.save(folder / "text.npy", np.random.default_rng(0).normal(size=(38, 16)).astype(np.float32))
    subprocess.run(
        [sys.executable, "-m", "cfnav_core.cli", "data", "knowledge", str(folder / "scenes"),
         "--rooms", *TRAIN, "--text", str(folder / "text.npy"), "--out",
         str(folder / "known.safetensors")],
        check=True, capture_output=True,
    )  # fmt: skip
    return folder


@pytest.mark.long
@pytest.mark.parametrize("name", MODELS)
def test_every_model_learns(name, halls, tmp_path):
    hp = Hyperparameters(
        stage1_episodes=4000, stage2_episodes=8000, rollout_length=10, entropy_weight=0.03,
        batch=8, lr=2e-3,
    )  # fmt: skip
    config = RunConfig(
        model=name, hyperparameters=hp, size=ModelSize(64, channels=16), predictor_hidden=16
    )
    options = TrainOptions(
        halls / "scenes", TRAIN, VALIDATION, tmp_path / name, run=config,
        knowledge=halls / "known.safetensors", validation_every=2000, validation_episodes=100,
    )  # fmt: skip
    train(options)
    run = Run(options)
    run.resume()
    bank = SceneBank.load(halls / "scenes", TEST)
    networks = TorchNetworks(run.model, run.predictor, feeds=True)
    results = run_episodes(networks, bank, Episodes.draw(bank, 1000, seed=7), sample_seed=0)
    found = {"sr": sr(results), "cf_sr": cf_sr(results)}
    print(name, found, flush=True)
    assert all(found[key] >= least for key, least in LEARNT.items())
