"""Bundles and their cards: what is written, and what is refused."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from cfnav.policies import Export
from cfnav_core.learn.evaluate import evaluate
from cfnav_core.learn.export import export_bundle
from cfnav_core.learn.model_card import model_card
from cfnav_core.policy.bundle import (
    BundleHead,
)


def test_model_card_says_what_was_and_was_not_measured(made):
    card = (made / "bundle" / "MODEL_CARD.md").read_text()
    assert "Nothing was measured" in card
    assert "kitchen:0" in card
    first = evaluate(made / "bundle", made / "scenes", 60, seed=5)
    live = {
        **first.summary(), "bundle": "x", "speed": 2.0, "veto": False, "commits": ["abc"],
        "rooms": ["kitchen:20"], "command": "python -m live",
        "paired": {"cf_sr_difference": 0.25, "interval": (0.1, 0.4)},
    }  # fmt: skip
    metrics = {**first.summary(), "command": "cfnav evaluate", "live": live}
    assert "commands stand in" not in card
    export_bundle(
        made / "run" / "best.safetensors", made / "perception.onnx", made / "again", "x", metrics,
        "`make it`",
    )  # fmt: skip
    card = (made / "again" / "MODEL_CARD.md").read_text()
    assert "The commands stand in `make it`." in card
    assert f"| {first.summary()['cf_sr']:.3f} [" in card
    assert "`cfnav evaluate`" in card
    assert "60 episodes through mock TurtleBot 4" in card
    assert "at most 2 times real time" in card
    assert "**+0.250** [+0.100, +0.400]" in card
    head = BundleHead.load(made / "again")
    in_step = {**head.metrics, "live": {**live, "speed": 0.0, "lock_step": True}}
    rooms = ["bedroom:3", "kitchen:20", "kitchen:24", "kitchen:22", "kitchen:23"]
    card = model_card(replace(head, metrics={**in_step, "scenes": rooms}))
    assert "its veto off, in lock-step, at commit abc;" in card
    assert "Test rooms bedroom 3; kitchen 20, 22-24, 60 frozen episodes" in card


def test_a_card_gives_the_models_title(made):
    head = BundleHead.load(made / "bundle")
    assert "(model `compact`, method `ours`)" in model_card(head)
    config = {**head.training["config"], "model": "tdanet"}
    card = model_card(replace(head, training={**head.training, "config": config}))
    assert "(model `TDANet-style`, method `ours`)" in card
    assert "tdanet" not in card


def test_a_card_says_what_is_not_the_papers(made):
    head = BundleHead.load(made / "bundle")
    assert "action logits" not in model_card(head)
    config = {**head.training["config"], "listening": True}
    card = model_card(replace(head, training={**head.training, "config": config}))
    assert "also added to its action logits, not in the paper." in card


def test_export_replaces_nothing_but_a_bundle(made, tmp_path):
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(ValueError, match="is no bundle"):
        export_bundle(
            made / "run" / "best.safetensors", made / "perception.onnx", tmp_path, "test"
        )  # fmt: skip
    assert (tmp_path / "thesis.txt").read_text() == "precious"


@pytest.mark.parametrize(
    "arguments",
    [
        ["evaluate", "nowhere", "--scenes", "nowhere"],
        ["export", "nowhere", "--perception", "p", "--out", "o", "--metrics", "nowhere.json"],
    ],
)
def test_command_line_answers_bad_input_in_one_line(tmp_path, arguments):
    command = [sys.executable, "-m", "cfnav.cli", *arguments]
    root = Path(__file__).parents[3]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(root)},
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("cfnav: ")
    assert len(done.stderr.splitlines()) == 1


def test_a_card_names_a_checkpoint_it_is_compared_with_by_its_run(made):
    path = made / "run" / "best.safetensors"
    figures = evaluate(path, made / "scenes", 20, seed=5).summary()
    metrics = {**figures, "against": figures, "command": "cfnav evaluate"}
    export_bundle(path, made / "perception.onnx", made / "third", "x", metrics)
    assert "\n| run | " in (made / "third" / "MODEL_CARD.md").read_text()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("{", "found no JSON in .*; expected that of cfnav evaluate"),
        ("[]", "found no command, episodes, .* expected the JSON of cfnav evaluate"),
        ('{"command": "x", "sr": 1}', "found no episodes, spl, .* expected the JSON of cfnav ev"),
    ],
)
def test_other_files_than_figures_are_told_before_anything_is_made(
    made, tmp_path, content, sentence
):
    (tmp_path / "figures.json").write_text(content)
    export = Export(
        made / "run" / "best.safetensors", tmp_path / "bundle", made / "perception.onnx",
        metrics=tmp_path / "figures.json",
    )  # fmt: skip
    with pytest.raises(ValueError, match=sentence):
        export.run_command()
    assert not (tmp_path / "bundle").exists()


def test_figures_of_another_policy_are_refused(made, tmp_path):
    path = made / "run" / "best.safetensors"
    figures = {**evaluate(path, made / "scenes", 20, seed=5).summary(), "command": "it"}
    with pytest.raises(ValueError, match=r"figures of a policy with seed 7 for .* with 0;"):
        export_bundle(path, made / "perception.onnx", tmp_path / "b", "x", {**figures, "seed": 7})
    assert not (tmp_path / "b").exists()


def test_a_card_says_how_it_acted_and_names_rooms_of_published_data(made):
    path = made / "run" / "best.safetensors"
    figures = evaluate(path, made / "scenes", 20, seed=5, sample=True, p_hat="zero").summary()
    head = BundleHead.load(made / "bundle")
    metrics = {**figures, "command": "it", "scenes": ["FloorPlan21", "FloorPlan22", "kitchen:1"]}
    card = model_card(replace(head, metrics=metrics))
    assert "Test rooms kitchen 1; FloorPlan21; FloorPlan22, 20 frozen episodes" in card
    assert ", drawn actions, without p_hat, one training seed" in card
