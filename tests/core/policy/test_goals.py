"""What a bundle may be asked for, and which models take goals that they were not trained on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from cfnav_core.learn.export import export_bundle
from cfnav_core.models.base import Knowledge, ModelInput
from cfnav_core.models.table import MODELS
from cfnav_core.policy.bundle import shipped_perception
from cfnav_core.policy.goals import OTHER_NAMES, closest
from cfnav_core.policy.policy import Policy
from cfnav_core.task.vocabulary import CATEGORIES
from tests.core.model_samples import (
    BUILT_IN,
    SIGHTED,
    SMALL,
    knowledge,
    outspoken,
    save_fresh,
    views,
)

PERCEPTION = shipped_perception()
TRAINED = ("Laptop", "Mug")


@pytest.fixture(scope="module", params=["tdanet", "compact"])
def policy(request, tmp_path_factory) -> Policy:
    """Trained, so its bundle says, to find a laptop and a mug."""
    root = tmp_path_factory.mktemp(request.param)
    checkpoint = save_fresh(root / "best.safetensors", request.param, PERCEPTION, TRAINED)
    export_bundle(checkpoint, PERCEPTION, root / "bundle", request.param)
    return Policy.load(root / "bundle")


def test_other_goals_where_the_model_allows_them(policy):
    assert policy.admits("Laptop") == ""
    assert policy.goals == TRAINED
    if policy.name == "tdanet":
        assert policy.admits("Chair") == ""
        policy.reset("Chair")
    else:
        assert policy.admits("Chair") == (
            "found goal 'Chair', which the bundle's perception detects but its model was not "
            "trained to find, expected one of Laptop, Mug"
        )
        with pytest.raises(ValueError, match=r"'Chair', which .* expected one of Laptop, Mug$"):
            policy.reset("Chair")


def test_no_word_for_what_is_not_detected(policy):
    with pytest.raises(ValueError, match="found goal 'Unicorn', expected one of"):
        policy.reset("Unicorn")
    assert policy.admits("lap top").startswith("found goal 'lap top' (did you mean Laptop?), ")


def test_a_refused_goal_leaves_the_one_before(policy):
    picture = np.random.default_rng(0).integers(0, 255, (300, 300, 3), np.uint8)
    policy.reset("Mug")
    first = policy.act(picture)
    policy.reset("Mug")
    with pytest.raises(ValueError, match="found goal 'Unicorn'"):
        policy.reset("Unicorn")
    np.testing.assert_array_equal(policy.act(picture).probabilities, first.probabilities)


@pytest.mark.parametrize(
    ("name", "meant"),
    [("tv", "Television"), ("cellphone", "CellPhone"), ("Labtop", "Laptop"), ("mugs", "Mug"),
     ("coffee_machine", "CoffeeMachine"), ("REMOTE-CONTROL", "RemoteControl"),
     ("potted plant", "HousePlant"), ("couch", ""), ("desk", ""), ("toilet", ""), ("", "")],
)  # fmt: skip
def test_what_was_meant(name, meant):
    assert closest(name, CATEGORIES) == meant


def test_nobody_meant_what_a_bundle_does_not_know():
    assert closest("tv", ("Laptop", "Mug")) == ""
    assert set(OTHER_NAMES.values()) <= set(CATEGORIES)


def reordered(known: Knowledge, order: np.ndarray) -> Knowledge:
    """The same knowledge of the objects in another order."""
    return replace(
        known, words=known.words[order], text=known.text[order], zones=known.zones[:, :, order],
        layout=known.layout[:, order][:, :, order], adjacency=known.adjacency[order][:, order],
    )  # fmt: skip


def answers(model, order: np.ndarray, seen: list[ModelInput]) -> torch.Tensor:
    """Logits on views whose objects come in another order."""
    state, logits = model.zero_state(len(seen[0].goal)), []
    for s in seen:
        s = replace(s, detections=s.detections[:, order], goal=s.goal[:, order])
        with torch.no_grad():
            out, _, state = model(s, state)
        logits.append(out)
    return torch.stack(logits)


@pytest.mark.parametrize(
    ("name", "inputs"), [*((name, BUILT_IN) for name in sorted(MODELS)), ("tdanet", SIGHTED)]
)
def test_zero_shot_models_have_no_weight_for_one_object_and_look_for_the_goal(name, inputs):
    torch.manual_seed(0)
    same, known = np.arange(38), knowledge(38)
    order = np.random.default_rng(0).permutation(38)
    model = outspoken(MODELS[name](inputs, SMALL, known)).eval()
    turned = MODELS[name](
        replace(inputs, objects=tuple(CATEGORIES[i] for i in order)), SMALL,
        reordered(known, order),
    ).eval()  # fmt: skip
    turned.load_state_dict(model.state_dict())
    seen = [views(inputs, 4, seed=t) for t in range(3)]
    expected = answers(model, same, seen)
    indifferent = torch.allclose(answers(turned, order, seen), expected, atol=1e-5)
    hidden = [replace(s, detections=s.detections * (1 - s.goal[:, :, None])) for s in seen]
    looks = not torch.allclose(answers(model, same, hidden), expected, atol=1e-5)
    assert MODELS[name].zero_shot == (indifferent and looks)
