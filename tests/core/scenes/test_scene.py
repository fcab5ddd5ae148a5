import json
from collections import deque

import numpy as np
import pytest

from cfnav_core.scenes.scene import (
    ARRAYS,
    HEADINGS,
    HORIZONS,
    OfflineScene,
    SceneError,
    changed_files,
)
from cfnav_core.task.actions import Action
from cfnav_core.task.vocabulary import CATEGORY_ID
from tests.core.worlds import hall


def searched(scene: OfflineScene, goal: int) -> np.ndarray:
    """Fewest actions by a plain breadth-first search from every state."""
    out = np.full(scene.num_states, -1)
    for start in range(scene.num_states):
        seen, queue = {start}, deque([(start, 0)])
        while queue:
            state, depth = queue.popleft()
            if scene.visible[state, goal]:
                out[start] = depth
                break
            for nxt in scene.next_state[state, : Action.Done]:
                if nxt not in seen:
                    seen.add(int(nxt))
                    queue.append((int(nxt), depth + 1))
    return out


def test_shortest_actions_equal_a_plain_search():
    scene = hall(4, 3, pillars=((1, 1),), goals={"Laptop": (3, 2)})
    goal = CATEGORY_ID["Laptop"]
    np.testing.assert_array_equal(scene.actions_to(goal), searched(scene, goal))


def test_shortest_metres_around_a_wall():
    # a wall with one gap: from (0, 0) to the goal at (2, 0) the way leads over (1, 3)
    scene = hall(3, 4, pillars=((1, 0), (1, 1), (1, 2)), goals={"Laptop": (2, 0)})
    metres = scene.metres_to(CATEGORY_ID["Laptop"])
    start = int(np.nonzero((scene.positions == (0, 0)).all(1))[0][0])
    # three steps up, two across through the gap, one down: the goal is seen from (2, 1)
    assert metres[start] == pytest.approx(0.25 * (3 + 2 + 2))


def test_goal_nobody_sees_is_unreachable():
    scene = hall()
    goal = CATEGORY_ID["Fridge"]
    assert (scene.actions_to(goal) == -1).all()
    assert np.isinf(scene.metres_to(goal)).all()


def test_saved_scene_comes_back(tmp_path):
    scene = hall()
    scene.save(tmp_path / "kitchen_00000")
    again = OfflineScene.load(tmp_path / "kitchen_00000")
    for key in ("features", "detections", "next_state", "collided", "visible", "positions"):
        np.testing.assert_array_equal(getattr(again, key), getattr(scene, key))
    assert (again.name, again.room_type) == ("kitchen:0", "kitchen")
    assert [p.name for p in tmp_path.iterdir()] == ["kitchen_00000"]


def test_a_changed_file_no_longer_has_its_sum(tmp_path):
    folder = tmp_path / "s"
    hall().save(folder)
    sums = json.loads((folder / "scene.json").read_text())["sha256"]
    assert sums.keys() == set(ARRAYS)
    assert changed_files(folder, sums) == []
    data = (folder / "heading.npy").read_bytes()
    (folder / "heading.npy").write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert changed_files(folder, sums) == ["heading"]


DAMAGES = ["missing", "empty", "truncated", "head", "other_states", "wild_edge"]


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_scene_says_so(tmp_path, damage):
    folder = tmp_path / "s"
    hall().save(folder)
    edges = np.load(folder / "next_state.npy")
    if damage == "missing":
        (folder / "features.npy").unlink()
    elif damage == "empty":
        (folder / "features.npy").write_bytes(b"")
    elif damage == "truncated":
        (folder / "features.npy").write_bytes((folder / "features.npy").read_bytes()[:-9])
    elif damage == "head":
        (folder / "scene.json").write_text('{"schema": 2, "name": "kitchen:0"}')
    elif damage == "other_states":
        np.save(folder / "collided.npy", np.zeros(7, bool))
    else:
        edges[3, 0] = len(edges)
        np.save(folder / "next_state.npy", edges)
    with pytest.raises(SceneError, match="found"):
        OfflineScene.load(folder)


def test_turns_come_full_circle_and_looks_stay():
    scene = hall()
    s = np.arange(scene.num_states)
    for action in (Action.RotateLeft, Action.RotateRight):
        t = s
        for _ in range(HEADINGS):
            t = scene.next_state[t, action]
        np.testing.assert_array_equal(t, s)
    level = s[s % HORIZONS == 0]
    np.testing.assert_array_equal(scene.next_state[level, Action.LookUp], level)
