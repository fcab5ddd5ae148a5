"""What a file of trials may hold; the trials themselves are driven in ``test_demo.py``."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cfnav_core.files.locks import locked
from cfnav_core.policy.bundle import find_bundle
from studies.live.identities import WORLD, identity_of, world_of
from studies.live.trials import TrialsConfig, camera_of, run


@pytest.fixture
def config(tmp_path: Path) -> TrialsConfig:
    return TrialsConfig(out=tmp_path / "trials.jsonl")


def held(config: TrialsConfig, **changed: Any) -> None:
    """Write down a trial as if it had been driven so, but for what is changed."""
    row = {
        "trial": {"room": "kitchen:20", "goal": "Fridge", "seed": 1}, "bundle": "shipped",
        "networks": identity_of(find_bundle(None)), "speed": config.speed, "veto": False,
        "lock_step": True, "camera": "mast", "max_steps": 0, "world": WORLD,
    }  # fmt: skip
    config.out.write_text(json.dumps(row | changed) + "\n")


@pytest.mark.parametrize(
    "changed",
    [
        {"networks": "others"}, {"world": "another"}, {"max_steps": 9}, {"bundle": "elsewhere"},
        {"veto": True}, {"depth_down_deg": 65.0},
    ],
)  # fmt: skip
def test_a_file_of_other_trials_is_refused(config: TrialsConfig, changed: dict[str, Any]) -> None:
    held(config, **changed)
    before = config.out.read_text()
    (name,) = changed
    with pytest.raises(OSError, match=rf"trials.jsonl holds episodes run with .*'{name}'.*--out"):
        run(config)
    assert config.out.read_text() == before


def test_lines_from_before_a_condition_stand_for_what_held_then(config: TrialsConfig) -> None:
    held(config)
    row = json.loads(config.out.read_text())
    del row["max_steps"]
    config.out.write_text(json.dumps(row) + "\n")
    with pytest.raises(OSError, match=r"'max_steps': 0.*not .*'max_steps': 5"):
        run(replace(config, max_steps=5))


def test_rooms_of_each_furniture_have_their_own_version() -> None:
    assert world_of(["kitchen:25", "bathroom:24"]) == WORLD
    both = world_of(["kitchen:25", "sweet_home.kitchen:300"])
    assert both.startswith(WORLD.partition(",")[0] + ", sweet_home rooms ")
    assert both.endswith(WORLD.partition(",")[2])


def test_two_processes_never_add_to_one_file(config: TrialsConfig) -> None:
    with (
        locked(config.out.with_suffix(".lock")),
        pytest.raises(OSError, match=r"trials.lock held by another process"),
    ):
        run(config)


def test_a_camera_file_is_known_by_its_content(tmp_path: Path) -> None:
    """Trials of one file are of one camera, whatever its name comes to mean."""
    path = tmp_path / "mine.json"
    path.write_text("{}")
    before = camera_of(TrialsConfig(camera=str(path)))
    path.write_text("{ }")
    assert before != camera_of(TrialsConfig(camera=str(path))) != str(path)
    assert camera_of(TrialsConfig(camera="mast")) == "mast"
