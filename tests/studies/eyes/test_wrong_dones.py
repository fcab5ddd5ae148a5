"""What a policy knew when it said Done."""

from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, Evaluation, Trace
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.actions import Action
from cfnav_core.task.detections import HULLS, SCORES, SIGHTINGS, Fields
from cfnav_core.task.metrics import EpisodeResult
from studies.engine.pages import table
from studies.eyes.wrong_dones import BEFORE, COLUMNS, FAR, NEAR, NEVER, rows
from tests.core.worlds import hall

HALL = hall(width=12)


def ended(
    detections: np.ndarray, fields: Fields, walks: list[list[int]], right: list[bool]
) -> Evaluation:
    """Episodes through such states of a hall, which end with Done but for the last one.

    Args:
        detections: float [S, D] of the goal.
        fields: their names.
        walks: the states of each episode, as many in all.
        right: whether it succeeded.
    """
    row = HALL.objects.index(HALL.goals[0])
    every = np.zeros((HALL.num_states, len(HALL.objects), len(fields)), np.float16)
    every[:, row] = detections
    bank = SceneBank([replace(HALL, detections=every, fields=fields)])
    these, states = np.arange(len(walks)), np.array(walks)
    trace = []
    for step, at in enumerate(states.T):
        last = step == states.shape[1] - 1
        actions = np.full(len(walks), Action.Done if last else Action.RotateLeft)
        actions[-1] = Action.RotateLeft
        trace.append(Trace(these, at, actions, np.zeros(len(walks), np.float32)))
    results = [EpisodeResult(ok, 0, 3, 3) for ok in right]
    episodes = Episodes(states[:, 0], np.full(len(walks), row))
    return Evaluation({}, HALL.goals[:1], bank, episodes, results, trace)


def sighted(distances: dict[int, float]) -> np.ndarray:
    """Sightings of the goal in some states, float [S, 6]."""
    table = np.zeros((HALL.num_states, len(SIGHTINGS)))
    for state, metres in distances.items():
        table[state, [SIGHTINGS.index("confidence"), SIGHTINGS.index("distance")]] = 0.4, metres
    return table


def test_dones_are_told_apart_by_what_was_seen_of_the_goal() -> None:
    near, far, unknown = 3, 4, 5
    found = ended(
        sighted({near: 1.2, far: 2.0, unknown: 0.0}), SIGHTINGS,
        [[0, 1], [near, 1], [far, near], [0, near], [0, far], [near, unknown], [0, 1]],
        [False, False, True, False, True, False, False],
    )  # fmt: skip
    said = {row["known"]: (row["dones"], row["right"], row["of_wrong"]) for row in rows(found)}
    assert said == {
        NEVER: (1, 0.0, 0.25),
        BEFORE: (1, 0.0, 0.25),
        NEAR: (2, 0.5, 0.25),
        FAR: (2, 0.5, 0.25),
    }


def test_perception_tells_what_is_shown_and_what_is_near() -> None:
    near, shown, doubtful = 3, 4, 5
    scores = np.zeros((HALL.num_states, len(SCORES)))
    for state, sure, close in ((near, 0.2, 0.7), (shown, 0.7, 0.2), (doubtful, 0.4, 0.4)):
        scores[state, [SCORES.index("score"), SCORES.index("near")]] = sure, close
    walks = [[0, near], [0, shown], [shown, doubtful], [0, doubtful], [0, near]]
    said = {row["known"]: row for row in rows(ended(scores, SCORES, walks, [True, *[False] * 4]))}
    assert [said[kind]["dones"] for kind in (NEVER, BEFORE, FAR, NEAR)] == [1, 1, 1, 1]
    assert [said[kind]["right"] for kind in (NEVER, BEFORE, FAR, NEAR)] == [0.0, 0.0, 0.0, 1.0]


def test_of_the_wrong_ones_it_is_said_where_the_goal_was() -> None:
    goal = HALL.objects.index(HALL.goals[0])
    far = HALL.distance[HALL.position, goal]
    by_place = np.zeros(len(HALL.positions), bool)
    by_place[HALL.position[HALL.visible[:, goal]]] = True
    around = by_place[HALL.position] & ~HALL.visible[:, goal]
    turned, close, beyond = (
        int(np.flatnonzero(which)[0])
        for which in (around, ~by_place[HALL.position] & (far < 2.5), far > 2.5)
    )
    walks = [[0, turned], [0, turned], [0, close], [0, beyond], [0, beyond]]
    # the second is right and the last says no Done
    found = ended(sighted({}), SIGHTINGS, walks, [False, True, False, False, False])
    row = rows(found)[0]
    assert row["known"] == NEVER
    assert row["turned"] == row["beyond"] == pytest.approx(1 / 3)


def test_what_never_happened_has_no_rate() -> None:
    found = ended(sighted({}), SIGHTINGS, [[0, 1], [1, 2]], [True, False])
    said = {row["known"]: row for row in rows(found)}
    none = {"right": None, "turned": None, "beyond": None}
    assert said[NEAR] == {"known": NEAR, "dones": 0, "of_wrong": None, **none}
    assert said[NEVER] == {"known": NEVER, "dones": 1, "of_wrong": None, **none, "right": 1.0}
    assert "None" not in table(COLUMNS, rows(found))


def test_scenes_that_tell_nothing_of_near_are_refused() -> None:
    scene = replace(HALL, detections=HALL.detections[:, :, :4], fields=HULLS)
    found = Evaluation({}, (), SceneBank([scene]), Episodes(np.zeros(0, int), np.zeros(0, int)),
                       [], [])  # fmt: skip
    with pytest.raises(SceneError, match="of visible, x, y, area, expected such as say what is"):
        rows(found)
