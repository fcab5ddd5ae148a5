"""What a detector leaves of the goals to find."""

from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.task.detections import SIGHTINGS
from studies.eyes.sighted import Sighted, sightings_of_goals, table
from tests.core.worlds import hall


def seen(visible: list[int], sighted: list[int]) -> OfflineScene:
    """A hall whose first goal is visible and sighted in such states alone."""
    scene = hall()
    row = scene.objects.index(scene.goals[0])
    shown = np.zeros_like(scene.visible)
    shown[visible, row] = True
    detections = np.zeros((scene.num_states, len(scene.objects), len(SIGHTINGS)), np.float16)
    detections[sighted, row, 0] = 0.4
    return replace(
        scene, goals=scene.goals[:1], visible=shown, detections=detections, fields=SIGHTINGS
    )


def test_states_are_counted_over_rooms() -> None:
    scenes = [seen([0, 1, 2, 3], [3, 4]), seen([5], [5, 6])]
    (found,) = sightings_of_goals(scenes).values()
    assert found == Sighted(rooms=2, visible=5, sighted=4, both=2)
    assert table({"Mug": found}).splitlines()[-1] == "| Mug | 2 | 0.40 | 0.50 |"


def test_a_goal_that_is_never_sighted() -> None:
    assert table(sightings_of_goals([seen([1], [])])).endswith("| 1 | 0.00 | never sighted |")


def test_scenes_without_sightings_are_refused() -> None:
    with pytest.raises(SceneError, match="expected sightings; make them with cfnav rooms boxes"):
        sightings_of_goals([hall()])
