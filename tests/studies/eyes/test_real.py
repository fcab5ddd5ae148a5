"""Perceptions and detectors judged on pictures that the test makes."""

from __future__ import annotations

import json

import cv2
import numpy as np
import onnx
import pytest

from cfnav_core.perception.boxes import Detection
from cfnav_core.perception.describe import describe
from studies.eyes.real import RealOptions, run
from studies.eyes.realism import RealismOptions, found_of, main, things_of
from tests.studies.eyes.made import BLUE, GREY, RED, colour_perception, constant_detector, table

CHAIR = 56.0


def options(tmp_path, **given):
    """Four red pictures with an Apple, three blue ones with a Mug, one grey one."""
    apple = {"shown": ["Apple"], "boxes": {"Apple": [[6, 2, 12, 9]]}}
    made = table(tmp_path / "cache", {
        **{f"red{k}": (RED, apple) for k in range(4)},
        **{f"blue{k}": (BLUE, {"shown": ["Mug"]}) for k in range(3)},
        "grey": (GREY, {"unclear": ["Mug"]}),
    })  # fmt: skip
    return RealOptions(
        **{"perception": (colour_perception(tmp_path / "colour.onnx"),), **given},
        cache=tmp_path / "cache", out=tmp_path / "out", pictures=made,
    )  # fmt: skip


def test_a_network_that_knows_is_told_from_one_that_does_not(tmp_path):
    blind = constant_detector(tmp_path / "blind.onnx", [[0, 0, 512, 512, 0.9, CHAIR]])
    page = run(options(tmp_path, detector=(blind,)), "a test")
    assert "8 pictures: 8 of a room" in page
    found = json.loads((tmp_path / "out/real.json").read_text())
    know = found["rows"]["COCO's categories"]
    assert list(know) == ["blind"]  # the perception knows two of them only
    assert know["blind"]["at_half"]["false_alarms"] == 1.0
    assert found["scores"]["red0"]["colour"] == {"Apple": pytest.approx(0.98, abs=0.01), "Mug": 0}
    gain, _ = found["gains"]["blind"]
    assert gain == pytest.approx(0.5)
    page = cv2.imread(str(tmp_path / "out/colour.jpg"))
    assert page is not None
    assert page[20, 20, 2] > 200  # the first picture is red


def test_pictures_that_were_not_fetched_are_told(tmp_path, capsys):
    asked = options(tmp_path)
    (tmp_path / "cache/pictures/red0.png").unlink()
    run(asked, "a test")
    assert "1 of 8 pictures are not there" in capsys.readouterr().out
    for path in (tmp_path / "cache/pictures").iterdir():
        path.unlink()
    with pytest.raises(ValueError, match=r"found 0 pictures .* python -m studies\.eyes\.fetch"):
        run(asked, "a test")


def test_perceptions_that_are_larger_than_a_picture_get_it_enlarged(tmp_path):
    run(options(tmp_path, perception=(colour_perception(tmp_path / "large.onnx", 64),)), "a test")
    found = json.loads((tmp_path / "out/real.json").read_text())
    assert found["scores"]["blue0"]["large"]["Mug"] == pytest.approx(0.98, abs=0.01)


def test_only_free_pictures_are_on_the_page_for_others(tmp_path):
    made = table(tmp_path / "cache", {
        **{f"red{k}": (RED, {"shown": ["Apple"]}) for k in range(3)},
        "blue": (BLUE, {"shown": ["Mug"], "free": True}),
    })  # fmt: skip
    network = colour_perception(tmp_path / "colour.onnx")
    out = tmp_path / "out"
    run(RealOptions((network,), cache=tmp_path / "cache", out=out, pictures=made), "a test")
    everything, free = (cv2.imread(str(out / name)) for name in ("colour.jpg", "colour_free.jpg"))
    assert everything[20, 20, 2] > 200  # red comes first
    assert free[20, 20, 0] > 200
    assert free[20, 260].min() > 250  # and nothing beside the blue one


def test_networks_of_one_name_are_told_by_their_folders(tmp_path):
    paths = []
    for folder in ("old", "new"):
        (tmp_path / folder).mkdir()
        paths.append(colour_perception(tmp_path / folder / "perception.onnx"))
    run(options(tmp_path, perception=tuple(paths)), "a test")
    found = json.loads((tmp_path / "out/real.json").read_text())
    assert list(found["networks"]) == ["old/perception", "new/perception"]
    assert found["gains"]["new/perception"][0] == 0  # they are the same
    assert (tmp_path / "out/new_perception.jpg").exists()


def test_an_encoder_cannot_be_judged(tmp_path):
    made = colour_perception(tmp_path / "encoder.onnx", objects=("Apple", "Mug"))
    network = onnx.load(made)
    del network.graph.output[1]
    onnx.save(network, made)
    describe(made, (), (), None)
    with pytest.raises(ValueError, match="detects nothing"):
        run(options(tmp_path, perception=(made,)), "a test")


def test_what_fills_enough_of_a_picture_is_a_thing():
    owner = np.full((100, 100), -1)
    owner[10:20, 30:50] = 0
    owner[0, :30] = 1  # 0.3 %
    owner[50:] = 2
    assert things_of(owner, ["Chair", "Mug", "Wall"]) == (("Chair", (30, 10, 50, 20)),)


def test_a_rendered_room_is_asked_for_its_things(tmp_path, capsys):
    nothing = constant_detector(tmp_path / "nothing.onnx", [[0, 0, 9, 9, 0.1, CHAIR]])
    main(RealismOptions(
        rooms=("bathroom:20",), views=6, detector=nothing, json=tmp_path / "found.json",
    ))  # fmt: skip
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["things"] > 0
    assert found["found"] == 0
    assert "built_in: nothing finds 0 of" in capsys.readouterr().out


def test_a_thing_is_found_by_its_class_where_it_is():
    there = [Detection("couch", 0.9, (0, 0, 10, 10))]
    at, beside = (0, 0, 10, 9), (20, 0, 30, 9)
    for name, box, found in (
        ("Sofa", at, True), ("ArmChair", at, True), ("Chair", at, False), ("Sofa", beside, False),
    ):  # fmt: skip
        assert found_of([(name, box)], there).tolist() == [found]
    # one detection is of one thing
    assert found_of([("Sofa", at), ("ArmChair", at), ("Sofa", beside)], there).sum() == 1
    assert found_of([("Sofa", at), ("ArmChair", at)], [*there, *there]).all()
    assert found_of([("Sofa", at)], []).tolist() == [False]
    assert len(found_of([], there)) == 0
