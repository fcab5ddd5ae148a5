"""The row of chance: every action as likely as any other, on the same test episodes."""

from __future__ import annotations

import numpy as np

from cfnav_core.files.provenance import commit
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, Evaluation, run_episodes
from cfnav_core.policy.networks import AgentState, Observation
from cfnav_core.published.start_states import read_episodes
from cfnav_core.task.actions import NUM_ACTIONS
from studies.engine.bench import Bench
from studies.engine.episodes import save
from studies.engine.results import Figures, Results, complete, measured
from studies.engine.row import Row, Split


class Uniform:
    """Networks that remember nothing and prefer nothing."""

    def zero_state(self, n: int) -> AgentState:
        """See ``Networks``."""
        return AgentState({}, np.zeros((n, 0), np.float32), np.zeros((n, NUM_ACTIONS), np.float32))

    def predict(self, observation: Observation, state: AgentState) -> np.ndarray:
        """See ``Networks``: it expects no collision."""
        return np.zeros(len(observation.goal), np.float32)

    def step(
        self, observation: Observation, state: AgentState, collision_probability: np.ndarray
    ) -> np.ndarray:
        """See ``Networks``."""
        return np.full((len(observation.goal), NUM_ACTIONS), 1 / NUM_ACTIONS, np.float32)


def figures_of_chance(split: Split, bench: Bench) -> Figures:
    """The figures of actions that are drawn in a split's test episodes, once for each seed.

    Raises:
        SceneError: the scenes cannot be used.
        WriteError: the results cannot be written.
    """
    test = bench.test(Row("own", "random", "lstde", "plain", split))
    paths = [bench.places.out / f"random_{seed}_{test.file}" for seed in bench.seeds]
    for seed, path in zip(bench.seeds, paths, strict=True):
        if not path.exists():
            assert test.frozen
            starts = read_episodes(test.frozen)[: test.most]
            bank = SceneBank.load(bench.places.scenes, sorted({s.scene for s in starts}))
            episodes = Episodes.thaw(bank, starts)
            results = run_episodes(Uniform(), bank, episodes, seed)
            what = {"commit": commit()}
            save(Evaluation(what, bank.objects, bank, episodes, results, []), path)
    about = {
        "table": "own", "row": "random", "model": "none", "method": "random", "split": split,
        "p_hat": "own", "veto": False, "sample": True, "preset": "", "command": bench.command,
        "config_hash": "",
    }  # fmt: skip
    return complete(about | measured(Results.load(paths)))
