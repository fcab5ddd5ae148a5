"""Errors of a detector that true boxes are given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from cfnav_core.detect.errors import SHIPPED, ErrorModel, Recall, Thing
from cfnav_core.perception.boxes import Detection

SIZE, DEGREE = (448, 252), 6.0
NAMES = ("Bowl", "Chair", "Mug")
PERFECT = ErrorModel(Recall(50, 0, 0, 0, {}), 0.3, (2, 2), (1, 3), 0.0, 0.0, 0.0, {})
MUG = Thing("Mug", (100.0, 50.0, 160.0, 110.0), 1.0, 1.2)


def often(model: ErrorModel, *things: Thing, times: int = 1000) -> list[list[Detection]]:
    rng = np.random.default_rng(0)
    said = (model.says(things, NAMES, SIZE, DEGREE, rng) for _ in range(times))
    return [[one for one, _ in each] for each in said]


def test_without_errors_the_truth_is_said() -> None:
    ((one,),) = often(PERFECT, MUG, replace(MUG, name="Apple"), times=1)  # which it lacks
    assert (one.name, one.box) == ("Mug", MUG.box)
    assert 0.3 <= one.score <= 1


def test_a_detector_may_find_nothing_at_all() -> None:
    none = replace(PERFECT, recall=Recall(-1000, 0, 0, 0, {}))
    assert often(none, MUG, times=20) == [[]] * 20


def test_things_are_missed_as_often_as_the_model_says() -> None:
    recall = Recall(-6.0, 1.0, 2.0, -0.5, {"Mug": 1.0})
    model = replace(PERFECT, recall=recall)
    for thing in (MUG, replace(MUG, share=0.2), replace(MUG, distance=3.0)):
        found = np.mean([len(one) for one in often(model, thing)])
        assert found == pytest.approx(recall.probability(thing, 10.0), abs=0.08)
    near, far = (recall.probability(replace(MUG, distance=d), 10.0) for d in (1, 4))
    small, large = (recall.probability(MUG, degrees) for degrees in (2, 20))
    assert near > far
    assert large > small


def test_boxes_jitter_by_a_share_of_their_size_within_the_picture() -> None:
    model = replace(PERFECT, jitter=0.1)
    boxes = np.array([one[0].box for one in often(model, MUG)])
    assert (boxes - MUG.box).std(0) == pytest.approx(np.full(4, 6.0), rel=0.15)
    edge = Thing("Mug", (0.0, 0.0, 60.0, 60.0), 0.5, 1.0)
    boxes = np.array([one[0].box for one in often(model, edge)])
    assert boxes.min() == 0


def test_false_alarms_come_as_often_as_the_model_says_and_lie_in_the_picture() -> None:
    said = often(replace(PERFECT, false_alarms=0.5 / len(NAMES)))
    assert np.mean([len(one) for one in said]) == pytest.approx(0.5, abs=0.1)
    boxes = np.array([one.box for many in said for one in many])
    assert boxes.min() >= 0
    assert (boxes[:, 2:] <= SIZE).all()
    assert {one.name for many in said for one in many} == set(NAMES)


def test_a_thing_is_confused_with_what_it_is_confused_with() -> None:
    model = replace(PERFECT, confused=0.3, confusions={"Mug": {"Bowl": 2, "Plate": 5}})
    names = [one[0].name for one in often(model, MUG)]
    assert set(names) == {"Mug", "Bowl"}  # a plate is no name of this detector
    assert np.mean([name == "Bowl" for name in names]) == pytest.approx(0.3, abs=0.07)


def test_a_detector_of_one_class_confuses_nothing() -> None:
    model, rng = replace(PERFECT, confused=1.0), np.random.default_rng(0)
    ((one, _),) = model.says([MUG], ["Mug"], SIZE, DEGREE, rng)
    assert one.name == "Mug"


def test_the_shipped_errors_are_a_detectors() -> None:
    model = ErrorModel.load()
    small, large = (model.recall.probability(MUG, degrees) for degrees in (2, 20))
    assert 0 < small < large < 1
    assert model.recall.share > 0 >= model.recall.distance
    assert 0 < model.jitter < 0.5


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"jitter": "x"}, "not supported"), ({"found": [0, -1]}, "found is"),
        ({"least": None}, "not supported"), ({"confused": 2}, "confused is 2"),
        ({"confusions": {"Mug": {"Bowl": 0}}}, "weight"), ({"confusions": None}, "no attribute"),
    ],
)  # fmt: skip
def test_numbers_that_make_no_sense_are_refused(tmp_path: Path, change: dict, why: str) -> None:
    path = tmp_path / "errors.yaml"
    path.write_text(yaml.safe_dump(yaml.safe_load(SHIPPED.read_text()) | change))
    with pytest.raises(ValueError, match=why):
        ErrorModel.load(path)


@pytest.mark.parametrize("text", ["", "recall: 3", "{"])
def test_a_file_that_says_no_errors_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "errors.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"no readable errors of a detector in .*studies"):
        ErrorModel.load(path)
