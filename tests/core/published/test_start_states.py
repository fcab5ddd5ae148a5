"""Published pickles become frozen episodes; what could run something is refused by name."""

import collections
import json
import os
import pickle
import subprocess

import numpy as np
import pytest
import torch

from cfnav_core.published import start_states
from cfnav_core.published.start_states import StartState, read_episodes, read_pickle
from cfnav_core.scenes.scene import SceneError


class ThorAgentState:
    """As the published module has it."""

    def __init__(self, x, z, rotation, horizon):
        self.x, self.y, self.z = x, 0.9, z
        self.rotation, self.horizon = rotation, horizon


def entry(**changes):
    return {
        "scene": "FloorPlan24", "state": "-0.00|2.75|135|30", "goal_object_type": "Toaster",
        "task_data": ["Toaster|+00.62|+00.85|+01.40"],
    } | changes  # fmt: skip


def pickled(path, value, protocol=3):
    path.write_bytes(pickle.dumps(value, protocol))
    return path


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
def test_three_kinds_of_files(tmp_path, protocol):
    state = ThorAgentState(np.float64(-1.25), 0.5, 45.0, np.int64(0))
    arrays = [
        np.arange(60.0)[:, None], torch.arange(300.0), np.zeros(3, "U5"),
        torch.arange(4.0).to(torch.float64)[1:],
    ]  # fmt: skip
    if protocol == 5:
        arrays = arrays[1:2]  # numpy writes arrays in another way, which no published file has
    entries = [
        entry(glove_embedding=arrays),
        entry(scene="FloorPlan228_physics", state=state, goal_object_type="Laptop"),
        entry(scene="FloorPlan422", state=ThorAgentState(0.25, -0.0, 270, 30), room="Bathroom"),
    ]
    assert read_pickle(pickled(tmp_path / "test.pkl", entries, protocol)) == [
        StartState("FloorPlan24", "0.00|2.75|135|30", "Toaster"),
        StartState("FloorPlan228", "-1.25|0.50|45|0", "Laptop"),
        StartState("FloorPlan422", "0.25|0.00|270|30", "Toaster"),
    ]


class Runs:
    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize(
    ("call", "name"),
    [((os.system, "touch {}"), "posix.system"), ((eval, "open('{}', 'w')"), "builtins.eval"),
     ((subprocess.run, ["touch", "{}"]), "subprocess.run"), ((getattr, "a", "b"), "getattr"),
     ((np.load, "{}"), "numpy.load"), ((collections.Counter, "a"), "collections.Counter")],
)  # fmt: skip
@pytest.mark.parametrize("protocol", [2, 5])
def test_what_could_run_something_is_refused(tmp_path, call, name, protocol):
    mark = tmp_path / "mark"
    arguments = [a.format(mark) if isinstance(a, str) else a for a in call[1:]]
    path = pickled(tmp_path / "t.pkl", [entry(glove=Runs(call[0], *arguments))], protocol)
    with pytest.raises(SceneError, match=rf"found .*{name.split('.')[-1]}, expected only .*t\.pkl"):
        read_pickle(path)
    assert not mark.exists()


def test_a_nested_pickle_of_a_tensor_stays_closed(tmp_path):
    mark = tmp_path / "mark"
    inner = pickle.dumps(Runs(os.system, f"touch {mark}"))
    path = pickled(tmp_path / "t.pkl", [entry(g=Runs(torch.storage._load_from_bytes, inner))])
    assert read_pickle(path)[0].scene == "FloorPlan24"
    assert not mark.exists()


@pytest.mark.parametrize(
    "content",
    [pickle.dumps([entry()])[:-20], b"", b"<html>", pickle.dumps(5), pickle.dumps([{"scene": 1}]),
     pickle.dumps([entry(goal_object_type=None)]), pickle.dumps([entry(state=np.zeros(4))]),
     pickle.dumps(np.float64(1)), pickle.dumps([5])],
)  # fmt: skip
def test_other_files_get_one_sentence(tmp_path, content):
    (tmp_path / "t.pkl").write_bytes(content)
    with pytest.raises(SceneError, match=r"found no list of episodes .*t\.pkl .*again"):
        read_pickle(tmp_path / "t.pkl")


@pytest.mark.parametrize(
    "change", [{"scene": "FloorPlan31"}, {"scene": "Kitchen1"}, {"state": "0.10|0.00|0|0"}]
)
def test_episodes_outside_the_data_are_refused(tmp_path, change):
    with pytest.raises(SceneError, match=r"found (scene|state)"):
        read_pickle(pickled(tmp_path / "t.pkl", [entry(), entry(**change)]))


def test_frozen_episodes_come_back_and_know_their_hash(tmp_path):
    source = pickled(tmp_path / "kitchen_test_22.pkl", [entry(), entry(goal_object_type="Pan")])
    episodes = read_pickle(source)
    out = tmp_path / "deep" / "episodes.json"
    start_states.write_episodes(out, episodes, [source])
    assert read_episodes(out) == episodes
    assert [p.name for p in out.parent.iterdir()] == ["episodes.json"]
    data = json.loads(out.read_text())
    assert data["sha256"] == start_states.identity(episodes)
    assert data["sha256"] != start_states.identity(episodes[::-1])
    assert list(data["made_from"]) == ["kitchen_test_22.pkl"]
    out.write_text(out.read_text().replace("Pan", "Pot"))
    with pytest.raises(SceneError, match="not those of its hash"):
        read_episodes(out)
    out.write_text("{}")
    with pytest.raises(SceneError, match="found no readable episodes"):
        read_episodes(out)
