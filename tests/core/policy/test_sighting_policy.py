"""A bundle that reads what a detector says: exported, loaded, asked, tested."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cfnav_core.detect.sightings import Sighting
from cfnav_core.learn.evaluate import evaluate, paired_difference
from cfnav_core.learn.export import export_bundle
from cfnav_core.perception.perception import NETWORKS, PerceptionError
from cfnav_core.policy.bundle import PERCEPTION, BundleHead
from cfnav_core.policy.policy import Policy
from cfnav_core.scenes.scene import SceneError
from tests.core.model_samples import save_fresh
from tests.core.worlds import hall, sighted

MUG = Sighting("Mug", 0.9, 0.1, -0.2, 0.1, 0.1, 1.2)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_fresh(tmp_path_factory.mktemp("run") / "best.safetensors", "tdanet", None, ("Mug",))


@pytest.fixture(scope="module")
def bundle(checkpoint: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "boxes"
    export_bundle(checkpoint, None, out, "boxes")
    return out


def test_a_bundle_without_pictures_has_no_perception(bundle: Path) -> None:
    head = BundleHead.load(bundle)
    assert head.reads_sightings
    assert PERCEPTION not in head.files
    assert not (bundle / PERCEPTION).exists()
    assert "object detector" in (bundle / "MODEL_CARD.md").read_text()


@pytest.mark.parametrize("backend", ["onnx", "torch"])
def test_it_decides_by_sightings_and_by_them_alone(bundle: Path, backend) -> None:
    policy = Policy.load(bundle, backend)
    policy.reset("Mug")
    seen = policy.act([MUG], 0.3)
    assert seen.probabilities.sum() == pytest.approx(1, abs=1e-5)
    assert seen.collision_probability == pytest.approx(0.3)
    assert seen.detection_score == pytest.approx(0.9, abs=1e-3)
    policy.reset("Mug")
    nothing = policy.act([], 0.3)
    assert nothing.detection_score == 0
    assert not np.allclose(nothing.probabilities, seen.probabilities)
    with pytest.raises(PerceptionError, match="expected sightings"):
        policy.act(np.zeros((300, 300, 3), np.uint8), 0.3)


@pytest.mark.parametrize("p_hat", [None, "own", "both"])
def test_its_predictor_which_learnt_from_pictures_is_not_asked(bundle: Path, p_hat) -> None:
    policy = Policy.load(bundle)
    policy.reset("Mug")
    with pytest.raises(ValueError, match="nothing is known"):
        policy.act([MUG], 0.3 if p_hat else None, p_hat)
    with pytest.raises(ValueError, match="found no picture for the predictor"):
        policy.predict_collision(policy.look([MUG]))


def test_a_perception_is_neither_wanted_nor_spared(checkpoint: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"found .*\.onnx.*give no --perception"):
        export_bundle(checkpoint, NETWORKS["mast"], tmp_path / "a", "a")
    other = save_fresh(tmp_path / "best.safetensors", "tdanet", NETWORKS["mast"], ("Mug",))
    with pytest.raises(ValueError, match=r"found no perception for .*give the perception"):
        export_bundle(other, None, tmp_path / "b", "b")


def test_goals_that_it_never_trained_on_are_told_apart(bundle: Path, tmp_path: Path) -> None:
    sighted(hall()).save(tmp_path / "kitchen_00000")
    found = evaluate(bundle, tmp_path, 40, 0, p_hat="true", rooms=["kitchen:0"], sample=True)
    assert set(found.trained) == {True, False}  # Mug and Laptop
    every, parts = found.summary(), (found.trained, ~found.trained)
    for key, chosen in zip(("trained_goals", "other_goals"), parts, strict=True):
        assert every[key]["episodes"] == chosen.sum()
        assert every[key]["sr"] == np.mean([r.success for r in np.array(found.results)[chosen]])
    better = [replace(r, success=True, collisions=0) for r in found.results]
    rose = paired_difference(replace(found, results=better), found)["other_goals"]
    assert rose["cf_sr_difference"] == pytest.approx(1 - every["other_goals"]["cf_sr"])
    known = replace(found, goals=("Laptop", "Mug"))
    assert known.summary()["other_goals"] is None
    assert paired_difference(known, found)["other_goals"] is None


def test_it_is_tested_in_scenes_of_any_detector(bundle: Path, tmp_path: Path) -> None:
    seen = hall()
    for made_by in ("boxes", "another"):
        sighted(seen, made_by).save(tmp_path / made_by / "kitchen_00000")
        assert (
            len(evaluate(bundle, tmp_path / made_by, 5, 0, p_hat="true", rooms=[seen.name]).results)
            == 5
        )
    seen.save(tmp_path / "scores" / "kitchen_00000")
    with pytest.raises(SceneError, match="cfnav rooms boxes"):
        evaluate(bundle, tmp_path / "scores", 5, 0, p_hat="zero", rooms=[seen.name])
    with pytest.raises(ValueError, match=r"sees no pictures on the robot.*choose lidar"):
        evaluate(bundle, tmp_path / "boxes", 5, 0, rooms=[seen.name])


def test_a_model_that_reads_pictures_too_is_no_bundle_without_them(tmp_path: Path) -> None:
    checkpoint = save_fresh(tmp_path / "best.safetensors", "compact", None, ("Mug",))
    with pytest.raises(ValueError, match="reads features of pictures beside sightings"):
        export_bundle(checkpoint, None, tmp_path / "out", "out")
    assert not (tmp_path / "out").exists()


def test_answers_that_are_no_numbers_are_no_decision(bundle: Path) -> None:
    policy = Policy.load(bundle)
    policy.reset("Mug")
    with pytest.raises(ValueError, match="not finite"):
        policy.act([replace(MUG, azimuth=float("nan"))], 0.3)
