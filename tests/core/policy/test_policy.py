"""Asking a policy's predictor beside its decisions disturbs neither."""

from pathlib import Path

import numpy as np
import pytest

from cfnav_core.learn.export import export_bundle
from cfnav_core.policy.bundle import shipped_perception
from cfnav_core.policy.policy import Policy
from cfnav_core.task.actions import Action
from tests.core.model_samples import save_fresh

PERCEPTION = shipped_perception()
PICTURES = np.random.default_rng(0).integers(0, 255, (6, 160, 160, 3), np.uint8)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("bundle")
    checkpoint = save_fresh(root / "best.safetensors", "tdanet", PERCEPTION, ("Mug",))
    export_bundle(checkpoint, PERCEPTION, root / "bundle", "words")
    return root / "bundle"


def drive(policy, given, watched):
    """Decisions and what the predictor said beside them; every third MoveAhead is overruled."""
    policy.reset("Mug")
    made, predicted = [], []
    for i, picture in enumerate(PICTURES):
        seen = policy.look(picture)
        if watched:
            predicted.append(policy.predict_collision(seen))
        made.append(policy.decide(seen, given) if watched else policy.act(picture, given))
        if i % 3 == 2:
            policy.executed(Action.RotateLeft)
    return made, predicted


@pytest.mark.parametrize("backend", ["onnx", "torch"])
@pytest.mark.parametrize("given", [None, 0.25])
def test_being_watched_changes_no_answer(bundle, backend, given):
    policy = Policy.load(bundle, backend)
    plain, _ = drive(policy, given, watched=False)
    watched, _ = drive(policy, given, watched=True)
    for a, b in zip(plain, watched, strict=True):
        np.testing.assert_array_equal(a.probabilities, b.probabilities)
        assert (a.action, a.collision_probability) == (b.action, b.collision_probability)
        assert a.detection_score == b.detection_score


@pytest.mark.parametrize("backend", ["onnx", "torch"])
def test_the_predictor_says_what_it_would_supply(bundle, backend):
    policy = Policy.load(bundle, backend)
    made, predicted = drive(policy, None, watched=True)
    assert predicted == [d.collision_probability for d in made]
    assert len(set(predicted)) == len(PICTURES)
    # It sees the same pictures and actions when the LiDAR supplies p_hat instead.
    policy.reset("Mug")
    for picture, decision, expected in zip(PICTURES, made, predicted, strict=True):
        seen = policy.look(picture)
        assert policy.predict_collision(seen) == expected
        assert policy.decide(seen, 0.5).collision_probability == 0.5
        policy.executed(decision.action)
        if expected in predicted[2::3]:
            policy.executed(Action.RotateLeft)


@pytest.mark.parametrize("backend", ["onnx", "torch"])
def test_its_own_probability_counts_where_it_is_larger(bundle, backend):
    policy = Policy.load(bundle, backend)
    _, predicted = drive(policy, 0.0, watched=True)
    between = (min(predicted) + max(predicted)) / 2
    policy.reset("Mug")
    given = [policy.decide(policy.look(p), between, "both") for p in PICTURES]
    counted = [d.collision_probability for d in given]
    # from the second picture on it also depends on what was done
    assert counted[0] == pytest.approx(max(predicted[0], between))
    assert min(counted) == pytest.approx(between)
    assert max(counted) > between
    policy.reset("Mug")
    own = [policy.decide(policy.look(p), 0.0, "both") for p in PICTURES]
    policy.reset("Mug")
    alone = [policy.decide(policy.look(p)) for p in PICTURES]
    for a, b in zip(own, alone, strict=True):
        np.testing.assert_array_equal(a.probabilities, b.probabilities)


def test_a_new_episode_begins_with_an_empty_memory(bundle):
    policy = Policy.load(bundle)
    assert drive(policy, 0.5, watched=True)[1] == drive(policy, 0.5, watched=True)[1]


def test_the_predictor_needs_a_goal_too(bundle):
    policy = Policy.load(bundle)
    seen = policy.look(PICTURES[0])
    with pytest.raises(ValueError, match="call reset"):
        policy.predict_collision(seen)
    with pytest.raises(ValueError, match="call reset"):
        policy.decide(seen)


def test_a_bundle_that_looks_rooms_up_must_be_told_which_one_it_is_in():
    picture = np.random.default_rng(0).integers(0, 255, (300, 300, 3), np.uint8)
    policy = Policy.load("lstde")
    assert policy.admits("Mug").startswith("found no room type for lstde, which looks up what goes")
    for begin in (lambda: policy.reset("Mug"), lambda: policy.act(picture, goal="Mug")):
        with pytest.raises(ValueError, match="say which one the robot is in: kitchen, living_room"):
            begin()
    answers = []
    for room_type in ("kitchen", "bathroom"):
        policy.reset("Mug", room_type)
        answers.append(policy.act(picture).probabilities)
    assert not np.array_equal(*answers)

    told = Policy.load("lstde", room_type="bathroom")
    assert not told.admits("Mug")
    np.testing.assert_array_equal(told.act(picture, goal="Mug").probabilities, answers[1])
    with pytest.raises(ValueError, match="found room type 'attic', expected one that lstde knows"):
        Policy.load("lstde", room_type="attic")
    assert not Policy.load().admits("Mug")  # the others do not read it
