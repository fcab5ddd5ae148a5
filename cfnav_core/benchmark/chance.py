"""The row of chance: every action as likely as any other, on the same test episodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cfnav_core.actions import NUM_ACTIONS
from cfnav_core.benchmark.tested import FrozenTest, Tested, save
from cfnav_core.env import SceneBank
from cfnav_core.evaluate import Episodes, Evaluation, run_episodes
from cfnav_core.networks import AgentState, Sight
from cfnav_core.published.start_states import read_episodes
from cfnav_core.source import commit


class Uniform:
    """Networks that remember nothing and prefer nothing."""

    def zero_state(self, n: int) -> AgentState:
        """See ``Networks``."""
        return AgentState({}, np.zeros((n, 0), np.float32), np.zeros((n, NUM_ACTIONS), np.float32))

    def predict(self, sight: Sight, state: AgentState) -> np.ndarray:
        """See ``Networks``: it expects no collision."""
        return np.zeros(len(sight.goal), np.float32)

    def step(
        self, sight: Sight, state: AgentState, collision_probability: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """See ``Networks``."""
        n = len(sight.goal)
        return np.full((n, NUM_ACTIONS), 1 / NUM_ACTIONS, np.float32), self.predict(sight, state)


def chance(test: FrozenTest, scenes: Path, seed: int, path: Path) -> Tested:
    """Draw actions in the test episodes, once for each seed.

    Args:
        test: which episodes.
        scenes: folder of the scenes.
        seed: draws the actions.
        path: file that keeps the results.

    Raises:
        SceneError: the scenes cannot be used.
        WriteError: the results cannot be written.
    """
    if not path.exists():
        starts = read_episodes(test.frozen)[: test.most]
        bank = SceneBank.load(scenes, sorted({s.scene for s in starts}))
        episodes = Episodes.thaw(bank, starts)
        results = run_episodes(Uniform(), bank, episodes, seed)
        save(Evaluation({"commit": commit()}, bank, episodes, results, []), path)
    return Tested.load(path)
