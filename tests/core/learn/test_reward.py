"""Rewards against numbers worked out by hand."""

import math

import numpy as np
import pytest
import torch

from cfnav_core.agent.reward import (
    REWARDS,
    RewardMemory,
    RewardTables,
    StepFacts,
    path_shaping,
    total_reward,
)
from cfnav_core.models.base import Knowledge
from cfnav_core.task.actions import Action
from cfnav_core.task.vocabulary import ROOM_TYPES

OBJECTS = ("Mug", "Sink", "Fridge", "Sofa")
MUG, SINK, FRIDGE, SOFA = range(4)
KITCHEN, BATHROOM = ROOM_TYPES.index("kitchen"), ROOM_TYPES.index("bathroom")


def knowledge() -> Knowledge:
    """In kitchens a mug's parents are the sink (0.25) and the fridge (0.1).

    Words: the sink is at 60 degrees from the mug, the fridge at 30, the sofa opposite.
    """
    parents = np.zeros((4, 4, 4), np.float32)
    parents[KITCHEN, MUG, [SINK, FRIDGE]] = 0.25, 0.1
    angles = np.radians([0, 60, 30, 180])
    return Knowledge(parents=parents, words=3 * np.stack([np.cos(angles), np.sin(angles)], 1))


def step(
    action: Action = Action.RotateLeft, success: bool = False, sees: tuple[int, ...] = (),
    room: int = KITCHEN, distance: tuple[float, float] = (2.0, 2.0),
    path: tuple[float, float] = (3.0, 3.0),
) -> StepFacts:  # fmt: skip
    """One episode's step on the way to a mug."""
    visible = torch.zeros(1, len(OBJECTS), dtype=torch.bool)
    visible[0, list(sees)] = True
    distances = (torch.tensor([x]) for x in (*distance, *path))
    numbers = (torch.tensor([x]) for x in (MUG, room))
    return StepFacts(torch.tensor([int(action)]), torch.tensor([success]), *numbers, *distances,
                     visible)  # fmt: skip


def rewards(name: str, *steps: StepFacts) -> list[float]:
    """r_o of the steps of one episode."""
    memory, out = RewardMemory.start(1, len(OBJECTS)), []
    tables = RewardTables.of(name, knowledge())
    for facts in steps:
        reward, memory = REWARDS[name](facts, memory, tables)
        assert reward.shape == (1,)
        assert reward.dtype == torch.float32
        out.append(reward.item())
    return out


SUCCESS = {"action": Action.Done, "success": True, "sees": (MUG,)}


def test_baseline():
    steps = step(), step(Action.MoveAhead), step(Action.Done), step(**SUCCESS)
    assert rewards("baseline", *steps) == pytest.approx([-0.01, -0.01, -0.01, 5])


def test_hoz_gives_the_cost_of_moving_back():
    steps = step(), step(Action.MoveAhead), step(Action.Done), step(**SUCCESS)
    assert rewards("hoz", *steps) == pytest.approx([-0.01, 0, -0.01, 5])


def test_layout_rewards_coming_nearer_only():
    steps = (
        step(Action.MoveAhead, distance=(2.0, 1.75)),
        step(Action.MoveAhead, distance=(1.75, 2.0)),
        step(Action.RotateLeft),
        step(Action.Done),
        # success replaces everything, whatever the distances
        step(**SUCCESS, distance=(1.0, 0.5)),
    )
    assert rewards("layout", *steps) == pytest.approx([0.025, 0, -0.01, -0.01, 5])
    assert rewards("layout", step(distance=(math.inf, math.inf))) == pytest.approx([-0.01])


def test_mjolnir_rewards_each_parent_once():
    steps = (
        step(sees=(SINK, FRIDGE)),  # the larger of two, the other is left for later
        step(sees=(SINK, FRIDGE)),
        step(sees=(SINK, FRIDGE)),
        step(sees=(SOFA, MUG)),  # no parents
    )
    assert rewards("mjolnir", *steps) == pytest.approx([0.25, 0.1, -0.01, -0.01])


def test_mjolnir_done():
    seen = step(sees=(SINK,))
    right = {"action": Action.Done, "success": True}
    # a success adds what is in view again, or the step's cost; a wrong Done gets no parent
    assert rewards("mjolnir", seen, step(**right, sees=(MUG, SINK)))[1] == pytest.approx(5.25)
    assert rewards("mjolnir", seen, step(**right, sees=(MUG,)))[1] == pytest.approx(4.99)
    assert rewards("mjolnir", step(Action.Done, sees=(SINK,))) == pytest.approx([-0.01])


def test_mjolnir_parents_belong_to_a_room_type():
    assert rewards("mjolnir", step(sees=(SINK,), room=BATHROOM)) == pytest.approx([-0.01])


def test_similarity_rewards_a_new_best():
    steps = (
        step(sees=(SOFA,)),  # opposite to the goal: no better than nothing
        step(sees=(SINK,)),
        step(sees=(SINK,)),
        step(sees=(SINK, FRIDGE)),
        step(sees=(SINK,)),
        step(sees=(MUG,)),
        step(Action.Done),
    )
    expected = [-0.01, 0.05, -0.01, 0.1 * math.cos(math.radians(30)), -0.01, 0.1, -0.01]
    assert rewards("similarity", *steps) == pytest.approx(expected)
    # Done counts what is in view afresh
    assert rewards("similarity", step(sees=(MUG,)), step(**SUCCESS)) == pytest.approx([0.1, 5.1])
    assert rewards("similarity", step(Action.Done, sees=(SINK,))) == pytest.approx([-0.01])


@pytest.mark.parametrize("name", REWARDS)
def test_a_batch_is_its_episodes_side_by_side(name):
    tables = RewardTables.of(name, knowledge())
    steps = [
        step(Action.MoveAhead, sees=(SINK,), distance=(2.0, 1.5)),
        step(sees=(FRIDGE, SINK)),
        step(**SUCCESS),
    ]
    together = StepFacts(*(torch.cat(v) for v in zip(*(vars(s).values() for s in steps))))  # noqa: B905
    memory = RewardMemory(torch.tensor([[0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]]).bool(),
                          torch.tensor([0.0, 0.7, 0.2]))  # fmt: skip
    reward, after = REWARDS[name](together, memory, tables)
    for k, facts in enumerate(steps):
        row = RewardMemory(memory.seen_parents[k : k + 1], memory.best_similarity[k : k + 1])
        alone, own = REWARDS[name](facts, row, tables)
        assert reward[k] == alone[0]
        assert torch.equal(after.seen_parents[k], own.seen_parents[0])
        assert after.best_similarity[k] == own.best_similarity[0]


def test_memory_forgets_ended_episodes_only():
    memory = RewardMemory(torch.ones(2, 4, dtype=torch.bool), torch.tensor([0.5, 0.5]))
    memory = memory.forget(torch.tensor([True, False]))
    assert memory.seen_parents.tolist() == [[False] * 4, [True] * 4]
    assert memory.best_similarity.tolist() == [0.0, 0.5]


@pytest.mark.parametrize(("name", "table"), [("mjolnir", "parents"), ("similarity", "words")])
def test_missing_tables_are_named_before_a_run(name, table):
    with pytest.raises(ValueError, match=f"found no {table} .* cfnav data knowledge"):
        RewardTables.of(name, Knowledge())


def test_path_shaping_is_signed_metres():
    assert path_shaping(step(path=(3.0, 2.75))).item() == 0.25
    assert path_shaping(step(path=(2.75, 3.0))).item() == -0.25
    assert path_shaping(step(path=(2.0, math.inf))).item() == 0


def test_total_reward_of_equation_4():
    r = total_reward(torch.tensor([5.0, -0.01]), torch.tensor([False, True]), -0.5)
    assert r.tolist() == pytest.approx([5.0, -0.51])
