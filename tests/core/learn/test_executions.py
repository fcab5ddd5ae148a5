"""Synchronous and asynchronous execution of Algorithm 1 learn the same on a small task.

Margin, seeds, figures and rule below were fixed before the first of these runs; the two learning
rates, the batch and the clipping were chosen on seeds 100 to 102 and on other halls.
"""

import numpy as np
import pytest
from scipy.stats import t as student

from cfnav_core.agent.config import Hyperparameters, RunConfig, TrainOptions
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, run_episodes
from cfnav_core.learn.run import Run
from cfnav_core.learn.train import train
from cfnav_core.models.size import ModelSize
from cfnav_core.policy.networks import TorchNetworks
from cfnav_core.task.metrics import cf_sr, sr
from tests.core.worlds import seen_hall

MARGIN = 0.05
SEEDS = range(5)
TRAIN, VALIDATION, TEST = ("kitchen:0-15",), ("kitchen:16-23",), ("kitchen:24-31",)
COMMON = {
    "stage1_episodes": 2000, "stage2_episodes": 6000, "rollout_length": 10, "entropy_weight": 0.03,
}  # fmt: skip
EXECUTIONS = {
    "synchronous": (0, Hyperparameters(**COMMON, batch=8, lr=7e-3)),
    "asynchronous": (8, Hyperparameters(**COMMON, lr=1e-3, max_grad_norm=100.0)),
}


def figures(run: Run, feeds: bool) -> tuple[float, float]:
    """SR and CF-SR of the last weights in halls never trained in, actions drawn from pi."""
    bank = SceneBank.load(run.options.scenes, TEST)
    networks = TorchNetworks(run.model, run.predictor, feeds)
    results = run_episodes(networks, bank, Episodes.draw(bank, 1000, seed=7), sample_seed=0)
    return sr(results), cf_sr(results)


def difference(a: np.ndarray, b: np.ndarray, level: float) -> tuple[float, float, float]:
    """Mean of ``a`` minus mean of ``b`` and its interval, after Welch."""
    parts = [x.var(ddof=1) / len(x) for x in (a, b)]
    error = np.sqrt(sum(parts))
    freedom = sum(parts) ** 2 / sum(v**2 / (len(x) - 1) for v, x in zip(parts, (a, b), strict=True))
    half = student.ppf((1 + level) / 2, freedom) * error
    mean = a.mean() - b.mean()
    return mean, mean - half, mean + half


def test_interval_of_a_difference_by_hand():
    # variances 1 and 4, three each: error sqrt(5 / 3), freedom 2.94
    mean, low, high = difference(np.array([1.0, 2, 3]), np.array([0.0, 2, 4]), 0.95)
    assert mean == 0
    assert high == -low == pytest.approx(1.2910 * student.ppf(0.975, 2.9412), abs=1e-3)


@pytest.mark.long
def test_synchronous_and_asynchronous_execution_agree(tmp_path):
    """Equivalence of mean SR and of mean CF-SR within ``MARGIN``: two one-sided tests at 5 %.

    They hold when the 90 % interval of the difference lies inside the margin.
    """
    for seed in range(32):
        scene = seen_hall(seed, f"kitchen:{seed}")
        scene.save(tmp_path / "scenes" / f"kitchen_{seed:05d}")
    found = {}
    for name, (workers, hyperparameters) in EXECUTIONS.items():
        rows = []
        for seed in SEEDS:
            config = RunConfig(
                seed=seed, hyperparameters=hyperparameters, size=ModelSize(32), predictor_hidden=16
            )
            options = TrainOptions(
                tmp_path / "scenes", TRAIN, VALIDATION, tmp_path / f"{name}{seed}", run=config,
                workers=workers, validation_every=2000, validation_episodes=100,
            )  # fmt: skip
            untrained = figures(Run(options), feeds=True)
            assert max(untrained) < 0.2
            train(options)
            trained = Run(options)
            trained.resume()
            rows.append(figures(trained, feeds=True))
            print(name, seed, "untrained", untrained, "trained", rows[-1], flush=True)
        found[name] = np.array(rows)
    outside = []
    for k, figure in enumerate(("SR", "CF-SR")):
        a, b = found["synchronous"][:, k], found["asynchronous"][:, k]
        mean, low, high = difference(a, b, 0.95)
        _, inner, outer = difference(a, b, 0.90)
        text = (
            f"{figure}: synchronous {a.mean():.3f} ({a.std(ddof=1):.3f}), asynchronous "
            f"{b.mean():.3f} ({b.std(ddof=1):.3f}), difference {mean:+.3f}, "
            f"95 % [{low:+.3f}, {high:+.3f}], 90 % [{inner:+.3f}, {outer:+.3f}]"
        )
        print(text, flush=True)
        if min(a.mean(), b.mean()) < 0.8 or not -MARGIN < inner <= outer < MARGIN:
            outside.append(text)
    assert not outside
