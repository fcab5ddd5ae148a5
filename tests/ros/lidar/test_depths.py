"""Depth pictures as points: encodings, and what is no depth picture."""

from array import array

import numpy as np
import pytest
from cfnav_ros.robot.depths import cloud_to_metres, depth_to_metres, thinning

from tests.ros.depth_scenes import CAMERA, FRAME, MAST_DOWN, cloud, depth_of, picture, table

METRES = np.array([[0.5, 0.0, 1.25], [2.0, 65.0, 0.001]], np.float32)


def test_millimetres_and_metres_are_the_same_depth():
    sent = picture(METRES)
    assert depth_to_metres(sent) == pytest.approx(METRES)
    sent.data, sent.is_bigendian = np.rint(METRES * 1000).astype(">u2").tobytes(), 1
    sent.data = np.frombuffer(sent.data, np.uint8)
    assert depth_to_metres(sent) == pytest.approx(METRES)
    padded = np.zeros((2, 16), np.uint8)
    floats = np.where(METRES > 0, METRES, np.nan).astype("<f4")
    padded[:, :12] = floats.view(np.uint8)
    sent.encoding, sent.step, sent.is_bigendian, sent.data = "32FC1", 16, 0, padded.ravel()
    assert depth_to_metres(sent) == pytest.approx(METRES)
    assert depth_to_metres(sent, 2) == pytest.approx(METRES[::2, ::2])
    floats[0, 0], floats[0, 2] = np.inf, -1.0
    padded[:, :12] = floats.view(np.uint8)
    assert (depth_to_metres(sent)[0] == 0).all()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"encoding": "rgb8"}, "is encoded as 'rgb8', expected one of 16UC1, mono16, 32FC1"),
        ({"height": 0}, "is 3x0, expected 1 to"),
        ({"step": 5}, "in rows of 5, expected 2 rows of 6 or more"),
        ({"encoding": "32FC1"}, "expected 2 rows of 12 or more"),
    ],
)
def test_what_is_no_depth_picture_is_one_sentence(change, sentence):
    sent = picture(METRES)
    vars(sent).update(change)
    with pytest.raises(ValueError, match="depth picture") as caught:
        depth_to_metres(sent)
    assert sentence in str(caught.value)


def test_points_lie_where_they_are_seen_and_thinning_moves_none():
    depth = depth_of([table(0.6)], MAST_DOWN)
    optical = CAMERA.placed(depth, np.eye(4))
    row, column, inside = CAMERA.pixels(optical[:, depth > 0].T)
    assert inside.all()
    assert (np.stack([row, column]) == np.nonzero(depth)).all()
    behind = CAMERA.pixels(np.array([[0.0, 0.0, -1.0], [9.0, 0.0, 1.0]]))[2]
    assert not behind.any()
    thin = CAMERA.thinned(3)
    assert thin.placed(depth[::3, ::3], np.eye(4)) == pytest.approx(optical[:, ::3, ::3], abs=1e-5)
    x, _, height = CAMERA.placed(depth, MAST_DOWN)
    assert x[np.abs(height - 0.75) < 1e-3].min() == pytest.approx(0.6, abs=0.02)
    assert height.min() == pytest.approx(0.0, abs=1e-3)


def test_wide_pictures_are_thinned_to_at_most_320_columns():
    assert [thinning(width) for width in (160, 320, 640, 641, 1280)] == [1, 1, 2, 3, 4]


@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8"])
def test_a_cloud_is_the_picture_that_it_was_made_from(kind):
    depth = depth_of([table(0.6)], MAST_DOWN)
    here = cloud(depth, np.eye(4), FRAME, kind)
    assert cloud_to_metres(here, CAMERA, np.eye(4)) == pytest.approx(depth, abs=1e-5)
    at_base = cloud(depth, MAST_DOWN, "base_link", kind)
    seen = cloud_to_metres(at_base, CAMERA, np.linalg.inv(MAST_DOWN))
    assert seen == pytest.approx(depth, abs=1e-5)


def test_of_points_in_one_pixel_the_nearest_counts():
    depth = depth_of([table(0.6)], MAST_DOWN)
    thin = cloud_to_metres(cloud(depth, np.eye(4), FRAME), CAMERA.thinned(4), np.eye(4))
    assert thin.shape == (25, 40)
    assert thin[10, 20] == pytest.approx(depth[38:43, 78:83].min(), abs=0.05)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"fields": []}, "no x, y, z of float32 or float64"),
        ({"width": 5000 * 5000}, "has 25000000 points"),
        ({"row_step": 5}, "in rows of 5 and points of 16"),
        ({"point_step": 8, "row_step": 8 * 16000}, "points of 8, expected 1 rows of 16000"),
        ({"data": array("B", b"abc")}, "holds 3 bytes"),
    ],
)
def test_what_is_no_cloud_is_one_sentence(change, sentence):
    sent = cloud(depth_of([], MAST_DOWN), np.eye(4), FRAME)
    vars(sent).update(change)
    with pytest.raises(ValueError, match="depth cloud") as caught:
        cloud_to_metres(sent, CAMERA, np.eye(4))
    assert sentence in str(caught.value)
