"""``cfnav data`` on the three layouts, a store and built-in scenes."""

import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cfnav import cli
from cfnav_core.published.reader import Choice, read_scene
from cfnav_core.published.start_states import read_episodes
from cfnav_core.scenes.layouts import LAYOUTS, scene_folders
from cfnav_core.scenes.store import StoreHead, open_store
from tests.conftest import wait_until
from tests.core.worlds import hall

from . import drawn
from .test_store import assert_same, scene


@pytest.fixture
def cfnav(monkeypatch, capsys):
    """Runs a command line; returns exit code, standard output and standard error."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["cfnav", "data", *map(str, arguments)])
        handler = signal.getsignal(signal.SIGTERM)
        try:
            code = cli.main()
        except SystemExit as end:
            code = end.code
        finally:
            signal.signal(signal.SIGTERM, handler)
        out = capsys.readouterr()
        return code, out.out, out.err

    return run


def test_info_of_a_published_folder(cfnav, data1):
    code, out, _ = cfnav("info", data1.parent)
    assert code == 0
    assert out.splitlines() == [
        f"{data1.parent}: published data1",
        "scene         room type  split  positions  states  targets",
        "FloorPlan1    kitchen    train          6      96        2",
        "FloorPlan422  bathroom   test           6      96        2",
        "2 scenes                               12     192",
    ]


def test_info_of_built_in_scenes(cfnav, tmp_path):
    scene("kitchen:7", 4).save(tmp_path / "kitchen_00007")
    scene("kitchen:30", 4).save(tmp_path / "kitchen_00030")
    code, out, _ = cfnav("info", tmp_path)
    assert code == 0
    assert [line.split() for line in out.splitlines()[2:4]] == [
        ["kitchen:7", "kitchen", "data1:train", "data2:train", "4", "64", "2"],
        ["kitchen:30", "kitchen", "-", "4", "64", "2"],
    ]


def test_info_names_a_damaged_scene_beside_the_others(cfnav, data2, tmp_path):
    root = tmp_path / "copy"
    shutil.copytree(data2, root)
    graph = root / "FloorPlan219/graph.json"
    graph.write_bytes(graph.read_bytes()[:100])
    code, out, _ = cfnav("info", root)
    assert code == 1
    _, _, damaged, whole, total = out.splitlines()
    name, *cells = damaged.split(maxsplit=6)
    assert (name, cells[:5]) == ("FloorPlan219", ["living_room", "validation", "-", "-", "-"])
    assert cells[5].startswith(f"found no readable {graph}")
    assert whole.split() == ["FloorPlan230", "living_room", "test", "6", "96", "1"]
    assert total.split() == ["2", "scenes", "6", "96"]


def test_info_names_a_damaged_built_in_scene(cfnav, tmp_path):
    for seed in (7, 8):
        scene(f"kitchen:{seed}", 4).save(tmp_path / f"kitchen_{seed:05d}")
    (tmp_path / "kitchen_00007/heading.npy").unlink()
    code, out, _ = cfnav("info", tmp_path)
    assert code == 1
    assert "found" in out.splitlines()[2]
    assert out.splitlines()[3].split()[0] == "kitchen:8"


def test_check_of_built_in_scenes(cfnav, tmp_path):
    hall(name="kitchen:7").save(tmp_path / "kitchen_00007")
    assert cfnav("check", tmp_path)[:2] == (0, f"{tmp_path}: no problems\n")
    np.save(tmp_path / "kitchen_00007/heading.npy", np.zeros(3, np.int8))
    code, out, _ = cfnav("check", tmp_path)
    assert code == 1
    assert "heading.npy changed since it was written" in out
    assert "found heading of shape (3,)" in out
    assert out.endswith(": 2 problems\n")


def test_convert_in_two_processes_then_info_and_check(cfnav, data2, tmp_path):
    store = tmp_path / "store"
    code, out, _ = cfnav("convert", data2, "--out", store, "--processes", 2)
    assert (code, out) == (0, f"2 scenes, 192 states in {store}\n")
    assert [p.name for p in tmp_path.iterdir()] == ["store"]
    layout = LAYOUTS["data2"]
    for found, folder in zip(open_store(store), scene_folders(data2, layout), strict=True):
        assert_same(found, read_scene(folder, Choice(layout, layout.objects)))
    code, out, _ = cfnav("info", store)
    assert (code, out.splitlines()[2].split()) == (
        0, ["FloorPlan219", "living_room", "validation", "6", "96", "1"],
    )  # fmt: skip
    assert StoreHead.load(store).names("test") == ["FloorPlan230"]
    assert cfnav("check", store)[:2] == (0, f"{store}: no problems\n")
    with (store / "collided.npy").open("r+b") as file:
        file.seek(-1, 2)
        file.write(b"\x07")
    code, out, _ = cfnav("check", store)
    assert code == 1
    assert "collided.npy changed since it was written" in out
    code, _, err = cfnav("convert", data2, "--out", store)
    assert code == 2
    assert "already; remove it or name another folder" in err


def test_convert_packs_built_in_scenes(cfnav, tmp_path):
    rooms, store = tmp_path / "rooms", tmp_path / "store"
    scene = hall(name="kitchen:20")
    scene.save(rooms / "kitchen_00020")
    code, out, _ = cfnav("convert", rooms, "--split", "data1", "--out", store)
    assert (code, out) == (0, f"1 scenes, {scene.num_states} states in {store}\n")
    assert "kitchen:20  kitchen    validation" in cfnav("info", store)[1]
    assert cfnav("check", store)[:2] == (0, f"{store}: no problems\n")
    for wrong in ((), ("--split", "data1", "--drop-bad")):
        code, _, err = cfnav("convert", rooms, "--out", tmp_path / "other", *wrong)
        assert code == 2
        assert "say how to split them with --split data1 or --split data2" in err


def test_published_data_has_its_own_splits(cfnav, data2, tmp_path):
    code, _, err = cfnav("convert", data2, "--split", "data2", "--out", tmp_path / "store")
    assert code == 2
    assert "published data has splits of its own" in err


def test_convert_goes_on_after_a_scene_was_mended(cfnav, data2, tmp_path):
    root, store = tmp_path / "copy", tmp_path / "store"
    shutil.copytree(data2, root)
    boxes = root / "FloorPlan230/objects_bb.json"
    whole = boxes.read_bytes()
    boxes.write_bytes(whole[:100])
    command = ("convert", root, "--out", store, "--processes", 1)
    code, _, err = cfnav(*command)
    assert code == 2
    assert "found no readable" in err.splitlines()[-1]
    assert not store.exists()
    assert StoreHead.load(tmp_path / "store.partial").names() == ["FloorPlan219"]
    boxes.write_bytes(whole)
    # the first scene is not read again
    shutil.rmtree(root / "FloorPlan219")
    (root / "FloorPlan219").mkdir()
    assert cfnav(*command)[0] == 0
    assert StoreHead.load(store).names() == ["FloorPlan219", "FloorPlan230"]
    assert [s.num_states for s in open_store(store)] == [96, 96]


def test_scenes_of_two_detectors_make_no_store(cfnav, data1, tmp_path):
    code, _, err = cfnav("convert", data1, "--out", tmp_path / "store", "--processes", 1)
    assert code == 2
    assert "found perception" in err
    assert "in FloorPlan422" in err


FIRST_SCENES = """
import sys
from pathlib import Path
from cfnav_core.published.convert import convert
from cfnav_core.scenes.layouts import LAYOUTS, scene_folders
from cfnav_core.published.reader import Choice
layout = LAYOUTS["data2"]
root, choice = Path(sys.argv[1]), Choice(layout, layout.objects)
convert(root, scene_folders(root, layout), choice, Path(sys.argv[2]))
"""


def test_a_killed_convert_goes_on(cfnav, data2, tmp_path):
    root, store = tmp_path / "copy", tmp_path / "store"
    shutil.copytree(data2, root)
    boxes = root / "FloorPlan230/objects_bb.json"
    boxes.unlink()
    os.mkfifo(boxes)  # whoever reads the second scene waits here for ever
    command = [sys.executable, "-c", FIRST_SCENES, str(root), str(store)]
    first = subprocess.Popen(command, cwd=Path(__file__).parents[3], stderr=subprocess.DEVNULL)
    begun = (tmp_path / "store.partial/store.json").exists
    wait_until(lambda: begun() or first.poll() is not None, "the first scene")
    assert first.poll() is None
    first.kill()
    first.wait()
    boxes.unlink()
    shutil.copy(data2 / "FloorPlan230/objects_bb.json", boxes)
    assert cfnav("convert", root, "--out", store, "--processes", 1)[0] == 0
    assert [s.num_states for s in open_store(store)] == [96, 96]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["copy", "store"]


def test_check_says_what_is_wrong(cfnav, own1):
    code, out, _ = cfnav("check", own1, "--quick", "--processes", 1)
    lines = out.splitlines()
    assert code == 1
    assert lines[0] == "119 of 120 scenes are not there, first FloorPlan2"
    assert lines[1].startswith("FloorPlan1: 2 turns and looks have no edge")
    assert lines[2:] == [f"{own1}: 2 problems"]


def test_drop_bad_and_layout(cfnav, own1, tmp_path):
    folder = own1 / "FloorPlan1"
    data = json.loads((folder / "graph.json").read_text())
    data["nodes"].append({"id": "0.13|0.00|0|0"})
    (folder / "graph.json").write_text(json.dumps(data))
    command = ("convert", own1, "--out", tmp_path / "store", "--processes", 1)
    code, _, err = cfnav(*command)
    assert code == 2
    assert "found state '0.13|0.00|0|0', expected" in err
    shutil.rmtree(tmp_path / "store.partial")
    assert cfnav(*command, "--drop-bad", "--layout", "data1")[0] == 0
    assert open_store(tmp_path / "store")[0].num_states == 96


def test_episodes(cfnav, tmp_path):
    files = []
    for kind, number in (("kitchen", 22), ("bathroom", 422)):
        entry = {"scene": f"FloorPlan{number}", "goal_object_type": "Sink"}
        entries = [entry | {"state": drawn.at(p, 45, 30)} for p in "ABC"]
        files.append(tmp_path / f"{kind}_test_22.pkl")
        files[-1].write_bytes(pickle.dumps(entries))
    out = tmp_path / "episodes.json"
    code, text, _ = cfnav("episodes", *files, "--out", out, "--first", 2)
    assert code == 0
    assert text.startswith(f"4 episodes in {out}, ")
    episodes = read_episodes(out)
    assert [(e.scene, e.state) for e in episodes[1:3]] == [
        ("FloorPlan22", "0.00|0.00|45|30"), ("FloorPlan422", "-0.25|0.00|45|30"),
    ]  # fmt: skip
    files[0].write_bytes(pickle.dumps([np.load]))
    code, _, err = cfnav("episodes", *files, "--out", out)
    assert (code, len(err.splitlines())) == (2, 1)
    assert "numpy.load" in err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [(("info", "nowhere"), "found no FloorPlan folders in nowhere"),
     (("check", "nowhere"), "found no FloorPlan folders in nowhere"),
     (("convert", "nowhere"), "found no FloorPlan folders in nowhere"),
     (("episodes", "nowhere.pkl", "--out", "x.json"), "found no list of episodes"),
     (("episodes", "--out", "x.json"), "found no episodes to take"),
     (("export-ai2thor", "--scenes", "FloorPlan1", "--out", "x"), "found no ai2thor"),
     (("export-ai2thor", "--scenes", "Attic1", "--out", "x"), "found scene 'Attic1'"),
     (("export-ai2thor", "--out", "x", "--scenes"), "found no scene to export")],
)  # fmt: skip
def test_bad_input_is_one_sentence_and_exit_2(cfnav, tmp_path, monkeypatch, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ai2thor.controller", None)
    code, out, err = cfnav(*arguments)
    assert (code, out) == (2, "")
    assert sentence in err
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_without_h5py_there_is_one_sentence(cfnav, data1, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    command = ("convert", data1, "--out", tmp_path / "s", "--processes", 1)
    code, _, err = cfnav(*command)
    assert code == 2
    assert "found no h5py, which this needs; install it with pip install" in err
