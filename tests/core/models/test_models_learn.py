"""Every model, with the knowledge made by the project's own command, learns a small task.

One that takes goals that it was not trained to find learns to find such, too.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, run_episodes
from cfnav_core.learn.run import Run
from cfnav_core.learn.train import train
from cfnav_core.models.size import ModelSize
from cfnav_core.models.table import MODELS
from cfnav_core.policy.networks import TorchNetworks
from cfnav_core.task.metrics import cf_sr, sr
from cfnav_core.task.vocabulary import CATEGORY_ID
from tests.core.worlds import seen_hall

TRAIN, VALIDATION, TEST = ("kitchen:0-15",), ("kitchen:16-23",), ("kitchen:24-31",)
TRAINED = ("Laptop", "Mug", "Book", "Pillow", "Vase", "Towel", "Pan", "Television")
OTHERS = ("Chair", "Fridge", "Apple", "Mirror")
LEARNT = {"sr": 0.8, "cf_sr": 0.7}
"""Least figures in halls never trained in; untrained networks have 0.03 to 0.04."""


def make_knowledge(folder: Path, *more: str) -> None:
    """Of the scenes to train in, as a user makes it."""
    subprocess.run(
        [sys.executable, "-m", "cfnav.cli", "data", "knowledge", str(folder / "scenes"),
         "--rooms", *TRAIN, *more, "--out", str(folder / "known.safetensors")],
        check=True, capture_output=True, text=True,
    )  # fmt: skip


def learn(name: str, folder: Path, out: Path) -> TorchNetworks:
    """Train a model in the halls of a folder for a few minutes."""
    hp = Hyperparameters(
        stage1_episodes=4000, stage2_episodes=8000, rollout_length=10, entropy_weight=0.03,
        batch=8, lr=2e-3,
    )  # fmt: skip
    config = RunConfig(
        model=name, hyperparameters=hp, size=ModelSize(64, channels=16), predictor_hidden=16
    )
    options = TrainOptions(
        folder / "scenes", TRAIN, VALIDATION, out, run=config,
        knowledge=folder / "known.safetensors", validation_every=2000, validation_episodes=100,
    )  # fmt: skip
    train(options)
    run = Run(options)
    run.resume()
    return TorchNetworks(run.model, run.predictor, feeds=True)


def figures(networks: TorchNetworks, scenes: Path) -> dict[str, float]:
    """In the halls to test in."""
    bank = SceneBank.load(scenes, TEST)
    results = run_episodes(networks, bank, Episodes.draw(bank, 1000, seed=7), sample_seed=0)
    return {"sr": sr(results), "cf_sr": cf_sr(results)}


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
    make_knowledge(folder, "--text", str(folder / "text.npy"))
    return folder


@pytest.mark.long
@pytest.mark.parametrize("name", MODELS)
def test_every_model_learns(name, halls, tmp_path):
    found = figures(learn(name, halls, tmp_path / name), halls / "scenes")
    print(name, found, flush=True)
    assert all(found[key] >= least for key, least in LEARNT.items())


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name, model in MODELS.items() if model.zero_shot])
def test_a_zero_shot_model_finds_what_it_was_not_trained_to_find(name, tmp_path):
    """Two of eight objects in every hall to train in, two of four others where it is tested."""
    rng = np.random.default_rng(0)
    for seed in range(32):
        two = tuple(rng.permutation(TRAINED)[:2])
        seen_hall(seed, f"kitchen:{seed}", two).save(tmp_path / f"scenes/kitchen_{seed:05d}")
    for seed in range(24, 32):
        two = tuple(rng.permutation(OTHERS)[:2])
        seen_hall(seed, f"kitchen:{seed}", two).save(tmp_path / f"others/kitchen_{seed:05d}")
    make_knowledge(tmp_path)
    networks = learn(name, tmp_path, tmp_path / name)
    found, other = (figures(networks, tmp_path / scenes) for scenes in ("scenes", "others"))
    print(name, found, "and of others", other, flush=True)
    assert all(other[key] >= least for key, least in LEARNT.items())
