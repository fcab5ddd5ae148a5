"""One decision of a replayed bundle beside what was driven; whether it collided, and reproduced it.

Pure.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cfnav_core.task.actions import Action

PROBABILITY_TOLERANCE, P_HAT_TOLERANCE = 1e-3, 1e-5
"""Decisions that differ by no more are the same. On one machine they are equal to the last bit; on
another the last digit of a float16 feature or of a float32 range may differ."""


@dataclass(frozen=True, kw_only=True)
class ReplayStep:
    """What a bundle answers to one picture of a recorded drive.

    Attributes:
        bag: name of the bag.
        bundle: name under which the bundle is replayed.
        driver: name of the bundle that drove, empty when somebody else did.
        drive_ns: when the drive began, in the bag's one time (``clocks``); with ``bag`` the name of
            the drive.
        goal: object that is sought.
        step: 1-based within the drive.
        t_ns: when it was decided, in the same time.
        until_ns: when the next one was, or when the drive ended, in the same time.
        image_ns: stamp of the picture.
        estimate_ns: stamp of the scan its p_hat came from; 0: the bundle's own predictor.
        driven: the action of who drove.
        driven_vetoed: it was decided but not executed.
        driven_probabilities: float32 [6] of the driver, None when it published none.
        driven_p_hat: p_hat as the driver had it, None when it published none.
        action: the bundle's own action.
        probabilities: float32 [6].
        p_hat: collision probability as given to the bundle.
        p_hat_lidar: what the LiDAR says, whatever of it was given; nan of no estimate.
        p_hat_rgb: what the bundle's own RGB predictor says; nan of one that sees no pictures.
        detection_score: 0..1.
        would_veto: the LiDAR's veto would have fallen on the bundle's action.
        intact: the bundle has seen every picture since the start of the drive, so that its
            recurrent state is that of who drove with it.
        collided: a contact happened before the next decision; None when no MoveAhead was
            executed, or nobody looked for contacts.
    """

    bag: str
    bundle: str
    driver: str
    drive_ns: int
    goal: str
    step: int
    t_ns: int
    until_ns: int
    image_ns: int
    estimate_ns: int
    driven: Action
    driven_vetoed: bool
    driven_probabilities: np.ndarray | None = field(repr=False)
    driven_p_hat: float | None
    action: Action
    probabilities: np.ndarray = field(repr=False)
    p_hat: float
    p_hat_lidar: float
    p_hat_rgb: float
    detection_score: float
    would_veto: bool
    intact: bool
    collided: bool | None = None

    @property
    def agrees(self) -> bool:
        """Whether the bundle would have done what was driven."""
        return self.action is self.driven

    @property
    def p_driven(self) -> float:
        """Probability that the bundle gives to the driven action."""
        return float(self.probabilities[self.driven])


@dataclass(frozen=True)
class LeftOut:
    """A decision that could not be replayed; ``reason`` is one sentence.

    ``bundle`` is empty when it concerns all of them.
    """

    bundle: str
    drive_ns: int
    step: int
    t_ns: int
    reason: str


@dataclass(frozen=True)
class Reproduction:
    """How well a bundle reproduced decisions.

    Attributes:
        decisions: those compared, whose recurrent state is the driver's.
        equal: those that are the same in action, probabilities and p_hat, within the tolerances.
        probability_difference: the greatest, None without a decision.
        p_hat_difference: the greatest, None without a decision.
        not_compared: replayed with a recurrent state that is not the driver's.
    """

    decisions: int
    equal: int
    probability_difference: float | None
    p_hat_difference: float | None
    not_compared: int


def reproduction(steps: Iterable[ReplayStep]) -> Reproduction:
    """Compare a bundle's answers with the decisions of the drive.

    Args:
        steps: of one bundle, in drives that it drove itself; those of a driver that published no
            probabilities do not count.
    """
    count = equal = other = 0
    worst = np.zeros(2)
    for step in steps:
        if step.driven_probabilities is None or step.driven_p_hat is None:
            continue
        if not step.intact:
            other += 1
            continue
        far = np.abs(step.probabilities - step.driven_probabilities).max()
        apart = np.array([far, abs(step.p_hat - step.driven_p_hat)], np.float64)
        apart = np.where(np.isnan(apart), np.inf, apart)  # damaged numbers equal nothing
        worst = np.maximum(worst, apart)
        near = bool((apart <= (PROBABILITY_TOLERANCE, P_HAT_TOLERANCE)).all())
        count, equal = count + 1, equal + (step.agrees and near)
    if not count:
        return Reproduction(0, 0, None, None, other)
    return Reproduction(count, equal, float(worst[0]), float(worst[1]), other)


def labelled(steps: Sequence[ReplayStep], contacts_ns: Sequence[int]) -> list[ReplayStep]:
    """Say of each MoveAhead that was executed whether it collided.

    Contacts are onsets: one that began before the decision and lasts is no collision of this one.

    Args:
        steps: of one bag.
        contacts_ns: times of the contacts in that bag, nanoseconds, in any order.
    """
    contacts = sorted(contacts_ns)
    found = []
    for step in steps:
        collided = None
        if step.driven is Action.MoveAhead and not step.driven_vetoed:
            collided = bisect_right(contacts, step.t_ns) < bisect_right(contacts, step.until_ns)
        found.append(replace(step, collided=collided))
    return found
