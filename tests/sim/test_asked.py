"""The rooms that commands are asked for, and something made of each of them."""

import operator
import os
from pathlib import Path

import pytest
from sim_bridge.data.asked import asked_for, made_of_each


@pytest.mark.parametrize(
    ("furniture", "rooms"),
    [
        ("built_in", [("kitchen", 3), ("cc0.bathroom", 1)]),
        ("cc0", [("cc0.kitchen", 3), ("cc0.bathroom", 1)]),
    ],
)
def test_rooms_that_name_no_furniture_have_the_one_asked_for(furniture, rooms):
    assert asked_for(["kitchen:3", "cc0.bathroom:1"], furniture) == rooms


def test_both_furnitures_are_a_room_of_each(monkeypatch):
    monkeypatch.setattr("sim_bridge.data.asked.check_furniture", list)  # installed or not
    assert asked_for(["kitchen:3"], "both") == [("kitchen", 3), ("sweet_home.kitchen", 3)]


def test_furniture_that_is_not_there_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv("CFNAV_SWEET_HOME", str(tmp_path))
    with pytest.raises(ValueError, match="sweethome3d-furniture"):
        asked_for(["kitchen:3"], "both")


def test_no_rooms_are_one_sentence():
    with pytest.raises(ValueError, match="found no rooms; say which"):
        asked_for([], "built_in")


def test_something_is_made_of_each_room():
    rooms = [("kitchen", 2), ("bathroom", 1)]
    assert set(made_of_each(operator.mul, rooms, processes=2)) == {"kitchenkitchen", "bathroom"}


def test_a_room_that_fails_is_named():
    with pytest.raises(ValueError, match="room kitchen:2 could not be made: not all arguments"):
        list(made_of_each(operator.mod, [("kitchen", 2)], processes=1))


def test_processes_are_one_or_more():
    with pytest.raises(ValueError, match="found --processes 0, expected 1 or more"):
        list(made_of_each(operator.mul, [("kitchen", 2)], processes=0))


def test_of_a_run_that_is_stopped_only_rooms_in_work_are_finished(tmp_path: Path):
    files = [tmp_path / str(k) for k in range(8)]
    for file in files:
        file.touch()
    made = made_of_each(os.truncate, [(str(file), 1) for file in files], processes=1)
    next(made)
    made.close()
    assert [file.stat().st_size for file in files] == [1, 1, 0, 0, 0, 0, 0, 0]
