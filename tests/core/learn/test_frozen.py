"""Episodes frozen in a file are the same episodes when they are read back."""

from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes
from cfnav_core.published.keys import Key, state_of
from cfnav_core.published.start_states import read_episodes, write_episodes
from cfnav_core.scenes.scene import SceneError
from tests.core.worlds import hall


@pytest.fixture(scope="module")
def bank():
    return SceneBank([hall(4, 3, name="kitchen:0"), hall(5, 4, seed=1, name="bathroom:3")])


def test_every_state_has_one_key(bank):
    scene = bank.scenes[1]
    keys = [str(Key.of(scene, s)) for s in range(scene.num_states)]
    assert len(set(keys)) == scene.num_states
    assert [state_of(scene, key) for key in keys] == list(range(scene.num_states))
    # heading 0 looks along +x, which published keys call 90 degrees
    assert Key.of(scene, 0).rotation == 90


def test_frozen_episodes_come_back(bank, tmp_path):
    drawn = Episodes.draw(bank, 300, seed=4)
    write_episodes(tmp_path / "test.json", drawn.freeze(bank), ())
    again = Episodes.thaw(bank, read_episodes(tmp_path / "test.json"))
    np.testing.assert_array_equal(again.states, drawn.states)
    np.testing.assert_array_equal(again.goals, drawn.goals)
    # the order of the scenes at hand does not matter
    other = SceneBank(bank.scenes[::-1])
    turned = Episodes.thaw(other, read_episodes(tmp_path / "test.json"))
    assert turned.freeze(other) == drawn.freeze(bank)
    assert turned.identity(other) == drawn.identity(bank)


def test_what_is_not_there_is_named(bank):
    start = Episodes.draw(bank, 1, seed=0).freeze(bank)[0]
    with pytest.raises(SceneError, match="an episode in kitchen:9"):
        Episodes.thaw(bank, [replace(start, scene="kitchen:9")])
    with pytest.raises(SceneError, match="goal 'Unicorn'"):
        Episodes.thaw(bank, [replace(start, goal="Unicorn")])
    with pytest.raises(SceneError, match=r"no state 99\.00"):
        Episodes.thaw(bank, [replace(start, state="99.00|0.00|0|0")])


def test_episodes_that_nobody_can_end_are_named(bank):
    starts = Episodes.draw(bank, 3, seed=0).freeze(bank)
    hopeless = [*starts, replace(starts[0], goal="Fridge")]
    with pytest.raises(SceneError, match=r"1 of 4 episodes that nobody can end, such as Fridge in"):
        Episodes.thaw(bank, hopeless)
