"""Episodes of published data come in the shares of the published rule."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chisquare

from cfnav_core.learn.env import ObjectNavEnv, SceneBank
from cfnav_core.learn.evaluate import Episodes
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.scenes.store import HEAD
from cfnav_core.scenes.store_writer import StoreWriter
from cfnav_core.task.vocabulary import CATEGORY_ID
from tests.core.worlds import hall

DRAWS = 20_000


def scene(name: str, room_type: str, **instances: int) -> OfflineScene:
    """A hall with so many instances of its goals, which stand in different corners."""
    corners = dict(zip(instances, ((3, 2), (0, 2), (3, 0)), strict=False))
    out = hall(4, 3, pillars=(), goals=corners, name=f"{room_type}:0")
    counts = np.zeros(len(CATEGORY_ID), np.int16)
    for goal, count in instances.items():
        counts[CATEGORY_ID[goal]] = count
    return replace(out, name=name, instances=counts)


SCENES = [
    scene("FloorPlan1", "kitchen", Chair=3, Sink=1),
    scene("FloorPlan2", "kitchen", Sink=2),
    scene("FloorPlan3", "kitchen", Bowl=1, Chair=2, Sink=1),
    scene("FloorPlan401", "bathroom", Sink=1, Towel=1),
]
IN_ITS_SCENE = {
    (0, "Chair"): 3 / 4, (0, "Sink"): 1 / 4, (1, "Sink"): 1, (2, "Bowl"): 1 / 4,
    (2, "Chair"): 2 / 4, (2, "Sink"): 1 / 4, (3, "Sink"): 1 / 2, (3, "Towel"): 1 / 2,
}  # fmt: skip
OF_SCENE = {
    "data1": {0: 1 / 4, 1: 1 / 4, 2: 1 / 4, 3: 1 / 4},
    "data2": {0: 1 / 6, 1: 1 / 6, 2: 1 / 6, 3: 1 / 2},
    "savn": {0: 1 / 6, 1: 1 / 6, 2: 1 / 6, 3: 1 / 2},
}


def bank_of(folder, layout: str) -> SceneBank:
    writer = StoreWriter(folder, layout, "drawn", folder)
    for one in SCENES:
        writer.append(one, "train")
    writer.finish()
    return SceneBank.load(folder)


def shares(bank: SceneBank, states: np.ndarray, goals: np.ndarray) -> list[int]:
    drawn = list(zip(bank.scene[states].tolist(), (bank.objects[g] for g in goals), strict=True))
    assert set(drawn) == set(IN_ITS_SCENE)
    return [drawn.count(task) for task in IN_ITS_SCENE]


def likely(counts: list[int], layout: str) -> bool:
    expected = [p * OF_SCENE[layout][k] * sum(counts) for (k, _), p in IN_ITS_SCENE.items()]
    return chisquare(counts, expected).pvalue > 1e-3


@pytest.mark.parametrize("layout", ["data1", "data2", "savn"])
def test_training_and_evaluation_draw_by_the_rule(tmp_path, layout):
    bank = bank_of(tmp_path / "store", layout)
    drawn = Episodes.draw(bank, DRAWS, seed=1)
    counts = shares(bank, drawn.states, drawn.goals)
    assert likely(counts, layout)
    # the test can tell the rules apart
    assert not likely(counts, "data2" if layout == "data1" else "data1")
    env = ObjectNavEnv(bank, DRAWS, np.random.default_rng(2))
    assert likely(shares(bank, env.state.numpy(), env.goal.numpy()), layout)


def test_starts_are_all_level_states_alike(tmp_path):
    bank = bank_of(tmp_path / "store", "data1")
    drawn = Episodes.draw(bank, DRAWS, seed=3)
    chosen = drawn.states[bank.scene[drawn.states] == 1]
    level = np.arange(bank.offsets[1], bank.offsets[2])[SCENES[1].horizon == 0]
    counts = [np.count_nonzero(chosen == s) for s in level]
    assert sum(counts) == len(chosen)
    assert chisquare(counts).pvalue > 1e-3
    # among them those that see the goal already, whose shortest path is Done alone
    seeing = bank.visible[drawn.states, drawn.goals]
    assert seeing.any()
    assert (bank.actions_to[drawn.states, drawn.goals][seeing] == 0).all()


def test_built_in_scenes_are_drawn_alike(tmp_path):
    bank = SceneBank(SCENES)
    drawn = Episodes.draw(bank, DRAWS, seed=1)
    assert chisquare(shares(bank, drawn.states, drawn.goals)).pvalue > 1e-3
    assert not bank.visible[drawn.states, drawn.goals].any()


def test_a_store_of_an_unknown_layout(tmp_path):
    bank_of(tmp_path / "store", "data1")
    head = tmp_path / "store" / HEAD
    head.write_text(head.read_text().replace('"data1"', '"data9"'))
    with pytest.raises(SceneError, match=r"found layout 'data9' in .*expected built-in, data1"):
        SceneBank.load(tmp_path / "store")
