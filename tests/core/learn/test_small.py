"""The smallest pure modules: rooms, visibility, vocabulary, perception's input."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.perception.perception import BUILT_IN
from cfnav_core.task.camera import MAST
from cfnav_core.task.rooms import parse_rooms, rooms_in, split_of
from cfnav_core.task.visibility import visible
from cfnav_core.task.vocabulary import CATEGORIES, DATA1_TARGETS, DATA2_TARGETS, ROOM_TYPES


def test_rooms():
    assert parse_rooms(["kitchen:3", "bathroom:0-2"]) == [
        ("kitchen", 3), ("bathroom", 0), ("bathroom", 1), ("bathroom", 2),
    ]  # fmt: skip


def test_splits_of_all_rooms():
    every = {(kind, seed) for kind in ROOM_TYPES for seed in range(30)}
    for layout, train, validation, test in (("data1", 20, 5, 5), ("data2", 18, 2, 10)):
        parts = [parse_rooms([f"{layout}:{s}"]) for s in ("train", "validation", "test")]
        assert [len(p) for p in parts] == [4 * train, 4 * validation, 4 * test]
        assert {room for part in parts for room in part} == every
        assert sorted(parse_rooms([layout])) == sorted(every)
    # published numbers begin with 1: the even ones test in Data 1
    assert [split_of("data1", seed) for seed in (19, 20, 21, 30)] == [
        "train", "validation", "test", "",
    ]  # fmt: skip
    assert [split_of("data2", seed) for seed in (17, 18, 20)] == ["train", "validation", "test"]


def test_no_room_twice():
    assert parse_rooms(["bedroom:3", "data2:validation", "bedroom:2-4"]).count(("bedroom", 3)) == 1


def test_rooms_in_a_folder(tmp_path):
    names = ("kitchen_00002", "bathroom_00010", "kitchen_00003.partial", "attic_00001", "notes")
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "scene.json").touch()
    (tmp_path / "kitchen_00004").mkdir()
    assert rooms_in(tmp_path) == [("bathroom", 10), ("kitchen", 2)]


BAD_ROOMS = [
    "kitchen", "attic:1", "kitchen:x", "kitchen:1-x", "kitchen:1-", "kitchen:5-2", "", "data2:",
    "data1:dev", "data3:train", "train",
]  # fmt: skip


@pytest.mark.parametrize("text", BAD_ROOMS)
def test_bad_rooms(text):
    with pytest.raises(ValueError, match="found room"):
        parse_rooms([text])


def test_visible_needs_pixels_and_nearness():
    assert visible(40, 1.5)
    assert not visible(39, 1.0)
    assert not visible(4000, 1.51)
    # a picture with a quarter of the pixels needs a quarter of them
    coarse = replace(MAST, size=(150, 150))
    assert visible(10, 1.0, coarse)
    assert not visible(9, 1.0, coarse)
    # and one of the same pixels that shows half as much each way needs four times as many
    narrow = replace(MAST, fov_deg=(2 * math.degrees(math.atan(0.5)),) * 2)
    assert visible(160, 1.0, narrow)
    assert not visible(159, 1.0, narrow)


def test_vocabulary_holds_both_target_lists():
    assert len(CATEGORIES) == len(set(CATEGORIES)) == 38
    assert set(DATA1_TARGETS) < set(CATEGORIES)
    assert {t for row in DATA2_TARGETS.values() for t in row} < set(CATEGORIES)


def test_preprocess_averages_two_by_two():
    rgb = np.random.default_rng(0).integers(0, 255, (300, 300, 3), np.uint8)
    expected = rgb.reshape(150, 2, 150, 2, 3).astype(float).mean((1, 3))
    # two passes, each rounded
    assert np.abs(BUILT_IN.preprocess(rgb) - expected).max() <= 1.0
    small = BUILT_IN.preprocess(rgb)
    np.testing.assert_array_equal(BUILT_IN.preprocess(small), small)


def test_preprocess_averages_a_preview_picture():
    # cells are 5/3 pixels wide: they cover the centres 0.5 and 1.5, 2.5, 3.5 and 4.5, and so on
    rgb = np.random.default_rng(0).integers(0, 255, (250, 250, 3), np.uint8)
    cells = rgb.astype(float).reshape(50, 5, 50, 5, 3)
    three = ([0, 1], [2], [3, 4])
    expected = np.array([[cells[:, r][:, :, :, c].mean((1, 3)) for c in three] for r in three])
    found = BUILT_IN.preprocess(rgb).reshape(50, 3, 50, 3, 3).transpose(1, 3, 0, 2, 4)
    assert np.abs(found - expected).max() <= 1.0
