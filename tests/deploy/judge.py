"""What a robot made of a fault, from where it truly was. Pure: knows no ROS and no clock."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tests.deploy.expectations import (
    NAMES_CAUSE,
    Expectation,
    Phase,
    Reaction,
)

STEP_M, SHORT_M, OFF_M = 0.25, 0.03, 0.08
TURN_RAD, SHORT_RAD, OFF_RAD = math.pi / 4, math.radians(6.0), math.radians(15.0)
"""A motion that ends no further before its target, and off it in other ways, has finished: late
commands carry it beyond, but what is given up falls short."""

TWITCH_M, TWITCH_RAD = 0.003, math.radians(0.5)
"""Less than this is no motion: the base may still settle."""

DRIVING_V = 0.02
"""m/s: faster than this is driving, slower may be the slip of a turn."""

RODE_MOTIONS = 2
"""Motions that finish after the fault has begun, the first of them under way, for a ride."""


@dataclass(frozen=True)
class Truth:
    """One sample of the simulator's truth: seconds of simulated time, metres, radians."""

    t: float
    x: float
    y: float
    yaw: float
    v: float
    w: float
    still_since: float
    """0 while it moves."""
    collisions: int


@dataclass(frozen=True)
class MotionSeen:
    """A stretch between two rests; ``end`` is infinite while it lasts.

    ``ahead`` and ``aside`` are metres along and across the heading at its begin.
    """

    begin: float
    end: float
    ahead: float
    aside: float
    turn: float

    @property
    def complete(self) -> bool:
        """Whether it is a whole MoveAhead or a whole turn."""
        straight = abs(self.aside) < OFF_M and abs(self.turn) < OFF_RAD
        step = straight and -SHORT_M < self.ahead - STEP_M < OFF_M
        in_place = max(abs(self.ahead), abs(self.aside)) < OFF_M
        turn = in_place and -SHORT_RAD < abs(self.turn) - TURN_RAD < OFF_RAD
        return step or turn


@dataclass(frozen=True)
class Run:
    """What was seen of one run: the samples from before the fault on, and how the goal ended.

    Attributes:
        truth: samples, oldest first.
        fault_s: simulated time at which the fault began.
        mended_s: simulated time at which it was mended by itself; infinite when it was not.
        outcome: of the goal; empty while it lasts.
        message: the sentence with it.
        vetoes: MoveAheads that were decided and forbidden after the fault began.
    """

    truth: Sequence[Truth]
    fault_s: float
    mended_s: float
    outcome: str
    message: str
    vetoes: int


@dataclass(frozen=True)
class Judgement:
    """``stop_s``: from the fault to the last motion, or to the last drive where turning is free."""

    reaction: Reaction
    stop_s: float
    contacts: int
    as_expected: bool


def rests(truth: Sequence[Truth]) -> list[Truth]:
    """The newest sample of each rest; twitches of a base that settles are part of it."""
    found = [truth[0]]
    for now in truth[1:]:
        if now.still_since and not _moved(found[-1], now):
            found[-1] = replace(now, still_since=found[-1].still_since)
        elif now.still_since:
            found.append(now)
    return found


def motions(truth: Sequence[Truth]) -> list[MotionSeen]:
    """Split samples into motions between rests; the first sample counts as a rest."""
    stops = rests(truth)
    found = [_motion(a, b, b.still_since) for a, b in itertools.pairwise(stops)]
    if not truth[-1].still_since and _moved(stops[-1], truth[-1]):
        found.append(_motion(stops[-1], truth[-1], math.inf))
    return found


def _moved(rest: Truth, now: Truth) -> bool:
    distance = math.hypot(now.x - rest.x, now.y - rest.y)
    return distance > TWITCH_M or abs(math.remainder(now.yaw - rest.yaw, math.tau)) > TWITCH_RAD


def _motion(rest: Truth, now: Truth, end: float) -> MotionSeen:
    dx, dy = now.x - rest.x, now.y - rest.y
    c, s = math.cos(rest.yaw), math.sin(rest.yaw)
    turn = math.remainder(now.yaw - rest.yaw, math.tau)
    return MotionSeen(rest.t, end, c * dx + s * dy, c * dy - s * dx, turn)


def rode(run: Run) -> bool:
    """Whether motions have finished as if nothing were wrong."""
    seen = [m for m in motions(run.truth) if m.end > run.fault_s]
    finished = [m for m in seen if m.end < math.inf]
    whole = all(m.complete for m in finished)
    return whole and len(finished) >= RODE_MOTIONS and not run.vetoes


def judge(run: Run, expected: Expectation) -> Judgement:
    """Name the reaction, measure it, and compare it with what was expected."""
    bound = expected.bound_s
    until = _free_again(run, expected)
    truth = [sample for sample in run.truth if sample.t <= until]
    seen = [m for m in motions(truth) if m.end > run.fault_s]
    last = truth[-1].t
    moved_s = max((min(m.end, last) - run.fault_s for m in seen), default=0.0)
    drove_s = max((s.t - run.fault_s for s in truth if abs(s.v) > DRIVING_V), default=0.0)
    begun_late = [m for m in seen if m.begin > run.fault_s + (bound or 0.0)]
    at_rest = not seen or seen[-1].end < math.inf
    if run.outcome == "refused" and not seen:
        reaction = Reaction.REFUSE
    elif rode(run):
        reaction = Reaction.RIDE_THROUGH
    elif begun_late or not at_rest:
        reaction = Reaction.DEGRADE
    else:
        turned = expected.phase is Phase.TURNING and bound is not None and moved_s > bound
        reaction = Reaction.DEGRADE if turned and drove_s <= bound else Reaction.STOP
    turning_is_free = expected.reaction is Reaction.DEGRADE and bound is not None
    stop_s = max(drove_s if turning_is_free else moved_s, 0.0)
    contacts = truth[-1].collisions - truth[0].collisions
    in_time = bound is None or stop_s <= bound
    named = not _complained(run) or bool(re.search(_cause(expected.fault), run.message))
    as_expected = expected.met_by(reaction) and in_time and named and not contacts
    return Judgement(reaction, round(stop_s, 3), contacts, as_expected)


def _free_again(run: Run, expected: Expectation) -> float:
    """When a robot that had to stop may move again; what is over at once has left its mark."""
    bound = expected.bound_s or 0.0
    mended = expected.reaction is Reaction.STOP and run.mended_s > run.fault_s + bound
    return run.mended_s if mended else math.inf


def _complained(run: Run) -> bool:
    return run.outcome in ("aborted", "refused")


def _cause(fault: str) -> str:
    return next(words for begin, words in NAMES_CAUSE.items() if fault.startswith(begin))
