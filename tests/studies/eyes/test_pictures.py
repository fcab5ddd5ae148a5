"""The table of real pictures, and what a crop shows."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from cfnav_core.perception.pictures import read_rgb, window
from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.pictures import crop, load_pictures
from tests.studies.eyes.made import GREY, table

PICTURE = {
    "shown": ["Apple", "Mug", "Book"],
    "unclear": ["Vase"],
    "boxes": {"Apple": [[5, 2, 11, 9]], "Mug": [[0, 2, 10, 9]], "Book": [[0, 0, 3, 9]]},
}


def label(cut, name):
    return cut.labels[CATEGORIES.index(name)]


def test_the_table_holds_many_rooms():
    packages, pictures = load_pictures()
    assert len(pictures) >= 40
    assert sum(p.kind in {"room", "furniture"} for p in pictures) >= 25
    assert {p.package for p in pictures} == set(packages)
    for picture in pictures:
        for x0, y0, x1, y1 in (box for boxes in picture.shown.values() for box in boxes):
            assert 0 <= x0 < x1 <= picture.size[0]
            assert 0 <= y0 < y1 <= picture.size[1]
        assert all(picture.shown.values()), f"{picture.name} shows a thing without a box"


def test_a_square_is_cut_out_of_the_middle_and_its_labels_with_it(tmp_path):
    _, (picture,) = load_pictures(table(tmp_path, {"desk": (GREY, PICTURE)}))
    cut = crop(picture, read_rgb(tmp_path / "pictures/desk.png"), 1.0)
    assert cut.rgb.shape == (16, 16, 3)
    assert label(cut, "Apple") == 1
    assert cut.boxes["Apple"] == ((1, 2, 7, 9),)
    assert label(cut, "Mug") == 1  # six tenths of it
    assert label(cut, "Book") == 0
    assert label(cut, "Vase") == -1
    assert label(cut, "Fridge") == 0


def test_what_is_cut_through_is_unclear(tmp_path):
    row = {"shown": ["Mug"], "boxes": {"Mug": [[0, 2, 5, 9]]}}
    _, (picture,) = load_pictures(table(tmp_path, {"desk": (GREY, row)}))
    assert label(crop(picture, read_rgb(tmp_path / "pictures/desk.png"), 1.0), "Mug") == -1
    assert label(crop(picture, read_rgb(tmp_path / "pictures/desk.png"), 1.5), "Mug") == 1


def test_a_wider_picture_is_cut_to_the_aspect():
    assert window(1280, 853, 4 / 3) == (71, 0, 1208, 853)
    assert window(240, 320, 4 / 3) == (0, 70, 240, 250)


def test_what_is_transparent_is_white(tmp_path):
    Image.fromarray(np.zeros((2, 2, 4), np.uint8)).save(tmp_path / "clear.png")
    assert (read_rgb(tmp_path / "clear.png") == 255).all()


@pytest.mark.parametrize(
    ("row", "word"),
    [
        ({"shown": ["Sofa"]}, "Sofa"),
        ({"shown": ["Mug"], "unclear": ["Mug"]}, "Mug"),
        ({"shown": [], "boxes": {"Mug": [[0, 0, 1, 1]]}}, "Mug"),
        ({"kind": "street"}, "street"),
        ({"package": "other"}, "other"),
        ({"size": 3}, "readable"),
    ],
)
def test_a_label_that_cannot_be_is_told(tmp_path, row, word):
    with pytest.raises(ValueError, match=word):
        load_pictures(table(tmp_path, {"desk": (GREY, row)}))
