"""Which goals rooms offer, in words and by the command."""

from __future__ import annotations

import sys

import pytest
from sim_bridge.data.goals import left_out

from cfnav import cli


def test_what_is_left_out_is_counted_with_its_reason():
    rooms = [{"Bed": 4, "Mirror": 0, "Book": 3}, {"Bed": 9, "Mirror": 5, "Book": 0}]
    assert left_out(rooms).splitlines() == [
        "3 of 6 goals of 2 rooms are asked for, those that 4 states or more see within 1.5 m",
        "  Book is left out in 2 of 2: never seen in 1, too seldom in 1",
        "  Mirror is left out in 1 of 2: never seen in 1",
    ]
    assert left_out([{"Bed": 4}]).count("\n") == 0


def test_goals_are_counted_for_each_camera(monkeypatch, capsys):
    asked = ["--rooms", "bathroom:0", "--camera", "mast", "--camera", "lite"]
    monkeypatch.setattr(sys, "argv", ["cfnav", "rooms", "goals", *asked])
    assert cli.main() == 0
    said = capsys.readouterr().out
    mast, lite = said.split("lite: ")
    assert mast.startswith("mast: ")
    assert "Mirror" not in mast
    assert "  Mirror is left out in 1 of 1: never seen in 1" in lite


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [([], "found no rooms"), (["--rooms", "kitchen:1", "--camera", "periscope"], "'periscope'")],
)
def test_bad_input_is_one_sentence(asked, sentence, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["cfnav", "rooms", "goals", *asked])
    assert cli.main() == 2
    assert sentence in capsys.readouterr().err
