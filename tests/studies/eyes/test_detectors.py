"""COCO detectors are decoded right."""

from __future__ import annotations

import numpy as np
import pytest
from onnx import TensorProto, helper

from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.detectors import (
    COCO,
    COCO_IDS,
    Detector,
    kept,
    letterboxed,
    nanodet_boxes,
    paired,
)
from tests.studies.eyes.made import constant_detector, save


def test_each_box_and_each_thing_is_in_one_pair():
    assert paired(np.array([[0.9, 0.8], [0.7, 0.1]]), 0.5).tolist() == [True, False]
    assert paired(np.array([[0.9, 0.8], [0.7, 0.6]]), 0.5).tolist() == [True, True]
    assert paired(np.array([[0.49]]), 0.5).tolist() == [False]
    assert paired(np.empty((0, 2)), 0.5).tolist() == []
    assert paired(np.empty((1, 0)), 0.5).tolist() == [False]


def test_coco_has_80_classes():
    assert len(COCO) == len(COCO_IDS) == 80
    assert dict(zip(COCO, COCO_IDS, strict=True))["toothbrush"] == 90
    assert dict(zip(COCO, COCO_IDS, strict=True))["chair"] == 62


def test_a_nanodet_box_lies_around_its_cell():
    """One cell of the middle scale says distances of 1, 2, 3 and 4 cells."""
    out = [np.zeros((n * n, 80), np.float32) for n in (52, 26, 13)]
    out += [np.zeros((n * n, 44), np.float32) for n in (52, 26, 13)]
    cell = 10 * 26 + 5  # row 10, column 5
    out[1][cell, 56] = 0.9
    for side, away in enumerate((1, 2, 3, 4)):
        out[4][cell, side * 11 + away] = 50.0
    boxes, scores = nanodet_boxes(out)
    at = int(scores[:, 56].argmax())
    assert boxes[at] * 26 == pytest.approx([5.5 - 1, 10.5 - 2, 5.5 + 3, 10.5 + 4], abs=1e-3)


def test_a_letterbox_keeps_the_aspect():
    square, place = letterboxed(np.full((50, 100, 3), 200, np.uint8), 40)
    assert place.tolist() == [0, 0.25, 1, 0.5]
    assert (square[10:30] == 200).all()
    assert not square[:10].any()
    assert not square[30:].any()


def test_the_weaker_of_two_boxes_is_dropped():
    boxes = np.array([[0, 0, 1, 1], [0, 0, 1, 0.9], [0, 0, 0.3, 0.3], [0, 0, 1, 1]])
    assert kept(boxes, np.array([0.5, 0.6, 0.4, 0.05]), 0.1) == [1, 2]


def test_detections_are_in_pixels_and_scores_by_category(tmp_path):
    rows = [[0, 0, 256, 512, 0.8, 56], [-9, 0, 600, 512, 0.6, 57], [0, 0, 9, 9, 0.3, 56]]
    detector = Detector(constant_detector(tmp_path / "constant.onnx", rows))
    picture = np.zeros((30, 40, 3), np.uint8)
    chair, couch = detector(picture, 0.5)
    assert (chair.name, couch.name) == ("chair", "couch")
    assert chair.box == pytest.approx((0, 0, 20, 30))
    assert couch.box == pytest.approx((0, 0, 40, 30))
    scores = detector.scores(picture)
    assert scores[CATEGORIES.index("Chair")] == pytest.approx(0.8)
    assert scores[CATEGORIES.index("Mug")] == 0
    assert np.isnan(scores[CATEGORIES.index("Blinds")])


def test_coco_ssd_gives_top_before_left_and_counts_to_90(tmp_path):
    scores = np.zeros((1, 1, 90), np.float32)
    scores[0, 0, 77 - 1] = 0.7  # COCO's number of a cell phone
    path = save(
        [
            helper.make_node("Cast", ["image_tensor:0"], ["numbers"], to=TensorProto.FLOAT),
            helper.make_node("ReduceMean", ["numbers"], ["mean"], keepdims=0),
            helper.make_node("Mul", ["mean", "none"], ["zero"]),
            helper.make_node("Add", ["scores", "zero"], ["Postprocessor/Slice:0"]),
            helper.make_node("Add", ["boxes", "zero"], ["Postprocessor/ExpandDims_1:0"]),
        ],
        [helper.make_tensor_value_info("image_tensor:0", TensorProto.UINT8, [1, 300, 300, 3])],
        [
            helper.make_tensor_value_info(f"Postprocessor/{name}:0", TensorProto.FLOAT, None)
            for name in ("Slice", "ExpandDims_1")
        ],
        {
            "none": np.float32(0), "scores": scores,
            "boxes": np.array([[[[0.1, 0.2, 0.5, 0.9]]]], np.float32),
        },
        tmp_path / "ssd.onnx",
    )  # fmt: skip
    (phone,) = Detector(path)(np.zeros((100, 100, 3), np.uint8))
    assert phone.name == "cell_phone"
    assert phone.box == pytest.approx((20, 10, 90, 50))


def test_another_network_is_refused(tmp_path):
    other = save(
        [helper.make_node("Identity", ["x"], ["y"])],
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, [1])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, [1])],
        {},
        tmp_path / "other.onnx",
    )
    with pytest.raises(ValueError, match="expected a detector"):
        Detector(other)
