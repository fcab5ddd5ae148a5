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

import cfnav_core.perception
from cfnav import cli
from cfnav_core.perception.perception import NETWORKS, OnnxPerception
from cfnav_core.perception.pictures import read_rgb
from cfnav_core.task.camera import CAMERAS
from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.detectors import best_pairs, overlap
from studies.eyes.rooms import things_of_rooms
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


def test_the_next_network_for_the_mast_knows_a_kitchen_by_its_pictures(tmp_path):
    path, shown = _kitchen("mast", tmp_path)
    network = OnnxPerception(Path(cfnav_core.perception.__file__).with_name("mast.onnx"))
    assert network.gives.camera
    assert network.gives.camera.sees_like(CAMERAS["mast"])
    assert {box.name for box in network.boxes(read_rgb(path))} & shown


@pytest.mark.parametrize("name", NETWORKS)
def test_a_shipped_network_finds_what_its_camera_shows(name, perceive, tmp_path):
    path, shown = _kitchen(name, tmp_path)
    assert OnnxPerception(NETWORKS[name]).gives.camera == CAMERAS[name]
    code, said, _ = perceive(path, of=("--camera", name))
    assert code == 0
    assert {line.split()[1] for line in said.splitlines()} & shown


@pytest.mark.parametrize("name", NETWORKS)
def test_a_shipped_network_knows_where_things_are_in_rooms_that_it_never_saw(name):
    """Measured: 0.70 and 0.63 of the things found, and 0.75 of what is said is in the picture."""
    network, found, things, right, said = OnnxPerception(NETWORKS[name]), 0, 0, 0, 0
    for view in things_of_rooms(["kitchen:1139", "living_room:1139"], 15, CAMERAS[name]):
        boxes, pixels = network.boxes(view.rgb), view.rgb.shape[0] * view.rgb.shape[1]
        large = [
            t for t in view.things if np.prod(np.subtract(t.box[2:], t.box[:2])) > pixels / 250
        ]
        shared = np.zeros((len(large), len(boxes)))
        for k, thing in enumerate(large):
            of = np.array([one.box for one in boxes], float).reshape(-1, 4)
            same = np.array([one.name == thing.name for one in boxes], bool)
            shared[k] = overlap(np.array(thing.box, float), of) * same
        found, things = found + len(best_pairs(shared, 0.3)), things + len(large)
        right += sum(one.name in {thing.name for thing in view.things} for one in boxes)
        said += len(boxes)
    assert things > 30
    assert found > 0.5 * things
    assert right > 0.6 * said


def test_the_older_network_of_other_bundles_says_that_it_gives_no_boxes(perceive, tmp_path):
    path, _ = _kitchen("mast", tmp_path)
    code, _, wrong = perceive(path, of=("--bundle", "tdanet"))
    assert code == 2
    assert "this perception does not tell where things are" in wrong


def _kitchen(name: str, folder: Path) -> tuple[Path, set[str]]:
    """A picture of a kitchen by a camera, where it shows most things, and their names."""
    set_up = CAMERAS[name]
    world = World(generate_room("kitchen", 100), set_up.on_mast)
    grid = state_grid(world, set_up.horizons)
    with Camera(world, set_up) as camera:
        seen = [camera.picture(grid.pose(state)) for state in range(0, len(grid.next_state), 99)]
    shown = [
        {world.room.objects[k].name for k in np.unique(one.owner) if k >= 0} & set(CATEGORIES)
        for one in seen
    ]
    best = max(range(len(seen)), key=lambda k: len(shown[k]))
    path = folder / "kitchen.png"
    Image.fromarray(seen[best].rgb).save(path)
    return path, shown[best]
