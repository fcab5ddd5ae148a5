"""``cfnav perceive`` on pictures and a perception that the test makes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from sim_bridge.room.room import generate_room
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import World

from cfnav import cli
from cfnav_core.task.camera import MAST
from tests.core.perception.made import colour_maps


@pytest.fixture
def perceive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture):
    """Run the command; returns its exit code, what it printed, and what it said went wrong."""
    network = colour_maps(tmp_path / "colours.onnx")

    def run(*arguments: object, of: tuple[object, ...] | None = None) -> tuple[int, str, str]:
        given = ("--perception", network) if of is None else of
        monkeypatch.setattr(sys, "argv", ["cfnav", "perceive", *map(str, (*arguments, *given))])
        code = cli.main()
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """Wider than the network's shape by ten pixels on both sides, an Apple in cell 1, 1."""
    rgb = np.zeros((24, 52, 3), np.uint8)
    rgb[8:16, 18:26, 0] = 255
    path = tmp_path / "wide.png"
    Image.fromarray(rgb).save(path)
    return path


def test_pictures_are_told_in_words_numbers_and_drawn(perceive, picture, tmp_path):
    blank = tmp_path / "blank.png"
    Image.new("RGB", (32, 24)).save(blank)
    out, told = tmp_path / "drawn", tmp_path / "told.json"
    code, said, _ = perceive(picture, blank, "--out", out, "--json", told)
    assert code == 0
    first, second = said.splitlines()
    assert first.split() == ["wide", "Apple", "1.00", "19.6", "9.6", "24.4", "14.4"]
    assert second.split() == ["blank", "nothing"]
    (apple,) = json.loads(told.read_text())["pictures"][str(picture)]
    assert apple == {"name": "Apple", "score": 1.0, "box": pytest.approx([19.6, 9.6, 24.4, 14.4])}
    drawn, before = (np.asarray(Image.open(path)) for path in (out / "wide.png", picture))
    assert drawn.shape == before.shape
    assert (drawn != before).any()
    assert (np.asarray(Image.open(out / "blank.png")) == 0).all()


def test_what_cannot_be_told_is_one_sentence(perceive, picture, tmp_path):
    (tmp_path / "broken.png").write_bytes(b"no picture")
    Image.new("RGB", (16, 12)).save(tmp_path / "small.png")
    (tmp_path / "again").mkdir()
    (tmp_path / "again/wide.png").write_bytes(picture.read_bytes())
    for arguments, sentence in (
        ((tmp_path / "none.png",), "found no readable picture at"),
        ((tmp_path / "broken.png",), "found no readable picture at"),
        ((tmp_path / "small.png",), "found a picture of 16x12 pixels"),
        ((picture, "--least", "0"), "found --least 0.0"),
        ((picture, tmp_path / "again/wide.png", "--out", tmp_path), "each of another name"),
        ((), "found pictures named none"),
    ):
        code, _, wrong = perceive(*arguments)
        assert code == 2
        assert sentence in wrong
        assert wrong.count("\n") == 1


def test_the_newest_network_gives_boxes_and_the_bundles_older_ones_say_that_they_do_not(
    perceive, tmp_path
):
    world = World(generate_room("kitchen", 100))
    with Camera(world, MAST) as camera:
        grid = state_grid(world, MAST.horizons)
        seen = camera.picture(grid.pose(0))
    names = {world.room.objects[k].name for k in np.unique(seen.owner) if k >= 0}
    Image.fromarray(seen.rgb).save(tmp_path / "kitchen.png")
    code, said, _ = perceive(tmp_path / "kitchen.png", of=())
    assert code == 0
    assert {line.split()[1] for line in said.splitlines()} & names
    code, _, wrong = perceive(tmp_path / "kitchen.png", of=("--bundle", "default"))
    assert code == 2
    assert "this perception does not tell where things are" in wrong
