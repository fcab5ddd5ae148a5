"""Classes of detectors and what they are called here."""

from __future__ import annotations

import pytest

from cfnav_core.detect.labels import LabelMap, load_labels, shipped
from cfnav_core.task.vocabulary import CATEGORIES


@pytest.mark.parametrize("name", shipped())
def test_every_category_is_a_goal_and_every_name_is_there_once(name):
    labels = load_labels(name)
    assert set(labels.categories.values()) <= set(CATEGORIES)
    assert len(set(labels.names.values())) == len(labels.names)
    for number, word in labels.names.items():
        assert labels.name(str(number)) == labels.name(word) == word


def test_shipped_maps_number_as_their_data_sets_do():
    assert load_labels("coco").name("56") == "chair"
    assert load_labels("coco").count == 80
    ids = load_labels("coco_ids")
    assert (ids.name("62"), ids.name("90"), ids.count) == ("chair", "toothbrush", 91)
    assert [*ids.names.values()] == [*load_labels("coco").names.values()]
    assert load_labels("voc").name("9") == "chair"
    assert load_labels("voc").category("20") == "Television"
    assert load_labels("objects365").name("277") == "Toaster"
    assert load_labels("objects365").count == 365
    images = load_labels("open_images")
    assert (images.name("0"), images.name("600"), images.count) == ("Accordion", "Zucchini", 601)
    assert sorted(images.names.values(), key=str.lower) == [*images.names.values()]
    assert images.category("419") == "Fridge"


def test_a_class_is_a_number_or_a_name_and_becomes_a_goal():
    labels = load_labels("coco")
    assert labels.category("41") == labels.category(" cup ") == "Mug"
    assert labels.category("couch") == "couch"
    with pytest.raises(ValueError, match="found the class '80', expected a number from 0 to 79"):
        labels.category("80")
    with pytest.raises(ValueError, match="found the class 'sofa'"):
        labels.category("sofa")


def test_gaps_have_no_name():
    with pytest.raises(ValueError, match="found the class '12'"):
        load_labels("coco_ids").name("12")


def test_names_that_a_file_says_itself_get_the_categories_of_their_data_set():
    own = LabelMap(dict(load_labels("coco").names))
    assert own.completed.category("41") == "Mug"
    assert LabelMap({0: "cup"}).completed.category("0") == "cup"


def test_a_map_of_ones_own(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("names: {3: mug, 7: laptop}\ncategories: {mug: Mug}\n")
    labels = load_labels(path)
    assert (labels.count, labels.category("3"), labels.category("7")) == (8, "Mug", "laptop")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("[mug]", "found no map of labels"),
        ("names: mug", "found names that are no list"),
        ("names: []", "found names that are no list"),
        ("names: {-1: mug}", "found names that are no list"),
        ("names: [mug, 3]", "found names that are no list"),
        ("names: [mug]\ncategories: {cup: Mug}", "found categories of \\['cup'\\]"),
        ("names: [mug]\ncategories: {mug: 3}", "found categories that are no words"),
        ("names: [mug]\nclasses: 3", "found no map of labels"),
        ("names: [", "cannot be read"),
    ],
)
def test_a_damaged_map_is_told_in_one_sentence(tmp_path, text, found):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=found) as told:
        load_labels(path)
    assert str(path) in str(told.value)
    assert "\n" not in str(told.value)


def test_a_map_that_is_not_there():
    with pytest.raises(
        ValueError, match="found no labels 'cocoa', expected a file or one of cfnav, coco"
    ):
        load_labels("cocoa")
