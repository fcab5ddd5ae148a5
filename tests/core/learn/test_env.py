from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from cfnav_core.learn.env import ObjectNavEnv, SceneBank
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.actions import Action
from cfnav_core.task.camera import CAMERAS
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.vocabulary import CATEGORY_ID
from tests.core.worlds import hall


@pytest.fixture
def bank() -> SceneBank:
    return SceneBank([hall(name="kitchen:0"), hall(4, 4, name="living_room:1", seed=1,
                                                   goals={"Laptop": (3, 3)})])  # fmt: skip


def make(bank: SceneBank, batch: int = 64, seed: int = 0) -> ObjectNavEnv:
    return ObjectNavEnv(bank, batch, np.random.default_rng(seed))


def test_starts_are_level_and_do_not_see_the_goal(bank):
    env = make(bank, 500)
    assert (env.state % 2 == 0).all()
    assert not bank.visible[env.state.numpy(), env.goal.numpy()].any()
    assert set(env.goal.tolist()) == {CATEGORY_ID["Laptop"], CATEGORY_ID["Mug"]}


def test_scenes_do_not_leak_into_each_other(bank):
    first = hall().num_states
    crosses = (np.arange(len(bank.next_state)) < first)[:, None] != (bank.next_state < first)
    assert not crosses.any()


def test_blocked_move_is_a_collision_and_stays(bank):
    env = make(bank)
    blocked = torch.from_numpy(np.nonzero(bank.collided)[0])
    env.state = blocked[torch.arange(env.batch) % len(blocked)]
    before = env.state.clone()
    result = env.step(torch.full((env.batch,), int(Action.MoveAhead)))
    assert result.collided.all()
    assert (env.state == before).all()
    assert (env.collisions == 1).all()
    assert not (result.terminated | result.truncated).any()


def test_looking_past_the_limit_is_no_collision(bank):
    env = make(bank)
    before = env.state.clone()
    result = env.step(torch.full((env.batch,), int(Action.LookUp)))
    assert not result.collided.any()
    assert (env.state == before).all()


def test_done_succeeds_only_with_the_goal_in_view(bank):
    env = make(bank)
    seen = np.nonzero(bank.visible[:, CATEGORY_ID["Laptop"]])[0]
    env.goal = torch.full((env.batch,), CATEGORY_ID["Laptop"])
    env.state[0] = int(seen[0])
    visible = bank.visible[env.state.numpy(), env.goal.numpy()]
    result = env.step(torch.full((env.batch,), int(Action.Done)))
    assert result.terminated.all()
    assert visible[0]
    assert not visible.all()
    assert result.success.tolist() == visible.tolist()


def test_step_limit_truncates_and_restart_forgets(bank):
    env = make(bank)
    env.steps[:] = torch.from_numpy(bank.step_limit)[env.state] - 1
    result = env.step(torch.full((env.batch,), int(Action.RotateLeft)))
    assert result.truncated.all()
    assert not result.terminated.any()
    env.restart(result.truncated)
    assert (env.steps == 0).all()
    assert (env.collisions == 0).all()
    assert set(np.unique(bank.step_limit)) == {100, 200}


def test_training_episodes_can_be_shorter(bank):
    env = ObjectNavEnv(bank, 8, np.random.default_rng(0), most_steps=30)
    turn = torch.full((env.batch,), int(Action.RotateLeft))
    ends = [bool(env.step(turn).truncated.any()) for _ in range(29)]
    assert not any(ends)
    assert env.step(turn).truncated.all()


def test_same_seed_same_rollout(bank):
    def states(seed: int) -> list[int]:
        env, actions = make(bank, 8, seed), torch.Generator().manual_seed(0)
        out = []
        for _ in range(50):
            step = env.step(torch.randint(0, 6, (8,), generator=actions))
            env.restart(step.terminated | step.truncated)
            out += env.state.tolist()
        return out

    assert states(3) == states(3)
    assert states(3) != states(4)


def test_scenes_of_two_perceptions_do_not_mix():
    with pytest.raises(SceneError, match="2 kinds"):
        SceneBank([hall(), replace(hall(), perception="other")])


def test_pictures_of_two_cameras_do_not_mix_and_what_detectors_say_does():
    seen = [replace(hall(), camera=CAMERAS[name]) for name in ("stock_wide", "mast")]
    with pytest.raises(SceneError, match=r"2 cameras \(66 x 40 .*, 90 x 90 .*same --camera"):
        SceneBank(seen)
    said = [replace(s, fields=SIGHTINGS) for s in seen]
    assert SceneBank(said).camera is None
    assert SceneBank(said[:1]).camera == CAMERAS["stock_wide"]


def test_a_scene_without_a_goal_that_can_be_reached_is_named():
    with pytest.raises(SceneError, match="no goal that can be reached in kitchen:1, so"):
        SceneBank([hall(name="kitchen:0"), hall(name="kitchen:1", goals={})])


MAPPED = """
import sys
from pathlib import Path
import torch
from cfnav_core.learn import blocks, env
from cfnav_core.learn.train import own_memory_mb, peak_memory_mb
blocks.IN_MEMORY_BYTES = int(sys.argv[2])
bank = env.SceneBank.load(Path(sys.argv[1]))
before, peak = own_memory_mb(), peak_memory_mb()
for first in range(0, len(bank.scene), 8):
    features, _ = bank.observe(torch.arange(first, min(first + 8, len(bank.scene))))
print(own_memory_mb() - before, peak)
"""


def test_large_features_stay_on_disk_and_small_ones_are_joined_once(tmp_path):
    """8 states in use cost little; joining costs the features once, never twice."""
    scene = hall(12, 6)
    wide = np.random.default_rng(0).random((scene.num_states, 64, 28, 28)).astype(np.float16)
    replace(scene, features=wide).save(tmp_path / "kitchen_00000")
    megabytes, peaks = wide.nbytes / 2**20, {}
    for limit in (0, 2**40):
        done = subprocess.run(
            [sys.executable, "-c", MAPPED, str(tmp_path), str(limit)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        grown, peaks[limit] = map(float, done.stdout.split())
        assert grown < 0.35 * megabytes
    # mapped pages that were read count too
    assert peaks[2**40] - peaks[0] < 2.4 * megabytes


def test_goals_that_are_left_out_are_neither_asked_for_nor_detected(tmp_path: Path) -> None:
    hall(name="kitchen:0").save(tmp_path / "kitchen_00000")
    hall(name="kitchen:1", goals={"Mug": (0, 0)}).save(tmp_path / "kitchen_00001")
    mug = SceneBank.load(tmp_path).objects.index("Mug")
    states = torch.arange(hall().num_states)
    for in_memory in (True, False):
        every = SceneBank.load(tmp_path, ["kitchen:0"], in_memory=in_memory)
        bank = SceneBank.load(tmp_path, in_memory=in_memory, leave_out=["Mug"])
        assert bank.names == ["kitchen:0"]
        assert {bank.objects[goal] for goal in bank.tasks.goal} == {"Laptop"}
        expected = every.observe(states)[1].clone()
        assert expected[:, mug].any()
        expected[:, mug] = 0
        assert torch.equal(bank.observe(states)[1], expected)
    with pytest.raises(ValueError, match="found the goals Unicorn to leave out"):
        SceneBank.load(tmp_path, leave_out=["Unicorn"])
    with pytest.raises(ValueError, match="found no room with another goal than Laptop, Mug"):
        SceneBank.load(tmp_path, leave_out=["Laptop", "Mug"])
