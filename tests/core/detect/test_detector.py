"""Detectors in ONNX files: each head decoded, told by its outputs, and refused when in doubt."""

from __future__ import annotations

import numpy as np
import pytest
from onnx import TensorProto

from cfnav_core.detect.detector import MOST, OnnxDetector, recognise
from cfnav_core.detect.heads import HEADS, NANODETS
from cfnav_core.detect.pictures import Input
from tests.core.detect.made import constant_network

CHAIR, CUP = 56, 41
PICTURE = np.zeros((160, 320, 3), np.uint8)
"""Twice as wide as high, as the input of the networks here, 32x64: five pixels are one of it."""
BOX = (50, 25, 150, 125)
"""In pixels of the picture: middle (20, 15), size (20, 20) in those of the input."""


def one_class(count: int, number: int, score: float) -> list[float]:
    row = [0.0] * count
    row[number] = score
    return row


def yolov5(score=0.8):
    rows = np.zeros((1, 30, 85), np.float32)
    rows[0, 7] = [20, 15, 20, 20, 0.9, *one_class(80, CHAIR, score / 0.9)]
    return {"output0": rows}


def yolov8(score=0.8):
    rows = np.zeros((1, 30, 84), np.float32)
    rows[0, 7] = [20, 15, 20, 20, *one_class(80, CHAIR, score)]
    return {"output0": rows.transpose(0, 2, 1)}


def yolov10(number=CHAIR):
    return {"output0": np.array([[[10, 5, 30, 25, 0.8, number]] + [[0.0] * 6] * 9], np.float32)}


def yolox():
    rows = np.zeros((1, 4 * 8 + 2 * 4 + 1 * 2, 85), np.float32)
    size = np.log(20 / 16)
    rows[0, 32] = [20 / 16, 15 / 16, size, size, 0.9, *one_class(80, CHAIR, 0.8 / 0.9)]
    return {"output": rows}


def rtdetr():
    return {
        "labels": np.array([[CHAIR, 0]]),
        "boxes": np.array([[[10, 5, 30, 25], [0, 0, 1, 1]]], np.float32),
        "scores": np.array([[0.8, 0.0]], np.float32),
    }


def rtdetr_rows():
    row = [20 / 64, 15 / 32, 20 / 64, 20 / 32, *one_class(80, CHAIR, 0.8)]
    return {"output0": np.array([[row, [0.0] * 84]], np.float32)}


def nanodet(head="nanodet", bins=8):
    """A cell of the first scale at (20, 12), or (16, 8), from which a box reaches so many cells."""
    of = NANODETS[head]
    rows = np.zeros((1, sum(h * w for h, w in of.cells((32, 64))), 80 + 4 * bins), np.float32)
    cell = rows[0, 1 * 8 + 2]
    cell[CHAIR] = 0.8
    x, y = (2 + of.middle) * 8, (1 + of.middle) * 8
    for side, away in enumerate(((x - 10) / 8, (y - 5) / 8, (30 - x) / 8, (25 - y) / 8)):
        low = int(away)
        cell[80 + side * bins : 80 + (side + 1) * bins] = -30
        cell[80 + side * bins + low] = np.log(max(1 - (away - low), 1e-9))
        cell[80 + side * bins + low + 1] = np.log(max(away - low, 1e-9))
    return {"output": rows}


def ssd():
    return {
        "detection_boxes": np.array([[[5 / 32, 10 / 64, 25 / 32, 30 / 64]]], np.float32),
        "detection_classes": np.array([[62]], np.float32),
        "detection_scores": np.array([[0.8]], np.float32),
        "num_detections": np.array([1], np.float32),
    }


def raw_ssd():
    scores = np.zeros((1, 3, 90), np.float32)
    scores[0, 1, 62 - 1] = 0.8
    boxes = np.zeros((1, 3, 1, 4), np.float32)
    boxes[0, 1, 0] = [5 / 32, 10 / 64, 25 / 32, 30 / 64]
    return {"Postprocessor/ExpandDims_1:0": boxes, "Postprocessor/Slice:0": scores}


def centernet():
    rows = np.array([[[10, 5, 30, 25, 0.8, CHAIR]]], np.float32)
    return {"tower_0/detections:0": rows}


KINDS = [
    ("yolov5", yolov5(), {"said": {"stride": "32"}}),
    ("yolov8", yolov8(), {}),
    ("yolov10", yolov10(), {}),
    ("rtdetr", rtdetr(), {"asks": "orig_target_sizes"}),
    ("rtdetr", rtdetr_rows(), {}),
    ("nanodet", nanodet(), {}),
    ("nanodet", nanodet(bins=11), {}),
    ("nanodet_plus", nanodet("nanodet_plus"), {}),
    ("centernet", centernet(), {"shape": (1, 32, 64, 3)}),
    ("ssd", ssd(), {"shape": (1, 32, 64, 3), "kind": TensorProto.UINT8, "labels": "coco_ids"}),
    ("raw_ssd", raw_ssd(), {"shape": (1, 32, 64, 3), "labels": "coco_ids"}),
    ("yolox", yolox(), {"head": "yolox"}),
]


@pytest.mark.parametrize(("head", "outputs", "more"), KINDS)
def test_each_head_finds_the_chair(tmp_path, head, outputs, more):
    """Told by its outputs, but for YOLOX, whose rows are those of YOLO v5."""
    labels, named = more.pop("labels", "coco"), more.pop("head", "")
    path = constant_network(tmp_path / "made.onnx", outputs, **more)
    detector = OnnxDetector(path, labels, named)
    assert detector.head == head
    (chair,) = detector(PICTURE)
    assert chair.name == "chair"
    assert chair.score == pytest.approx(0.8, abs=1e-5)
    assert chair.box == pytest.approx(BOX, abs=0.01)


def test_every_head_is_tried():
    assert {head for head, _, _ in KINDS} == HEADS.keys()


@pytest.mark.parametrize("picture", [(160, 160), (32, 128)])
def test_boxes_lie_in_the_picture_whatever_surrounds_it(tmp_path, picture):
    """A square stands in the middle of 64x32, a strip is half as high; boxes end at its edges."""
    detector = OnnxDetector(constant_network(tmp_path / "made.onnx", yolov8()), "coco")
    high, wide = picture
    (chair,) = detector(np.zeros((high, wide, 3), np.uint8))
    scale = min(64 / wide, 32 / high)
    left, top = (64 - wide * scale) / 2, (32 - high * scale) / 2
    ends = np.array([10 - left, 5 - top, 30 - left, 25 - top]) / scale
    assert chair.box == pytest.approx(np.clip(ends, 0, [wide, high, wide, high]))


def test_what_lies_beside_the_picture_is_left_out(tmp_path):
    """A square stands in the middle of 64x32: the chair at the left is in the border."""
    rows = np.array([[[1, 5, 12, 25, 0.8, CHAIR], [20, 5, 30, 25, 0.7, CHAIR]]], np.float32)
    path = constant_network(tmp_path / "made.onnx", {"out": rows})
    (chair,) = OnnxDetector(path, "coco", "yolov10")(np.zeros((160, 160, 3), np.uint8))
    assert chair.box == pytest.approx((20, 25, 70, 125))


def test_the_weaker_of_two_boxes_of_a_class_is_dropped(tmp_path):
    outputs = yolov8()
    rows = outputs["output0"].transpose(0, 2, 1)
    rows[0, 8] = [20, 15, 20, 19, *one_class(80, CHAIR, 0.9)]
    rows[0, 9] = [20, 15, 20, 20, *one_class(80, CUP, 0.7)]
    rows[0, 10] = [50, 15, 20, 20, *one_class(80, CHAIR, 0.6)]
    rows[0, 11] = [50, 15, 20, 20, *one_class(80, CUP, 0.2)]
    detector = OnnxDetector(constant_network(tmp_path / "made.onnx", outputs), "coco")
    found = [(one.name, round(one.score, 3)) for one in detector(PICTURE)]
    assert found == [("chair", 0.9), ("cup", 0.7), ("chair", 0.6)]
    assert len(detector(PICTURE, 0.1)) == 4


def test_what_selects_by_itself_is_left_as_it_is(tmp_path):
    rows = np.array([[[10, 5, 30, 25, 0.8, CHAIR], [10, 5, 30, 24, 0.7, CHAIR]]], np.float32)
    detector = OnnxDetector(constant_network(tmp_path / "made.onnx", {"out": rows}), "coco")
    assert len(detector(PICTURE)) == 2


def test_a_flood_of_boxes_is_cut(tmp_path):
    rows = np.tile(np.array([10, 5, 30, 25, 0.8, CHAIR], np.float32), (1, MOST + 50, 1))
    detector = OnnxDetector(constant_network(tmp_path / "made.onnx", {"out": rows}), "coco")
    assert len(detector(PICTURE)) == MOST


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_boxes_and_scores_that_are_no_numbers_are_no_answer(tmp_path, broken):
    """A network that is broken must not look like a picture without things."""
    good = [10, 5, 30, 25, 0.8, CHAIR]
    rows = {
        "a box": [broken, 5, 30, 25, 0.8, CHAIR], "a score": [10, 5, 30, 25, broken, CHAIR],
        "a logit": [10, 5, 30, 25, 3.2, CHAIR],
    }  # fmt: skip
    for name, row in rows.items():
        out = {"out": np.array([[row, good]], np.float32)}
        detector = OnnxDetector(constant_network(tmp_path / f"{name}.onnx", out), "coco")
        with pytest.raises(ValueError, match=f"found {name.replace('logit', 'score')}"):
            detector(PICTURE)
    unsure = [broken, 5, 30, 25, 0.1, CHAIR]  # padding of some heads
    turned = [30, 25, 10, 5, 0.8, CHAIR]
    out = {"out": np.array([[good, unsure, turned]], np.float32)}
    (chair,) = OnnxDetector(constant_network(tmp_path / "good.onnx", out), "coco")(PICTURE)
    assert chair.box == pytest.approx(BOX)


def test_a_file_says_what_its_classes_are_called(tmp_path):
    rows = np.zeros((1, 30, 6), np.float32)
    rows[0, 7] = [20, 15, 20, 20, 0.1, 0.8]
    path = constant_network(
        tmp_path / "made.onnx", {"output0": rows.transpose(0, 2, 1)},
        said={"names": "{0: 'cup', 1: 'mug'}"},
    )  # fmt: skip
    (mug,) = OnnxDetector(path)(PICTURE)
    assert mug.name == "mug"
    assert OnnxDetector(path).labels.category("1") == "mug"


def test_an_input_of_any_size_needs_a_side(tmp_path):
    path = constant_network(tmp_path / "made.onnx", yolov8(), shape=(1, 3, "high", "wide"))
    assert OnnxDetector(path, "coco", side=32).size == (32, 32)
    with pytest.raises(ValueError, match=r"input of any size .* say which side"):
        OnnxDetector(path, "coco")


@pytest.mark.parametrize(
    ("outputs", "more", "found"),
    [
        (yolov8(), {}, r"found no names of classes .* say which labels"),
        (yolov5(), {"labels": "coco"}, "could be yolov5 or yolox; say which head"),
        ({"x": np.zeros((1, 3), np.float32)}, {"labels": "coco"}, "could be anything"),
        (yolov8(), {"labels": "coco", "head": "yolo"}, "found the head 'yolo', expected one of"),
        (yolov8(), {"labels": "coco", "shape": (1, 4, 32, 64)}, "expected pictures of 3 channels"),
    ],
)
def test_a_detector_in_doubt_is_refused(tmp_path, outputs, more, found):
    shape = more.pop("shape", (1, 3, 32, 64))
    path = constant_network(tmp_path / "made.onnx", outputs, shape)
    with pytest.raises(ValueError, match=found) as told:
        OnnxDetector(path, **more)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("head", ["ssd", "rtdetr", "yolov10", "nanodet"])
def test_outputs_that_a_named_head_cannot_read_are_told_at_once(tmp_path, head):
    path = constant_network(tmp_path / "made.onnx", {"x": np.zeros((1, 7, 3), np.float32)})
    with pytest.raises(ValueError, match=f"cannot be read as {head}") as told:
        OnnxDetector(path, "coco", head)
    assert "\n" not in str(told.value)


def test_no_detector(tmp_path):
    path = tmp_path / "none.onnx"
    with pytest.raises(ValueError, match="found no usable detector"):
        OnnxDetector(path, "coco")
    path.write_bytes(b"no network")
    with pytest.raises(ValueError, match="found no usable detector"):
        OnnxDetector(path, "coco")


@pytest.mark.parametrize("number", [-1, 80])
def test_a_class_without_a_name_is_told(tmp_path, number):
    path = constant_network(tmp_path / "made.onnx", yolov10(number))
    with pytest.raises(ValueError, match=f"found the class {number}, expected 0 to 79"):
        OnnxDetector(path, "coco")(PICTURE)


def test_scores_of_other_classes_than_the_labels_are_told(tmp_path):
    path = constant_network(tmp_path / "made.onnx", yolov8())
    with pytest.raises(ValueError, match="found scores of 80 classes, expected 21"):
        OnnxDetector(path, "voc", "yolov8")(PICTURE)


def test_one_class_more_makes_other_heads_possible():
    """Rows of six are YOLO v10's, v5's of one class and RT-DETR's of two."""
    shapes = {"output0": (1, 300, 6)}
    assert recognise(shapes, 80, {}, (32, 64))[0] == "yolov10"
    assert recognise(shapes, 2, {}, (32, 64))[0] == "yolov10 or rtdetr"
    assert recognise(shapes, 1, {"stride": "32"}, (32, 64))[0] == "yolov10 or yolov5"


@pytest.mark.parametrize(
    ("head", "bins", "scale", "cell", "ends"),
    [
        # row 10 and column 5 of the scale, 1, 2, 3 and 4 cells to each side
        ("nanodet", 11, 1, 10 * 26 + 5, np.array([4.5, 8.5, 8.5, 14.5]) * 16),
        ("nanodet_plus", 8, 1, 10 * 26 + 5, np.array([4, 8, 8, 14]) * 16),
        # seven cells of 64 pixels are more than the 416 of the input
        ("nanodet_plus", 8, 3, 3 * 7 + 3, np.array([2, 1, 6, 7]) * 64),
    ],
)
def test_a_nanodet_box_lies_around_its_cell(head, bins, scale, cell, ends):
    of = NANODETS[head]
    rows, columns = of.cells((416, 416))[scale]
    logits = np.zeros((rows * columns, 4 * bins), np.float32)
    for side, away in enumerate((1, 2, 3, 4)):
        logits[cell, side * bins + away] = 50.0
    assert of.boxes(logits, scale, (416, 416))[cell] * 416 == pytest.approx(ends, abs=0.1)


def test_generations_of_nanodet_are_told_by_their_rows():
    """320x320: 40, 20, 10 and 5 cells a side, each with 80 scores and four times 8 bins."""
    for rows, head in ((2100, "nanodet"), (2125, "nanodet_plus"), (2000, "")):
        assert recognise({"output": (1, rows, 112)}, 80, {}, (320, 320))[0] == head
    for open_ in (None, "anchors"):
        found = recognise({"output": (1, open_, 112)}, 80, {}, (320, 320))[0]
        assert found == "nanodet or nanodet_plus"


def test_a_picture_at_its_aspect():
    wide = np.full((50, 100, 3), 200, np.uint8)
    middle, place = Input("middle", 114).of(wide, (40, 40))
    assert place.tolist() == [0, 0.25, 1, 0.5]
    assert (middle[10:30] == 200).all()
    assert (middle[:10] == 114).all()
    corner, place = Input("corner").of(wide, (40, 40))
    assert place.tolist() == [0, 0, 1, 0.5]
    assert (corner[:20] == 200).all()
    assert not corner[20:].any()


def test_channels_are_in_the_order_and_scale_of_training():
    red = np.zeros((1, 1, 3), np.uint8)
    red[..., 0] = 255
    assert Input(deviation=(255, 255, 255)).values(red).tolist() == [[[1, 0, 0]]]
    assert Input(blue_first=True, mean=(0, 0, 55)).values(red).tolist() == [[[0, 0, 200]]]
