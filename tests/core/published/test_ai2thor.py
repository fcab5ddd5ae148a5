"""Our loop over poses, with a scripted simulator; AI2-THOR itself is not tested here."""

import json
import math
import sys
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from cfnav_core.files.whole import WriteError
from cfnav_core.published import ai2thor
from cfnav_core.published.keys import state_of
from cfnav_core.published.reader import Choice, read_room
from cfnav_core.scenes.layouts import LAYOUTS, scene_folders
from cfnav_core.task.actions import Action
from tests.core.disks import AGAIN, full_disk

POSITIONS = [(0.0, 0.0), (0.25, 0.0), (0.25, 0.25), (0.0, 0.25)]
MUG, SOFA = "Mug|+01.00|+00.90|+00.00", "Sofa|-02.00|+00.50|+00.00"


class Scripted:
    """Four points; a post stands on the diagonal; no pose at (0, 0.25) can look down."""

    def __init__(self, offset=0.0):
        self.offset, self.stopped = offset, False
        self.pose = (0.0, 0.0, 0, 0)

    def reset(self, scene):
        self.scene = scene
        return self._event(True)

    def stop(self):
        self.stopped = True

    def step(self, *, action, **arguments):
        return getattr(self, action)(**arguments)

    def GetReachablePositions(self):  # noqa: N802
        points = [{"x": x + self.offset, "y": 0.9, "z": z} for x, z in POSITIONS]
        return self._event(True, points)

    def Teleport(self, position, rotation, horizon, standing):  # noqa: N802
        assert standing
        where = (position["x"], position["z"])
        possible = where in POSITIONS and not (where == (0.0, 0.25) and horizon)
        if possible:
            self.pose = (*where, rotation["y"], horizon)
        return self._event(possible)

    def MoveAhead(self, moveMagnitude):  # noqa: N802, N803
        x, z, rotation, horizon = self.pose
        angle = math.radians(rotation)
        end = (x + moveMagnitude * math.sin(angle), z + moveMagnitude * math.cos(angle))
        nearest = min(POSITIONS, key=lambda p: math.dist(p, end))
        if rotation % 90 or math.dist(nearest, end) > 1e-6:  # the post, or a wall
            return self._event(False)
        if (x, z) == (0.25, 0.25) and rotation == 180:  # slides off the grid along something
            nearest = (0.3, 0.0)
        self.pose = (*nearest, rotation, horizon)
        return self._event(True)

    def _event(self, success, returned=None):
        x, z, rotation, _ = self.pose
        boxes = {MUG: (10, 20, 30, 40), SOFA: None} if rotation == 90 else {}
        return SimpleNamespace(
            metadata={
                "lastActionSuccess": success, "actionReturn": returned,
                "agent": {"position": {"x": x, "y": 0.9, "z": z}},
                "objects": [
                    {"objectId": MUG, "visible": rotation == 90 and x == 0.25},
                    {"objectId": SOFA, "visible": False},
                ],
            },
            frame=np.full((6, 6, 3), hash(self.pose) % 256, np.uint8),
            instance_detections2D=boxes,
        )  # fmt: skip


@pytest.fixture
def exported(tmp_path):
    assert ai2thor.export_scene(Scripted(), "FloorPlan1", tmp_path) == 3 * 16 + 8
    return tmp_path


def test_our_reader_reads_what_was_driven(exported):
    layout = LAYOUTS["data2"]
    (folder,) = scene_folders(exported, layout)
    _, scene = read_room(folder, Choice(layout, layout.objects))
    assert scene.num_states == 56

    def leads(key, action):
        return scene.next_state[state_of(scene, key), action]

    assert leads("0.00|0.00|90|30", Action.MoveAhead) == state_of(scene, "0.25|0.00|90|30")
    # the diagonal's end is free but the way is not, and a slide is no step
    for blocked in ("0.00|0.00|45|0", "0.25|0.25|180|0"):
        assert scene.collided[state_of(scene, blocked)]
    assert not scene.collided[state_of(scene, "0.25|0.00|0|0")]
    # (0, 0.25) has no state that looks down
    assert leads("0.00|0.25|0|0", Action.LookDown) == state_of(scene, "0.00|0.25|0|0")
    assert leads("0.00|0.00|0|30", Action.MoveAhead) == state_of(scene, "0.00|0.00|0|30")
    mug, sofa = layout.objects.index("Mug"), layout.objects.index("Sofa")
    seen = {state_of(scene, f"0.25|{z}|90|{h}") for z in ("0.00", "0.25") for h in (0, 30)}
    assert set(np.nonzero(scene.visible[:, mug])[0]) == seen
    assert scene.instances[[mug, sofa]].tolist() == [1, 0]


def test_the_files(exported):
    folder = exported / "FloorPlan1"
    assert sorted(p.name for p in folder.iterdir()) == [
        "graph.json", "grid.json", "images.hdf5", "objects_bb.json", "visible_object_map_1.5.json",
    ]  # fmt: skip
    boxes = json.loads((folder / "objects_bb.json").read_text())
    assert boxes["0.00|0.00|90|30"] == {"Mug": [10, 20, 30, 40]}
    assert boxes["0.00|0.00|0|0"] == {}
    assert json.loads((folder / "visible_object_map_1.5.json").read_text())[SOFA] == []
    with h5py.File(folder / "images.hdf5") as images:
        assert set(images) == set(boxes)
        for pose in ((0.0, 0.0, 0, 0), (0.25, 0.25, 315, 30)):
            x, z, rotation, horizon = pose
            picture = images[f"{x:.2f}|{z:.2f}|{rotation}|{horizon}"][()]
            assert (picture == hash(pose) % 256).all()
    assert [p.name for p in exported.iterdir()] == ["FloorPlan1"]


def test_another_grid_and_another_room_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"found position .*expected multiples of 0\.25"):
        ai2thor.export_scene(Scripted(offset=0.1), "FloorPlan1", tmp_path)
    with pytest.raises(ValueError, match="found scene 'FloorPlan77'"):
        ai2thor.export_scene(Scripted(), "FloorPlan77", tmp_path)
    assert not (tmp_path / "FloorPlan1").exists()


@pytest.mark.parametrize("most", [1000, 5000, 20_000])
def test_a_full_disk_leaves_nothing_of_the_scene(tmp_path, most):
    """Pictures, and then the larger of the other files, do not fit."""
    with full_disk(most), pytest.raises(WriteError, match=AGAIN):
        ai2thor.export_scene(Scripted(), "FloorPlan1", tmp_path)
    assert not list(tmp_path.iterdir())


def test_what_the_simulator_says_is_no_full_disk(tmp_path):
    def times_out(**_):
        raise TimeoutError("no answer from the simulator")

    controller = Scripted()
    controller.MoveAhead = times_out
    with pytest.raises(TimeoutError, match=r"^no answer from the simulator$"):
        ai2thor.export_scene(controller, "FloorPlan1", tmp_path)
    assert not list(tmp_path.iterdir())


def test_without_the_package_there_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "ai2thor", None)
    monkeypatch.setitem(sys.modules, "ai2thor.controller", None)
    with pytest.raises(ValueError, match=r"found no ai2thor .*pip install ai2thor"):
        ai2thor.start()


def test_without_its_build_there_is_one_sentence(monkeypatch):
    def fails(**_):
        raise ConnectionError("no route to the build")

    module = SimpleNamespace(Controller=fails)
    monkeypatch.setitem(sys.modules, "ai2thor", SimpleNamespace(controller=module))
    monkeypatch.setitem(sys.modules, "ai2thor.controller", module)
    with pytest.raises(ValueError, match=r"does not start .ConnectionError: no route.*Unity build"):
        ai2thor.start()
