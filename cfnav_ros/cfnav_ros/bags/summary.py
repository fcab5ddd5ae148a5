"""What all drives say together: figures, scores of the bundles, their comparison. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from cfnav_ros.bags.evaluation import BagEvaluation, EvaluatedDrive
from cfnav_ros.bags.judge.figures import Mean, over_drives
from cfnav_ros.bags.judge.outcomes import DriveOutcome
from cfnav_ros.bags.replay.scores import (
    Agreement,
    CollisionScores,
    DecisionComparison,
    agreement,
    collision_scores,
    compare,
    lidar_predictions,
    rgb_predictions,
)
from cfnav_ros.bags.replay.step import ReplayStep, Reproduction, reproduction


@dataclass(frozen=True)
class BundleScores:
    """How good one bundle is.

    Attributes:
        name: under which it was replayed.
        own_name: that it gives itself.
        agreement: with what was driven.
        lidar: how well p_hat from the LiDAR foretold collisions of the driven MoveAheads.
        rgb: the same of its own predictor.
        own: reproduction of the decisions of drives whose driver has its name.
        left_out: decisions that it could not answer.
    """

    name: str
    own_name: str
    agreement: Agreement
    lidar: CollisionScores
    rgb: CollisionScores
    own: Reproduction
    left_out: int


@dataclass(frozen=True)
class Summary:
    """Everything that is known over several drives.

    Attributes:
        figures: of the recorded drives, see ``figures.over_drives``.
        drivers: the same of each bundle that drove, by its name (empty: not told); nothing when
            one drove them all.
        bundles: scores, in the order in which the bundles were given.
        pairs: each later bundle compared with each earlier one that decided on the same pictures,
            by the names of both in their order.
    """

    figures: Mapping[str, Mean]
    drivers: Mapping[str, Mapping[str, Mean]]
    bundles: tuple[BundleScores, ...]
    pairs: Mapping[tuple[str, str], DecisionComparison]


def drives_in(evaluations: Sequence[BagEvaluation]) -> list[tuple[BagEvaluation, EvaluatedDrive]]:
    """All drives with the bag each is from; their places in this list are their numbers."""
    return [(evaluation, drive) for evaluation in evaluations for drive in evaluation.drives]


def summarise(evaluations: Sequence[BagEvaluation]) -> Summary:
    """Work out all that rests on more than one drive.

    Args:
        evaluations: of bags of different names.
    """
    drives = [drive for _, drive in drives_in(evaluations)]
    names = dict.fromkeys(name for e in evaluations for name in e.bundles)
    steps = {name: [s for d in drives for s in d.steps if s.bundle == name] for name in names}
    return Summary(
        figures=over_drives([drive.outcome for drive in drives]),
        drivers=_by_driver([drive.outcome for drive in drives]),
        bundles=tuple(_scores(name, steps[name], evaluations) for name in names),
        pairs={
            (a, b): found
            for a, b in combinations(names, 2)
            if (found := compare(steps[a], steps[b])).steps
        },
    )


def _by_driver(outcomes: Sequence[DriveOutcome]) -> dict[str, dict[str, Mean]]:
    """The figures of each driver, when there are several."""
    drivers = sorted({outcome.bundle for outcome in outcomes})
    if len(drivers) < 2:
        return {}
    return {name: over_drives([o for o in outcomes if o.bundle == name]) for name in drivers}


def _scores(
    name: str, steps: Sequence[ReplayStep], evaluations: Sequence[BagEvaluation]
) -> BundleScores:
    own_name = next((e.bundles[name] for e in evaluations if name in e.bundles), "")
    return BundleScores(
        name=name,
        own_name=own_name,
        agreement=agreement(steps),
        lidar=collision_scores(lidar_predictions(steps)),
        rgb=collision_scores(rgb_predictions(steps)),
        own=reproduction(step for step in steps if step.driver and step.driver == own_name),
        left_out=sum(
            out.bundle in ("", name) for e in evaluations if name in e.bundles for out in e.left_out
        ),
    )
