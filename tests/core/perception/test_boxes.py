"""Boxes out of maps: by numbers worked out by hand, and through a network of a few nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cfnav_core.perception.boxes import Detection, decode
from cfnav_core.perception.perception import OnnxPerception, PerceptionError
from cfnav_core.perception.pictures import MARK, draw_detections
from cfnav_core.perception.sight import cells as cells_of
from tests.core.model_samples import older_perception
from tests.core.perception.made import colour_maps

SIZE = (48, 40)
"""Width and height of what the network takes: 6 x 5 cells of 8 pixels."""


def boxes(cells: np.ndarray, size: tuple[int, int] = SIZE, **given: float) -> list[Detection]:
    """Of one category, Mug."""
    return decode(cells[None], ("Mug",), SIZE[::-1], size, **given)


def test_edges_lie_where_the_probability_falls_to_the_share() -> None:
    cells = np.zeros((5, 6))
    cells[2, 2:4] = 1.0, 0.8
    # from the middle of a cell to the next: (1 - 0.7) / (1 - 0) and (0.8 - 0.7) / (0.8 - 0) of it
    left, right = (2.5 - 0.3) * 8, (3.5 + 0.125) * 8
    top, bottom = (2.5 - 0.3) * 8, (2.5 + 0.3) * 8
    (mug,) = boxes(cells)
    assert (mug.name, mug.score) == ("Mug", 1.0)
    assert mug.box == pytest.approx((left, top, right, bottom))
    # a picture twice as large that was scaled down to it
    (large,) = boxes(cells, (96, 80))
    assert large.box == pytest.approx((2 * left, 2 * top, 2 * right, 2 * bottom))
    (whole,) = boxes(cells, between_cells=False)
    assert whole.box == pytest.approx((16, 16, 32, 24))


def test_what_reaches_the_outermost_cells_ends_with_the_picture() -> None:
    cells = np.zeros((5, 6))
    cells[0, 5] = 0.9
    (mug,) = boxes(cells)
    assert mug.box == pytest.approx((48 - 8 + 4 - 0.3 * 8, 0, 48, 4 + 0.3 * 8))


def test_cells_that_are_more_than_the_picture_stand_out_on_both_sides() -> None:
    cells = np.zeros(cells_of(36, 44))
    assert cells.shape == (5, 6)
    cells[2, 2] = 1.0
    (mug,) = decode(cells[None], ("Mug",), (36, 44), (44, 36))
    assert mug.box == pytest.approx((2.2 * 8 - 2, 2.2 * 8 - 2, 2.8 * 8 - 2, 2.8 * 8 - 2))


def test_things_apart_are_two_and_things_that_touch_at_a_corner_one() -> None:
    cells = np.zeros((5, 6))
    cells[0, 0], cells[4, 5] = 0.6, 0.9
    assert [one.score for one in boxes(cells)] == [0.9, 0.6]
    cells[:] = 0
    cells[1, 1], cells[2, 2] = 0.6, 0.9
    (one,) = boxes(cells)
    assert one.box == pytest.approx((16 + 4 - 2.4, 16 + 4 - 2.4, 24 - 4 + 2.4, 24 - 4 + 2.4))
    # 0.6 is not 0.7 of 0.9, but three quarters of 0.8
    cells[2, 2] = 0.8
    (one,) = boxes(cells)
    assert one.box[0] < 12


def test_what_is_less_sure_is_not_named() -> None:
    cells = np.full((5, 6), 0.4)
    assert boxes(cells) == []
    (whole,) = boxes(cells, least=0.4)
    assert whole.box == (0, 0, *SIZE)


@pytest.fixture
def network(tmp_path: Path) -> OnnxPerception:
    return OnnxPerception(colour_maps(tmp_path / "colours.onnx"))


def test_a_network_with_maps_names_what_a_picture_shows(network: OnnxPerception) -> None:
    picture = np.zeros((48, 64, 3), np.uint8)
    picture[16:32, 16:48, 0] = 255  # cells 1 and 2 of row 1 in red, of cells of 16 pixels here
    picture[32:, :16, 2] = 255  # the last row's first in blue
    apple, mug = sorted(network.boxes(picture), key=lambda one: one.name)
    assert apple.name == "Apple"
    assert apple.box == pytest.approx((16 * 1.2, 16 * 1.2, 16 * 2.8, 16 * 1.8))
    assert mug.name == "Mug"
    assert mug.box == pytest.approx((0, 16 * 2.2, 16 * 0.8, 48))
    assert network.boxes(np.zeros_like(picture)) == []
    seen = network.observe(picture)  # what policies read does not change
    assert seen.detections[0, :, 0].tolist() == [1.0, 1.0]
    drawn = draw_detections(picture, [apple, mug])
    assert tuple(drawn[round(16 * 1.8) - 1, 30]) == MARK
    assert not (drawn == picture).all()
    assert picture[round(16 * 1.8) - 1, 30, 2] == 0


def test_a_network_without_maps_says_that_it_gives_no_boxes() -> None:
    older = OnnxPerception(older_perception())
    with pytest.raises(PerceptionError, match=r"no output shown in .* so it gives no boxes"):
        older.boxes(np.zeros((300, 300, 3), np.uint8))


def test_maps_of_another_grid_are_no_boxes(tmp_path: Path) -> None:
    other = OnnxPerception(colour_maps(tmp_path / "coarse.onnx", cell=4))
    assert r"the output shown [2, 6, 8]" in other.no_boxes
    assert "expected [2, 3, 4]" in other.no_boxes


def test_a_network_of_so_many_pictures_at_a_time_is_refused(tmp_path: Path) -> None:
    path = colour_maps(tmp_path / "one.onnx", at_once=1)
    with pytest.raises(PerceptionError, match="takes 1 pictures at a time, expected any number"):
        OnnxPerception(path)


def test_pictures_that_a_network_does_not_take_are_one_sentence(network: OnnxPerception) -> None:
    with pytest.raises(ValueError, match="invalid dimensions for input: pictures"):
        network(np.zeros((1, 24, 31, 3), np.uint8))
