"""The reader gives back what was drawn."""

import functools
import json
import shutil

import h5py
import numpy as np
import pytest

from cfnav_core.published.arrays import open_features
from cfnav_core.published.keys import Key, state_of
from cfnav_core.published.reader import Choice, read_scene
from cfnav_core.scenes.layouts import LAYOUTS, objects_of, recognise, scene_folders, scenes_root
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.task.actions import Action

from . import drawn


def read(root, name, layout=None, **choice) -> OfflineScene:
    layout = layout or recognise(root)
    folder = next(f for f in scene_folders(root, layout) if f.name == name)
    return read_scene(folder, Choice(layout, objects_of(layout, root), **choice))


intact = functools.cache(read)
"""Of the roots that no test damages."""


def as_the_controller_does(state: str, action: Action) -> str | None:
    """Text of the state an action should lead to, by the published controller's floats."""
    x, z, rotation, horizon = (float(part) for part in state.split("|"))
    if action is Action.MoveAhead:
        sin, cos = np.sin(np.radians(rotation)), np.cos(np.radians(rotation))
        x, z = x + 0.25 * np.sign(np.round(sin, 6)), z + 0.25 * np.sign(np.round(cos, 6))
    elif action in (Action.RotateLeft, Action.RotateRight):
        rotation = (rotation + (45 if action is Action.RotateRight else -45)) % 360
    elif action in (Action.LookUp, Action.LookDown):
        horizon += 30 if action is Action.LookDown else -30
        if not 0 <= horizon <= 30:
            return None
    return drawn.key(x, z, int(rotation), int(horizon))


@pytest.mark.parametrize(
    ("fixture", "name"),
    [("data1", "FloorPlan1"), ("data1", "FloorPlan422"), ("data2", "FloorPlan219"),
     ("data2", "FloorPlan230"), ("savn", "FloorPlan2"), ("savn", "FloorPlan402")],
)  # fmt: skip
def test_every_state_and_every_edge_come_back(fixture, name, request):
    scene = intact(request.getfixturevalue(fixture), name)
    graph = drawn.graph()
    index = {state: state_of(scene, state) for state in drawn.STATES}
    assert sorted(index.values()) == list(range(96))
    for state, i in index.items():
        for action in list(Action)[:5]:
            expected = as_the_controller_does(state, action)
            moves = expected is not None and graph.has_edge(state, expected)
            assert scene.next_state[i, action] == (index[expected] if moves else i)
        assert scene.next_state[i, Action.Done] == i
        ahead = as_the_controller_does(state, Action.MoveAhead)
        assert scene.collided[i] == (not graph.has_edge(state, ahead))
        features = drawn.numbers((512, 7, 7), state).astype(np.float16)
        np.testing.assert_array_equal(scene.features[i], features)
    scene.check(scene.name, 96)


def test_ways_that_were_drawn_blocked(data1):
    scene = intact(data1, "FloorPlan1")

    def after(place, rotation, action):
        return int(scene.next_state[state_of(scene, drawn.at(place, rotation, 0)), action])

    # the free end of a blocked diagonal, and the one-way street
    assert after("A", 45, Action.MoveAhead) == state_of(scene, drawn.at("A", 45, 0))
    assert after("C", 315, Action.MoveAhead) == state_of(scene, drawn.at("D", 315, 0))
    assert after("B", 180, Action.MoveAhead) == state_of(scene, drawn.at("F", 180, 0))
    assert after("F", 0, Action.MoveAhead) == state_of(scene, drawn.at("F", 0, 0))
    # a turn without its edge fails and is no collision
    stuck = state_of(scene, drawn.at("E", 90, 0))
    assert after("E", 90, Action.RotateRight) == stuck
    assert scene.collided[stuck]  # by the wall ahead
    assert not scene.collided[state_of(scene, drawn.at("B", 90, 0))]


def test_frames(data1):
    scene = intact(data1, "FloorPlan1")
    state = state_of(scene, "0.25|0.00|0|30")
    # z is forward: rotation 0 looks along +y, which is heading 2
    assert scene.positions[scene.position[state]].tolist() == [0.25, 0.0]
    assert (scene.heading[state], scene.horizon[state]) == (2, 1)
    assert scene.heading[state_of(scene, "0.25|0.00|90|0")] == 0
    assert scene.heading[state_of(scene, "0.25|0.00|135|0")] == 7
    left = scene.next_state[state, Action.RotateLeft]
    assert scene.heading[left] == 3
    # along the heading, as for built-in rooms
    b = state_of(scene, "0.00|0.00|90|0")
    moved = scene.positions[scene.position[scene.next_state[b, Action.MoveAhead]]]
    assert moved.tolist() == [0.25, 0.0]


def test_objects_and_distances(data1):
    scene = intact(data1, "FloorPlan1")
    laptop, sink, toaster = (scene.objects.index(n) for n in ("Laptop", "Sink", "Toaster"))
    seen = {drawn.at(*s) for s in drawn.LAPTOP}
    for state in drawn.STATES:
        i = state_of(scene, state)
        assert scene.visible[i, laptop] == (state in seen)
        assert scene.visible[i, sink] == (state in {drawn.at(*s) for s in drawn.BASIN})
    assert scene.goals == ("Laptop", "Sink")
    assert scene.instances[[laptop, sink, toaster]].tolist() == [1, 2, 0]
    assert scene.instances.sum() == 3
    c = scene.position[state_of(scene, drawn.at("C", 0, 0))]
    # the basin is the nearer of the two sinks; the toaster is seen from nowhere
    assert scene.distance[c, sink] == pytest.approx(0.5)
    assert scene.distance[c, laptop] == pytest.approx(np.hypot(1.0, 0.25))
    assert np.isinf(scene.distance[c, toaster])


@pytest.mark.parametrize("name", ["FloorPlan1", "FloorPlan422"])
def test_detector_tables_give_the_22_targets_in_order(data1, name):
    scene = intact(data1, name)
    assert list(scene.objects) == drawn.names(drawn.TWENTY_TWO)
    assert scene.detections.shape == (96, 22, 517)
    for state in drawn.STATES:
        expected = drawn.table(state, drawn.TWENTY_TWO).astype(np.float16)
        np.testing.assert_array_equal(scene.detections[state_of(scene, state)], expected)


def test_tables_of_two_detectors_are_two_perceptions(data1):
    assert intact(data1, "FloorPlan1").perception != intact(data1, "FloorPlan422").perception


def test_boxes_become_four_numbers(data2):
    scene = intact(data2, "FloorPlan230")
    assert list(scene.objects) == sorted(scene.objects)
    assert scene.detections.shape == (96, 101, 4)
    seen = scene.detections[state_of(scene, drawn.at(*drawn.LAPTOP[0]))]
    # boxes (30, 60, 90, 120) and (150, 0, 210, 30): hull from (30, 0) to (210, 120)
    expected = [1.0, 120 / 300, 52.5 / 300, 180 * 120 / 300**2]
    np.testing.assert_allclose(seen[scene.objects.index("Laptop")], expected, atol=1e-3)
    assert np.count_nonzero(seen.any(1)) == 1  # Wall is no object, Mug has no box
    assert not scene.detections[state_of(scene, drawn.at("A", 0, 0))].any()


def test_savn_has_no_detections_and_goals_by_room_type(savn, data2):
    kitchen, bathroom = intact(savn, "FloorPlan2"), intact(savn, "FloorPlan402")
    assert kitchen.detections.shape == (96, 18, 0)
    assert (kitchen.room_type, kitchen.goals) == ("kitchen", ())  # no Laptop, no Sink there
    assert (bathroom.room_type, bathroom.goals) == ("bathroom", ("Sink",))
    assert intact(data2, "FloorPlan219").goals == ("Laptop",)
    assert intact(data2, "FloorPlan219").room_type == "living_room"


def test_one_layout_in_another_name_of_its_root(data2):
    assert scenes_root(data2.parent.parent) == data2
    with pytest.raises(SceneError, match="found no FloorPlan"):
        scenes_root(data2.parent.parent, LAYOUTS["savn"])


def test_layouts_are_told_apart(data1, data2, savn, own1):
    assert [recognise(r).name for r in (data1, data2, savn)] == ["data1", "data2", "savn"]
    (own1 / "FloorPlan1/objects_bb.json").write_text("{}")
    with pytest.raises(SceneError, match=r"data1 and data2.*--layout"):
        recognise(own1)
    for name in ("objects_bb.json", "visible_object_map_1.5.json", "det_feature_22_cates.hdf5"):
        (own1 / "FloorPlan1" / name).unlink()
    with pytest.raises(SceneError, match=r"no one data set.*--layout"):
        recognise(own1)


def test_own_list_of_objects_is_read(own2, tmp_path):
    gcn = tmp_path.parent / "gcn"
    gcn.mkdir()
    names = list(reversed(LAYOUTS["data2"].objects))
    (gcn / "objects.txt").write_text("\n".join(names) + "\n")
    scene = read(own2, "FloorPlan230")
    assert scene.objects == tuple(names)
    seen = scene.detections[state_of(scene, drawn.at(*drawn.LAPTOP[0]))]
    assert seen[names.index("Laptop"), 0] == 1
    (gcn / "objects.txt").write_text("\n".join(names[:50]))
    with pytest.raises(SceneError, match=r"found no .*AlarmClock.*objects\.txt"):
        objects_of(LAYOUTS["data2"], own2)
    shutil.rmtree(gcn)


def test_undirected_graph_goes_both_ways(own2):
    drawn.write_graph(own2 / "FloorPlan230/graph.json", undirected=True)
    scene = read(own2, "FloorPlan230")
    here = np.arange(96)
    # an edge is written once, so each turn would be missing in one direction
    for action in (Action.RotateLeft, Action.RotateRight):
        assert (scene.next_state[:, action] != here).all()
    looks = scene.next_state[:, [Action.LookUp, Action.LookDown]]
    assert (looks.max(1) - looks.min(1) == 1).all()
    # B facing 0 has no edge from F, but F facing 180 is not the way back either
    f = state_of(scene, drawn.at("F", 0, 0))
    assert scene.next_state[f, Action.MoveAhead] == f


def test_plain_zero_wins_where_both_are_spelled(tmp_path):
    with h5py.File(tmp_path / "f.hdf5", "w", track_order=True) as file:
        for text, number in (("0.00|0.25|0|0", 1.0), ("-0.00|0.25|0|0", 2.0)):
            file.create_dataset(text, data=np.full((512, 7, 7), number))
    with open_features(tmp_path / "f.hdf5") as source:
        assert list(source.known) == [Key(0, 1, 0, 0)]
        assert (source.row(Key(0, 1, 0, 0)) == 1.0).all()


def test_clip_maps_by_choice(own2):
    drawn.write_states(
        own2 / "FloorPlan230/clip_featuremap.hdf5",
        lambda state: drawn.numbers((1, 2048, 7, 7), state)[:, :, :1, :1].repeat(7, 2).repeat(7, 3),
    )
    assert read(own2, "FloorPlan230").features.shape == (96, 512, 7, 7)
    clip = read(own2, "FloorPlan230", features="clip_featuremap.hdf5")
    assert clip.features.shape == (96, 2048, 7, 7)
    assert "clip_featuremap" in clip.perception


ODD = ["0.10|0.00|0|0", "0.25|0.00|20|0", "0.25|0.00|0|60", "0.25|0.00|0", "a|b|c|d", "nan|0|0|0"]


@pytest.mark.parametrize("text", ODD)
def test_odd_keys_are_refused(text):
    with pytest.raises(SceneError, match=r"found state .*expected x\|z\|rotation\|horizon"):
        Key.parse(text)


def test_spellings_of_one_key():
    assert Key.parse("-0.00|0.25|45.0|0") == Key.parse("0.0|0.25|45|-0") == Key(0, 1, 45, 0)
    assert str(Key.parse("-0.00|-1.25|315|30")) == "0.00|-1.25|315|30"


def with_node(path, node):
    data = json.loads(path.read_text())
    data["nodes"].append({"id": node})
    path.write_text(json.dumps(data))


def test_states_without_numbers_are_refused_or_left_out(own1):
    folder = own1 / "FloorPlan1"
    gone = drawn.at("B", 0, 0)
    with h5py.File(folder / "resnet18_featuremap.hdf5", "a") as file:
        del file[gone]
    with_node(folder / "graph.json", "0.10|0.00|0|0")
    with pytest.raises(SceneError, match=r"found state '0.10.*graph.json"):
        read(own1, "FloorPlan1")
    drawn.write_graph(folder / "graph.json")
    with pytest.raises(SceneError, match=r"found no state 0.00\|0.00\|0\|0 in .*1 of 96"):
        read(own1, "FloorPlan1")
    with_node(folder / "graph.json", "0.10|0.00|0|0")
    scene = read(own1, "FloorPlan1", drop_bad=True)
    assert scene.num_states == 95
    # an edge to a state that was left out is no edge
    f = state_of(scene, drawn.at("A", 90, 0))
    turned = state_of(scene, drawn.at("B", 45, 0))
    assert scene.next_state[f, Action.MoveAhead] == state_of(scene, drawn.at("B", 90, 0))
    assert scene.next_state[turned, Action.RotateLeft] == turned


def damage(folder, kind):
    features, tables = folder / "resnet18_featuremap.hdf5", folder / "det_feature_22_cates.hdf5"
    state = drawn.at("C", 0, 0)
    if kind == "truncated":
        features.write_bytes(features.read_bytes()[:-5000])
    elif kind == "no hdf5":
        features.write_text("<html>quota exceeded</html>")
    elif kind == "missing":
        features.unlink()
    elif kind == "missing tables":
        tables.unlink()
    elif kind == "detr only":
        tables.rename(folder / "detr_feature_22cls.hdf5")
    elif kind == "json":
        (folder / "graph.json").write_text('{"nodes": [')
    elif kind == "no links":
        (folder / "graph.json").write_text('{"nodes": [{"id": "0.00|0.00|0|0"}]}')
    elif kind == "visible":
        (folder / "visible_object_map_1.5.json").write_text('{"Mug": []}')
    else:
        numbers = {
            "nan": lambda s: np.where(s == state, np.nan, np.ones((512, 7, 7))),
            "large": lambda s: np.full((512, 7, 7), 1e5 if s == state else 1.0),
            "shape": lambda s: np.ones((512, 7, 6) if s == state else (512, 7, 7)),
            "mixed": lambda s: np.ones((2048 if s == state else 512, 7, 7)),
            "rows": lambda s: np.ones((21 if s == state else 22, 517)),
            "detr": lambda s: np.ones((5, 264)),
        }[kind]
        drawn.write_states(tables if kind in ("rows", "detr") else features, numbers)


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [("truncated", "found no readable .*truncated.*again"),
     ("no hdf5", "found no readable .*resnet18_featuremap.hdf5"),
     ("missing", "found no resnet18_featuremap.hdf5 or clip_featuremap.hdf5 in .*again"),
     ("missing tables", "found no det_feature_22_cates.hdf5 or"),
     ("detr only", "DETR detections are not read here"),
     ("json", "found no readable .*graph.json"),
     ("no links", "found .*graph.json without 'edges'"),
     ("visible", "found .*visible_object_map_1.5.json that cannot be read"),
     ("nan", r"not finite.*state 0.25\|0.00\|0\|0 of .*resnet18"),
     ("large", r"not finite.*65504"),
     ("shape", r"found features of shape \(512, 7, 6\), expected .*state 0.25\|0.00\|0\|0"),
     ("mixed", r"found numbers of shape \(2048, 7, 7\) in state 0.25\|0.00\|0\|0"),
     ("rows", r"found detections of shape \(21, 517\), expected \(22, 517\) or \(60, 517\)"),
     ("detr", "found DETR detections")],
)  # fmt: skip
def test_damage_gets_its_sentence(own1, kind, sentence):
    damage(own1 / "FloorPlan1", kind)
    with pytest.raises(SceneError, match=sentence):
        read(own1, "FloorPlan1", LAYOUTS["data1"])


def test_boxes_that_are_not_in_fours(own2):
    path = own2 / "FloorPlan230/objects_bb.json"
    boxes = json.loads(path.read_text())
    boxes[drawn.at("C", 0, 0)] = {"Laptop": [1, 2, 3]}
    path.write_text(json.dumps(boxes))
    with pytest.raises(SceneError, match=r"found boxes of Laptop .*state 0.25\|0.00\|0\|0"):
        read(own2, "FloorPlan230")
    path.write_text("[]")
    with pytest.raises(SceneError, match=r"found .*objects_bb.json without a table"):
        read(own2, "FloorPlan230")
