"""What is wrong with a data set is named, counted and said once."""

import json

import h5py
import numpy as np
import pytest

from cfnav_core.published.check import check_root, check_scene
from cfnav_core.published.reader import Choice
from cfnav_core.scenes.check import check_alike
from cfnav_core.scenes.layouts import LAYOUTS, scene_folders

from . import drawn

FEATURES = "resnet18_featuremap.hdf5"


def problems(root, name="data1", quick=False) -> list[str]:
    layout = LAYOUTS[name]
    folder = scene_folders(root, layout)[0]
    return check_scene(folder, Choice(layout, layout.objects), quick).problems


def is_one(lines: list[str], *parts: str) -> bool:
    """Exactly one line has all of the parts."""
    return sum(all(p in line for p in parts) for line in lines) == 1


def test_an_intact_scene_but_for_its_drawn_quirks(own1):
    # what was drawn: E facing 90 has no right turn, in both horizons
    turn = f"2 turns and looks have no edge in {own1}/FloorPlan1/graph.json"
    assert problems(own1) == [f"{turn}, first RotateRight at 0.25|0.25|90|0"]
    assert problems(own1) == problems(own1, quick=True)


def test_a_kitchen_of_savn_has_no_target(savn):
    assert is_one(problems(savn, "savn"), "no target of FloorPlan2 can be reached", "none")


def test_target_that_only_its_own_states_see(own1):
    # with no edges at all no level state can reach the laptop or the sink
    path = own1 / "FloorPlan1/graph.json"
    data = json.loads(path.read_text()) | {"links": []}
    path.write_text(json.dumps(data))
    assert is_one(problems(own1), "no target of FloorPlan1 can be reached", "Laptop, Sink")
    assert is_one(problems(own1), "288 turns and looks have no edge")


def test_key_sets_are_compared_both_ways(own1):
    folder = own1 / "FloorPlan1"
    with h5py.File(folder / FEATURES, "a") as file:
        for place in "AB":
            del file[drawn.at(place, 0, 0)]
        file["9.00|0.00|0|0"] = np.ones((1, 512, 7, 7), "f4")
        file["mean"] = np.ones(3)
    with h5py.File(folder / "det_feature_22_cates.hdf5", "a") as file:
        del file[drawn.at("C", 45, 30)]
    found = problems(own1)
    assert is_one(found, "2 states of the graph are not in", FEATURES, "first -0.25|0.00|0|0")
    assert is_one(found, "1 states of", FEATURES, "not in the graph", "first 9.00|0.00|0|0")
    assert is_one(found, "1 odd keys in", FEATURES, "first mean")
    assert is_one(found, "1 states of the graph are not in", "det_feature", "0.25|0.00|45|30")
    assert len(found) == 5


def test_boxes_and_visible_map_of_other_states(own2):
    folder = own2 / "FloorPlan230"
    boxes = json.loads((folder / "objects_bb.json").read_text())
    del boxes[drawn.at("F", 90, 0)]
    boxes[drawn.at("A", 0, 0)] = {"Mug": [1, 2, 3, 4, 5]}
    (folder / "objects_bb.json").write_text(json.dumps(boxes))
    seen = json.loads((folder / "visible_object_map.json").read_text())
    seen["Laptop|+01.25|+00.85|+00.25"] += ["7.00|7.00|0|0", "here"]
    (folder / "visible_object_map.json").write_text(json.dumps(seen))
    found = problems(own2, "data2")
    assert is_one(found, "1 states of the graph are not in", "objects_bb", "0.00|-0.25|90|0")
    assert is_one(found, "objects_bb", "found boxes of Mug", "first -0.25|0.00|0|0")
    assert is_one(found, "visible_object_map.json are not in the graph", "first 7.00|7.00|0|0")
    assert is_one(found, "1 odd keys", "visible_object_map.json", "first here")


def test_numbers_that_are_wrong_are_counted_once(own1):
    def number(state):
        if state.endswith("|45|0"):
            return np.full((1, 512, 7, 7), np.nan)
        return np.ones((1, 512, 7, 6 if state == drawn.at("B", 0, 0) else 7))

    drawn.write_states(own1 / "FloorPlan1" / FEATURES, number)
    found = problems(own1)
    assert is_one(found, "6 states of", FEATURES, "not finite", "first -0.25|0.00|45|0")
    assert is_one(found, "1 states of", "(1, 512, 7, 6)", "first 0.00|0.00|0|0")
    assert len(found) == 3
    quick = problems(own1, quick=True)
    assert not any("not finite" in line for line in quick)
    assert is_one(quick, "(1, 512, 7, 6)")


@pytest.mark.parametrize(
    ("file", "content", "part"),
    [(FEATURES, b"<html>", "found no readable"), ("graph.json", b"{", "found no readable"),
     ("grid.json", b"[1]", "no list of x, y, z"), ("grid.json", None, "found no grid.json"),
     ("visible_object_map_1.5.json", None, "found no visible_object_map_1.5.json or"),
     ("det_feature_22_cates.hdf5", b"\x89HDF\r\n\x1a\n", "found no readable")],
)  # fmt: skip
def test_a_file_that_is_gone_leaves_the_others_checked(own1, file, content, part):
    folder = own1 / "FloorPlan1"
    (folder / file).unlink()
    if content is not None:
        (folder / file).write_bytes(content)
    other = "det_feature_22_cates.hdf5" if file == FEATURES else FEATURES
    with h5py.File(folder / other, "a") as numbers:
        for place in "AB":
            del numbers[drawn.at(place, 0, 0)]
            numbers[drawn.at(place, 0, 0)] = np.zeros(5)
    found = problems(own1)
    assert is_one(found, part)
    assert is_one(found, "2 states of", other, "of shape (5,)", "first -0.25|0.00|0|0")


def test_truncated_features(own1):
    path = own1 / "FloorPlan1" / FEATURES
    path.write_bytes(path.read_bytes()[:-3000])
    assert is_one(problems(own1), "found no readable", FEATURES, "truncated")


def test_the_whole_root(data1, tmp_path):
    layout = LAYOUTS["data1"]
    folders = scene_folders(data1, layout)
    lines = check_root(data1, layout, folders)
    assert lines == ["118 of 120 scenes are not there, first FloorPlan2"]
    for name in ("FloorPlan1", "FloorPlan1_physics", "FloorPlan99"):
        (tmp_path / name).mkdir()
    lines = check_root(tmp_path, layout, scene_folders(tmp_path, layout))
    assert is_one(lines, "2 folders are no scene", "first FloorPlan1_physics")
    checked = {f.name: check_scene(f, Choice(layout, layout.objects), True) for f in folders}
    lines = check_alike({name: one.made_with for name, one in checked.items()})
    assert is_one(lines, "1 scenes were not made with", "det_feature", "first FloorPlan422")
