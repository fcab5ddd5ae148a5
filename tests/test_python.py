"""``import cfnav``: every block of docs/python.md runs, and what it costs to import."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cfnav
from cfnav_core.perception.perception import OnnxPerception
from cfnav_core.policy.bundle import shipped_bundle, shipped_perception
from cfnav_core.task.actions import Action
from tests.conftest import ROOT
from tests.core.worlds import hall
from tests.ros.conftest import SECOND, SyntheticBag

BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(), re.DOTALL)
DRIVE = [Action.MoveAhead, Action.RotateLeft, Action.Done]


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Small scenes of the shipped perception, a bundle that was trained on it and a bag of two
    drives, where the page has them."""
    folder = tmp_path_factory.mktemp("python") / "out"
    shutil.copytree(shipped_bundle(), folder / "mine")
    identity = OnnxPerception(shipped_perception()).identity
    for seed in range(2):
        scene = replace(hall(seed=seed, name=f"kitchen:{seed}"), perception=identity)
        scene.save(folder / "scenes" / f"kitchen_{seed:05d}")
    (folder / "demo").mkdir()
    bag = SyntheticBag(folder / "demo/bag")
    second = bag.episode(SECOND, DRIVE)
    bag.episode(second, DRIVE, goal="Fridge", touch=(1,), seen=False)
    bag.writer.close()
    return folder


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_a_block_of_the_page_runs(
    block: str, out: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if "stable_baselines3" in block:
        pytest.importorskip("stable_baselines3", reason="pip install 'cfnav[sb3]' to run it")
    monkeypatch.chdir(out.parent)
    exec(compile(block, "docs/python.md", "exec"), {})
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines()), default=0) < 400  # no arrays


def test_what_is_shown_is_short_and_says_what_there_is(out: Path) -> None:
    policy = cfnav.load()
    assert "seeks nothing yet" in repr(policy)
    policy.act(np.zeros((300, 300, 3), np.uint8), goal="Mug")
    assert re.fullmatch(r"<Policy .+ \(\w+\): \d+ goals, seeks Mug>", repr(policy))
    found = cfnav.evaluate(scenes=str(out / "scenes"), episodes=20)
    assert re.match(r"<Evaluation of .+: 20 episodes, SR \d\.\d+, CF-SR \d\.\d+ \[", repr(found))
    assert re.fullmatch(r"<Bag .+: 6 topics>", repr(cfnav.Bag(str(out / "demo/bag"))))
    clean, touching = cfnav.judge(str(out / "demo"))
    assert repr(clean).startswith("<Drive to Laptop: done, reached, 0 touches, 3 steps, 0.25 m")
    assert repr(touching).startswith("<Drive to Fridge: done, not reached, 1 touches, 3 steps")
    assert repr(clean.drive).startswith("<Drive to Laptop: ")


def test_a_goal_is_given_at_loading_or_with_the_first_picture() -> None:
    picture = np.zeros((300, 300, 3), np.uint8)
    loaded, told = cfnav.load(goal="Mug"), cfnav.load()
    for _ in range(3):
        a, b = loaded.act(picture), told.act(picture, goal="Mug")
        np.testing.assert_array_equal(a.probabilities, b.probabilities)
    again = told.act(picture, goal="Laptop")  # another goal: nothing is remembered
    told.reset("Laptop")
    np.testing.assert_array_equal(again.probabilities, told.act(picture).probabilities)
    with pytest.raises(ValueError, match="found goal 'Unicorn'"):
        told.act(picture, goal="Unicorn")


def test_two_bundles_meet_the_same_episodes(out: Path) -> None:
    same = cfnav.compare("default", None, out / "scenes", episodes=20, seed=3)
    assert (same.difference, same.interval) == (0.0, None)
    assert "CF-SR +0.000 (too few rooms for an interval: " in repr(same)
    assert "of 20 episodes" in repr(same)


def test_a_bag_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(Exception, match="nothing does not exist"):
        cfnav.Bag(tmp_path / "nothing")


def test_the_vector_leaves_the_threads_of_the_learner_alone(out: Path) -> None:
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        env = cfnav.make_vec_env(out / "scenes", num_envs=4)
        env.reset(seed=0)
        env.step(np.full(4, int(Action.RotateLeft)))
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(before)


def python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_importing_is_fast_and_loads_nothing_heavy() -> None:
    code = """
import sys, time
begun = time.process_time()
import cfnav
spent = time.process_time() - begun
heavy = {"torch", "mujoco", "rclpy", "gymnasium", "numpy", "onnxruntime", "tyro"}
print(spent, heavy & sys.modules.keys() or "")
"""
    spent = python(code)
    assert float(spent) < 0.1  # seconds of CPU; only a number: nothing heavy follows it


@pytest.mark.parametrize("order", ["import cfnav, gymnasium", "import gymnasium, cfnav"])
def test_gymnasium_knows_the_environment_in_either_order(order: str) -> None:
    assert python(f"{order}; print('cfnav/ObjectNav-v0' in gymnasium.registry)") == "True"


def test_every_public_name_is_there_and_no_other() -> None:
    assert set(cfnav.HOME) <= set(dir(cfnav))
    assert all(callable(getattr(cfnav, name)) for name in cfnav.HOME if name != "make_sb3_env")
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        cfnav.fly  # noqa: B018


def test_what_is_not_installed_is_a_sentence() -> None:
    code = """
import sys
sys.modules["gymnasium"] = None
import cfnav
try:
    cfnav.make_env
except ModuleNotFoundError as error:
    print(error)
"""
    assert python(code) == (
        "found no gymnasium, which this needs; install it with pip install 'cfnav[train]'"
    )
