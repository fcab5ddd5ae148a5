"""The smallest pure modules: rooms, visibility, vocabulary, perception's input."""

import numpy as np
import pytest

from cfnav_core.perception import preprocess
from cfnav_core.rooms import parse_rooms
from cfnav_core.visibility import visible
from cfnav_core.vocabulary import CATEGORIES, DATA1_TARGETS, DATA2_TARGETS


def test_rooms():
    assert parse_rooms(["kitchen:3", "bathroom:0-2"]) == [
        ("kitchen", 3), ("bathroom", 0), ("bathroom", 1), ("bathroom", 2),
    ]  # fmt: skip


BAD_ROOMS = ["kitchen", "attic:1", "kitchen:x", "kitchen:1-x", "kitchen:5-2", ""]


@pytest.mark.parametrize("text", BAD_ROOMS)
def test_bad_rooms(text):
    with pytest.raises(ValueError, match="found room"):
        parse_rooms([text])


def test_visible_needs_pixels_and_nearness():
    assert visible(40, 1.5)
    assert not visible(39, 1.0)
    assert not visible(4000, 1.51)
    # a picture with a quarter of the pixels needs a quarter of them
    assert visible(10, 1.0, 150 * 150)
    assert not visible(9, 1.0, 150 * 150)


def test_vocabulary_holds_both_target_lists():
    assert len(CATEGORIES) == len(set(CATEGORIES)) == 38
    assert set(DATA1_TARGETS) < set(CATEGORIES)
    assert {t for row in DATA2_TARGETS.values() for t in row} < set(CATEGORIES)


def test_preprocess_averages_two_by_two():
    rgb = np.random.default_rng(0).integers(0, 255, (300, 300, 3), np.uint8)
    expected = rgb.reshape(150, 2, 150, 2, 3).astype(float).mean((1, 3))
    # two passes, each rounded
    assert np.abs(preprocess(rgb) - expected).max() <= 1.0
    small = preprocess(rgb)
    np.testing.assert_array_equal(preprocess(small), small)
