"""What a policy knew when it said Done."""

from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, Evaluation, Trace
from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.actions import Action
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.metrics import EpisodeResult
from studies.eyes.wrong_dones import BEFORE, FAR, NEAR, NEVER, rows
from tests.core.worlds import hall


def ended(sighted: dict[int, float], walks: list[list[int]], right: list[bool]) -> Evaluation:
    """Episodes through such states of a hall, which end with Done but for the last one.

    Args:
        sighted: distance at which the goal is sighted, by state.
        walks: the states of each episode, as many in all.
        right: whether it succeeded.
    """
    scene = hall()
    row = scene.objects.index(scene.goals[0])
    detections = np.zeros((scene.num_states, len(scene.objects), len(SIGHTINGS)), np.float16)
    for state, far in sighted.items():
        at = SIGHTINGS.index("confidence"), SIGHTINGS.index("distance")
        detections[state, row, at] = 0.4, far
    bank = SceneBank([replace(scene, detections=detections, fields=SIGHTINGS)])
    these, states = np.arange(len(walks)), np.array(walks)
    trace = []
    for step, at in enumerate(states.T):
        last = step == states.shape[1] - 1
        actions = np.full(len(walks), Action.Done if last else Action.RotateLeft)
        actions[-1] = Action.RotateLeft
        trace.append(Trace(these, at, actions, np.zeros(len(walks), np.float32)))
    results = [EpisodeResult(ok, 0, 3, 3) for ok in right]
    episodes = Episodes(states[:, 0], np.full(len(walks), row))
    return Evaluation({}, scene.goals[:1], bank, episodes, results, trace)


def test_dones_are_told_apart_by_what_was_seen_of_the_goal() -> None:
    near, far, unknown = 3, 4, 5
    found = ended(
        {near: 1.2, far: 2.0, unknown: 0.0},
        [[0, 1], [near, 1], [far, near], [0, near], [0, far], [near, unknown], [0, 1]],
        [False, False, True, False, True, False, False],
    )
    said = {row["known"]: (row["dones"], row["right"], row["of_wrong"]) for row in rows(found)}
    assert said == {
        NEVER: (1, 0.0, 0.25),
        BEFORE: (1, 0.0, 0.25),
        NEAR: (2, 0.5, 0.25),
        FAR: (2, 0.5, 0.25),
    }


def test_what_never_happened_has_no_rate() -> None:
    said = {row["known"]: row for row in rows(ended({}, [[0, 1], [1, 2]], [True, False]))}
    assert said[NEAR]["dones"] == 0
    assert said[NEAR]["right"] is None
    assert said[NEVER] == {"known": NEVER, "dones": 1, "right": 1.0, "of_wrong": 0.0}


def test_scenes_without_sightings_are_refused() -> None:
    found = Evaluation({}, (), SceneBank([hall()]), Episodes(np.zeros(0, int), np.zeros(0, int)),
                       [], [])  # fmt: skip
    with pytest.raises(SceneError, match="without sightings, expected them; make it with"):
        rows(found)
