"""COCO detectors beside perception: their boxes matched with things, their scores by category."""

from __future__ import annotations

import numpy as np
import pytest

from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.detectors import category_scores, load_detector, paired
from tests.core.detect.made import constant_network
from tests.studies.eyes.made import constant_detector


def test_each_box_and_each_thing_is_in_one_pair():
    assert paired(np.array([[0.9, 0.8], [0.7, 0.1]]), 0.5).tolist() == [True, False]
    assert paired(np.array([[0.9, 0.8], [0.7, 0.6]]), 0.5).tolist() == [True, True]
    assert paired(np.array([[0.49]]), 0.5).tolist() == [False]
    assert paired(np.empty((0, 2)), 0.5).tolist() == []
    assert paired(np.empty((1, 0)), 0.5).tolist() == [False]


def test_scores_are_by_category(tmp_path):
    rows = [[0, 0, 256, 512, 0.8, 56], [-9, 0, 600, 512, 0.6, 57], [0, 0, 9, 9, 0.3, 56]]
    detector = load_detector(constant_detector(tmp_path / "constant.onnx", rows))
    scores = category_scores(detector, np.zeros((30, 40, 3), np.uint8))
    assert scores[CATEGORIES.index("Chair")] == pytest.approx(0.8)
    assert scores[CATEGORIES.index("Mug")] == 0
    assert np.isnan(scores[CATEGORIES.index("Blinds")])


def test_coco_ssd_counts_as_coco_does(tmp_path):
    scores = np.zeros((1, 1, 90), np.float32)
    scores[0, 0, 77 - 1] = 0.7  # COCO's number of a cell phone
    boxes = np.array([[[[0.1, 0.2, 0.5, 0.9]]]], np.float32)
    path = constant_network(
        tmp_path / "ssd.onnx",
        {"Postprocessor/Slice:0": scores, "Postprocessor/ExpandDims_1:0": boxes},
        (1, "high", "wide", 3), "image_tensor:0",
    )  # fmt: skip
    detector = load_detector(path)
    assert detector.size == (300, 300)
    (phone,) = detector(np.zeros((100, 100, 3), np.uint8))
    assert phone.name == "cell phone"
    assert phone.box == pytest.approx((20, 10, 90, 50))
    found = category_scores(detector, np.zeros((100, 100, 3), np.uint8))
    assert found[CATEGORIES.index("CellPhone")] == pytest.approx(0.7)


def test_another_network_is_refused(tmp_path):
    other = constant_network(tmp_path / "other.onnx", {"y": np.zeros((1, 3), np.float32)})
    with pytest.raises(ValueError, match="could be anything"):
        load_detector(other)
