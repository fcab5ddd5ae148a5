"""Published data from the archive to figures: convert, train, evaluate on published episodes."""

from __future__ import annotations

import json
import pickle
import sys

import pytest

from cfnav import cli
from cfnav_core.published.start_states import identity, read_episodes

from . import drawn

SMALL = """--hidden 16 --channels 4 --predictor-hidden 8 --batch 4 --rollout-length 10
--stage1-episodes 4 --stage2-episodes 4 --validation-every 4 --validation-episodes 5"""


@pytest.fixture
def cfnav(monkeypatch):
    """Runs command lines that succeed."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["cfnav", *map(str, arguments)])
        assert cli.main() == 0

    return run


@pytest.fixture
def test_episodes(tmp_path, cfnav):
    """Freezes six published test episodes of a scene; the file, and what it holds."""

    def freeze(scene, goal):
        starts = [drawn.at(p, r, h) for p in "ABF" for r, h in ((45, 0), (180, 30))]
        entries = [{"scene": scene, "goal_object_type": goal, "state": s} for s in starts]
        pickled, out = tmp_path / "test.pkl", tmp_path / "test.json"
        pickled.write_bytes(pickle.dumps(entries))
        cfnav("data", "episodes", pickled, "--out", out)
        return out, read_episodes(out)

    return freeze


def evaluated(cfnav, tmp_path, *arguments):
    out = tmp_path / "figures.json"
    cfnav("evaluate", *arguments, "--json", out)
    return json.loads(out.read_text())


def test_offline_data_1(cfnav, test_episodes, tmp_path, capsys):
    for name in ("FloorPlan1", "FloorPlan21", "FloorPlan22"):
        drawn.write_data1(tmp_path / "Scene_Data" / name)
    store, run = tmp_path / "store", tmp_path / "run"
    cfnav("data", "convert", tmp_path, "--out", store, "--processes", 1)
    cfnav("train", "--scenes", store, "--train-rooms", "train", "--validation-rooms", "validation",
          "--model", "baseline_label", *SMALL.split(), "--out", run)  # fmt: skip
    frozen, episodes = test_episodes("FloorPlan22", "Laptop")
    best, at_end = run / "best.safetensors", run / "checkpoint.safetensors"
    capsys.readouterr()
    found = evaluated(cfnav, tmp_path, best, "--scenes", store, "--frozen", frozen,
                      "--against", at_end)  # fmt: skip
    assert (found["checkpoint"], found["model"]) == (str(best), "Baseline (label)")
    assert (found["episodes"], found["scenes"]) == (6, ["FloorPlan22"])
    assert found["episodes_identity"] == identity(episodes)[:16]
    assert found["against"]["checkpoint"] == str(at_end)
    assert found["paired"]["cf_sr_difference"] == found["cf_sr"] - found["against"]["cf_sr"]
    assert f"{best} (Baseline (label), ours): 6 episodes  SR " in capsys.readouterr().out


def test_offline_data_2(cfnav, test_episodes, tmp_path):
    for name in ("FloorPlan201", "FloorPlan219", "FloorPlan230"):
        drawn.write_data2(tmp_path / "thor_v1_offline_data" / name)
    store, run, known = tmp_path / "store", tmp_path / "run", tmp_path / "known.safetensors"
    cfnav("data", "convert", tmp_path, "--out", store, "--processes", 1)
    cfnav("data", "knowledge", store, "--out", known)
    cfnav("train", "--scenes", store, "--train-rooms", "train", "--validation-rooms", "validation",
          "--model", "tdanet", "--knowledge", known, *SMALL.split(), "--out", run)  # fmt: skip
    known.unlink()  # the checkpoint holds what it needs of it
    frozen, _ = test_episodes("FloorPlan230", "Laptop")
    command = (run / "best.safetensors", "--scenes", store, "--frozen", frozen)
    found = evaluated(cfnav, tmp_path, *command)
    assert (found["model"], found["episodes"]) == ("TDANet-style", 6)
    assert found == evaluated(cfnav, tmp_path, *command)
    by_split = evaluated(cfnav, tmp_path, command[0], "--scenes", store, "--rooms", "test",
                         "--episodes", 30, "--sample")  # fmt: skip
    assert (by_split["episodes"], by_split["scenes"]) == (30, ["FloorPlan230"])
