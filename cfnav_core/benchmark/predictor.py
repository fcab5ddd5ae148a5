"""How good the collision probabilities are: the RGB predictor's, and the LiDAR's in its place.

Both are judged on the same steps: those of the test episodes that ours drove with its own
prediction. What is to be told is whether MoveAhead would collide there, whatever was done.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfnav_core import calibration as rel
from cfnav_core.benchmark.tested import Tested


@dataclass(frozen=True)
class Quality:
    """Of one source of probabilities, means over seeds.

    Attributes:
        source: "RGB predictor", "LiDAR", or "the larger" of both.
        model, split: whose episodes.
        steps: judged, of all seeds. blocked: share of them at which MoveAhead would collide.
        auc: area under the ROC curve.
        ece: expected calibration error, 10 bins of equal width.
        skill: Brier skill against the constant share of blocked steps.
    """

    source: str
    model: str
    split: str
    steps: int
    blocked: float
    auc: float
    ece: float
    skill: float


def qualities(
    model: str, split: str, tested: Sequence[Tested], lidar: np.ndarray | None
) -> list[Quality]:
    """Judge the predictor of ours, and the LiDAR where its probabilities are known.

    Args:
        model, split: of the runs.
        tested: by seed, with their own prediction.
        lidar: float32 [S], by state of the test scenes.
    """
    sources = {"RGB predictor": [t.p_hat.astype(float) for t in tested]}
    if lidar is not None:
        given = [lidar[t.states].astype(float) for t in tested]
        own = sources["RGB predictor"]
        sources["LiDAR"] = given
        sources["the larger"] = [np.maximum(*two) for two in zip(given, own, strict=True)]
    found = []
    for source, by_seed in sources.items():
        figures = np.mean(
            [_figures(p, t.blocked) for p, t in zip(by_seed, tested, strict=True)], axis=0
        )
        blocked = float(np.mean([t.blocked.mean() for t in tested]))
        steps = sum(len(t.blocked) for t in tested)
        found.append(Quality(source, model, split, steps, blocked, *map(float, figures)))
    return found


def _figures(p: np.ndarray, blocked: np.ndarray) -> tuple[float, float, float]:
    ones, base = np.ones(len(p)), blocked.mean()
    skill = 1 - rel.brier(p, blocked, ones) / (base * (1 - base))
    return rel.auc(p, blocked, ones), rel.calibration_error(p, blocked, within=rel.EVERY), skill


def as_markdown(found: Sequence[Quality]) -> str:
    """A table for people."""
    lines = [
        "| data | model | source | AUC | calibration error | Brier skill | blocked | steps |",
        "|" + "---|" * 8,
    ]
    lines += [
        f"| {q.split} | {q.model} | {q.source} | {q.auc:.3f} | {q.ece:.3f} | {q.skill:.3f} "
        f"| {100 * q.blocked:.1f} % | {q.steps:,} |"
        for q in found
    ]
    return "\n".join(lines) + "\n"
