"""A bundle that may be asked for names that its policy never trained with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cfnav_core import words
from cfnav_core.detect.sightings import Sighting
from cfnav_core.learn.candidate import Candidate, check_fits
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, evaluate, run_episodes
from cfnav_core.learn.export import export_bundle
from cfnav_core.learn.further import names_of
from cfnav_core.learn.model_card import model_card
from cfnav_core.models.base import Knowledge
from cfnav_core.perception.perception import NETWORKS
from cfnav_core.policy.bundle import BundleHead
from cfnav_core.policy.policy import Policy
from cfnav_core.task.camera import CAMERAS
from cfnav_core.task.vocabulary import CATEGORIES
from cfnav_core.words import WordError
from tests.core.model_samples import save_fresh
from tests.core.worlds import hall, sighted

WORDS = Knowledge(words=words.vectors(CATEGORIES))
CUP = Sighting("Mug", 0.9, 0.1, -0.2, 0.1, 0.1, 1.2)


def seen_as(name: str) -> list[Sighting]:
    return [Sighting(name, 0.9, 0.1, -0.2, 0.1, 0.1, 1.2)]


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "best.safetensors"
    return save_fresh(path, "tdanet", None, ("Mug",), WORDS)


@pytest.fixture(scope="module")
def wider(checkpoint: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "boxes"
    export_bundle(checkpoint, None, out, "boxes", also=["coco", "traffic cone", "Mug"])
    return out


def test_its_card_names_the_camera_that_it_learnt_from_or_says_that_there_were_several(
    wider: Path,
) -> None:
    head = BundleHead.load(wider)
    card = model_card(replace(head, camera=CAMERAS["stock_wide"]))
    assert "it learnt from a camera at 0.244 m, 66 by 40 degrees" in card
    assert "it learnt from several cameras." in model_card(replace(head, camera=None))


@pytest.mark.parametrize("backend", ["onnx", "torch"])
def test_it_looks_for_a_name_that_a_detector_knows(wider: Path, backend: str) -> None:
    policy = Policy.load(wider, backend)
    assert policy.admits("suitcase") == "" == policy.admits("traffic cone")
    policy.reset("suitcase")
    there = policy.act(seen_as("suitcase"), 0.1)
    assert there.detection_score == pytest.approx(0.9, abs=1e-3)
    policy.reset("suitcase")
    elsewhere = policy.act(seen_as("dog"), 0.1)
    assert elsewhere.detection_score == 0
    assert not np.allclose(there.probabilities, elsewhere.probabilities)


def test_its_weights_are_judged_as_the_bundle_is(wider: Path) -> None:
    scene = sighted(hall())
    bank = SceneBank([scene])
    of_bundle, of_weights = (Candidate.load(p) for p in (wider, wider / "weights.safetensors"))
    assert of_weights.objects == of_bundle.objects == CATEGORIES
    check_fits(of_weights, wider / "weights.safetensors", bank, Path("scenes"))
    episodes = Episodes.draw(bank, 20, 0)
    ends = [run_episodes(c.networks, bank, episodes, p_hat="zero") for c in (of_bundle, of_weights)]
    assert ends[0] == ends[1]


def test_it_answers_as_before_where_it_sees_none_of_them(
    checkpoint: Path, wider: Path, tmp_path: Path
) -> None:
    export_bundle(checkpoint, None, tmp_path / "boxes", "boxes")
    said = []
    for folder in (tmp_path / "boxes", wider):
        policy = Policy.load(folder)
        policy.reset("Sink")
        said.append([policy.act([CUP, *seen_as("Sink")], p).probabilities for p in (0.1, 0.9)])
    np.testing.assert_allclose(said[0], said[1], atol=1e-6)


def test_what_it_never_trained_with_says_nothing_while_another_thing_is_the_goal(
    wider: Path,
) -> None:
    answers = []
    for beside in ([], seen_as("suitcase"), seen_as("dog") + seen_as("bed")):
        policy = Policy.load(wider)
        policy.reset("Sink")
        answers.append(policy.act([CUP, *beside], 0.1).probabilities)
    np.testing.assert_array_equal(answers[0], answers[1])
    np.testing.assert_array_equal(answers[0], answers[2])


def test_it_is_judged_in_the_scenes_that_it_was_trained_in(
    checkpoint: Path, wider: Path, tmp_path: Path
) -> None:
    export_bundle(checkpoint, None, tmp_path / "boxes", "boxes")
    sighted(hall()).save(tmp_path / "scenes" / "kitchen_00000")
    found = [
        evaluate(folder, tmp_path / "scenes", 20, 0, p_hat="true", rooms=["kitchen:0"])
        for folder in (tmp_path / "boxes", wider)
    ]
    assert found[0].results == found[1].results
    steps = zip(*(one.trace for one in found), strict=True)
    assert all((a.actions == b.actions).all() for a, b in steps)


def test_the_card_and_a_refusal_stay_readable(wider: Path) -> None:
    head = BundleHead.load(wider)
    assert head.goals == ("Mug",)
    assert len(head.objects) == len(set(head.objects)) == 38 + 80 - 16 + 1
    assert "suitcase" in (wider / "MODEL_CARD.md").read_text()
    assert Policy.load(wider).admits("unicorn") == (
        "found goal 'unicorn', expected one of Mug, or of 102 others (cfnav info shows them)"
    )


def test_maps_of_labels_stand_for_their_names() -> None:
    assert names_of(["voc", "Zebra", "Chair"])[-3:] == ("train", "Television", "Zebra")
    assert "Chair" in names_of(["voc"])  # what cfnav calls it
    assert not {"chair", "tvmonitor"} & set(names_of(["voc"]))
    assert names_of(["cup"]) == ("Mug",)


def test_a_name_without_a_word_vector_is_refused(checkpoint: Path, tmp_path: Path) -> None:
    with pytest.raises(WordError, match="no word vector for Zeppelin"):
        export_bundle(checkpoint, None, tmp_path / "boxes", "boxes", also=["Zeppelin"])
    assert not (tmp_path / "boxes").exists()


@pytest.mark.parametrize(
    ("model", "perception", "known", "message"),
    [
        ("mjolnir", None, None, "found model mjolnir in .*weights for single objects.*tdanet"),
        ("tdanet", NETWORKS["mast"], None, r"what a perception detects.*cfnav rooms boxes"),
        ("tdanet", None, None, "found other word vectors"),
    ],
)
def test_others_are_refused(
    model, perception: Path | None, known: Knowledge | None, message: str, tmp_path: Path
) -> None:
    checkpoint = save_fresh(tmp_path / "best.safetensors", model, perception, ("Mug",), known)
    with pytest.raises(ValueError, match=message):
        export_bundle(checkpoint, perception, tmp_path / "boxes", "boxes", also=["coco"])
