"""Names of rooms: kinds, splits, and the furniture of those that name none."""

from __future__ import annotations

import pytest

from cfnav_core.task.rooms import (
    BUILT_IN,
    CC0,
    FURNITURE,
    SPLIT_NAMES,
    SWEET_HOME,
    furniture_of,
    of_furniture,
    parse_room,
    parse_rooms,
    room_folder,
    rooms_in,
    split_of,
    type_of,
)
from cfnav_core.task.vocabulary import ROOM_TYPES


def test_a_kind_is_furniture_and_type():
    assert parse_room("sweet_home.kitchen:7") == ("sweet_home.kitchen", 7)
    assert type_of("sweet_home.kitchen") == type_of("kitchen") == "kitchen"
    assert (furniture_of("sweet_home.kitchen"), furniture_of("kitchen")) == (SWEET_HOME, BUILT_IN)
    assert of_furniture("kitchen", SWEET_HOME) == "sweet_home.kitchen"
    assert of_furniture("sweet_home.kitchen", BUILT_IN) == "kitchen"
    assert parse_room("cc0.bathroom:25") == ("cc0.bathroom", 25)
    assert (furniture_of("cc0.bathroom"), of_furniture("kitchen", CC0)) == (CC0, "cc0.kitchen")


@pytest.mark.parametrize("text", ["attic:1", "sweet_home.attic:1", "ikea.kitchen:1", "kitchen:-1"])
def test_other_names_are_refused(text):
    with pytest.raises(ValueError, match="expected TYPE:SEED"):
        parse_room(text)
    with pytest.raises(ValueError, match="expected"):
        parse_rooms([text])


def test_rooms_that_name_no_furniture_get_the_one_asked_for():
    texts = ["kitchen:1-2", "sweet_home.bedroom:3"]
    assert parse_rooms(texts) == [("kitchen", 1), ("kitchen", 2), ("sweet_home.bedroom", 3)]
    assert parse_rooms(["kitchen:1"], [SWEET_HOME]) == [("sweet_home.kitchen", 1)]
    both = parse_rooms(texts, FURNITURE)
    assert [kind for kind, _ in both].count("sweet_home.kitchen") == 2
    assert [kind for kind, _ in both].count("cc0.kitchen") == 2
    assert both.count(("sweet_home.bedroom", 3)) == 1


def test_splits_of_worlds_share_no_seed():
    train, validation, test = (
        set(parse_rooms([f"sweet_home.worlds:{split}"])) for split in SPLIT_NAMES
    )
    assert (len(train), len(validation), len(test)) == (500, 20, 100)
    assert len(train | validation | test) == 620
    assert {type_of(kind) for kind, _ in test} == set(ROOM_TYPES)
    assert {split_of("worlds", seed) for _, seed in test} == {"test"}
    assert set(parse_rooms(["worlds:test"], FURNITURE)) > test


def test_folders_of_both_furnitures_lie_side_by_side(tmp_path):
    for kind in ("kitchen", "sweet_home.kitchen"):
        folder = room_folder(tmp_path, kind, 300)
        folder.mkdir()
        (folder / "scene.json").touch()
    assert set(rooms_in(tmp_path)) == {("kitchen", 300), ("sweet_home.kitchen", 300)}
