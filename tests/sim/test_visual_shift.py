"""Pictures by another light and lens."""

from __future__ import annotations

import numpy as np
import pytest
from sim_bridge.world.visual_shift import CAST, shifted

GREY = np.full((120, 120, 3), 128, np.uint8)


def test_no_shift_changes_nothing() -> None:
    assert shifted(GREY, 0.0) is GREY


def test_an_evening_is_darker_and_warmer_and_darkest_in_the_corners() -> None:
    lit = shifted(GREY, 1.0).astype(float)
    red, green, blue = lit[60, 60]
    assert 128 > red > green > blue
    assert blue / green < CAST[2] / CAST[1] + 0.05
    assert lit[2, 2].sum() < 0.7 * lit[60, 60].sum()


def test_half_of_it_lies_between() -> None:
    means = [shifted(GREY, strength).mean() for strength in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert means == sorted(means, reverse=True)
    assert len(set(means)) == 5


def test_edges_blur_with_the_pictures_size() -> None:
    for size in (120, 480):
        edge = np.zeros((size, size, 3), np.uint8)
        edge[:, size // 2 :] = 200
        profile = shifted(edge, 1.0)[size // 2, :, 0].astype(float)
        between = (profile > 0.1 * profile.max()) & (profile < 0.9 * profile.max())
        assert 0 < between[size // 4 : 3 * size // 4].sum() <= 0.03 * size


@pytest.mark.parametrize("strength", [0.3, 1.0])
def test_it_keeps_shape_and_type_and_leaves_the_picture_alone(strength: float) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (40, 60, 3)).astype(np.uint8)
    before = picture.copy()
    out = shifted(picture, strength)
    assert (out.shape, out.dtype) == (picture.shape, np.uint8)
    np.testing.assert_array_equal(picture, before)
