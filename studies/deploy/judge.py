"""What a robot made of a fault, from where it truly was. Pure: knows no ROS and no clock."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from cfnav_core.task.actions import STEP_M, TURN_RAD
from studies.deploy.expectations import NAMES_CAUSE
from studies.deploy.reactions import Bounded, Expectation, Reaction

JUDGE = 2
"""Counts the ways of judging; runs that were judged another way are made again."""

CHANGED = (
    "ef7125c: a fault that is over at once is judged by the mark it leaves",
    "5eeaf07: a motion is whole when it is less exact, not when it went elsewhere",
    "46d5399: it is cut short from 3 cm or 6 degrees before its target on, as late commands carry "
    "it beyond and what is given up falls short",
    "2e4a58a: a stop needs the episode's end and a sentence that names the cause; a ride after the "
    "fault was mended is none through it; a motion that finished is no measured stop",
    "c1cfb71: where only drives are bounded, the end of a turn is no measured stop",
)
"""What was changed in judging after measurements had begun: commits and reasons."""

SHORT_M, OFF_M = 0.03, 0.08
SHORT_RAD, OFF_RAD = math.radians(6.0), math.radians(15.0)
"""A motion that ends no further before its target, and off it in other ways, has finished: late
commands carry it beyond, but what is given up falls short."""

TWITCH_M, TWITCH_RAD = 0.003, math.radians(0.5)
"""Less than this is no motion: the base may still settle."""

DRIVING_V = 0.02
"""m/s: faster than this is driving, slower may be the slip of a turn."""

ENDED = ("aborted", "refused", "canceled", "preempted")
"""Outcomes of a goal that somebody or something has ended; the bundle never says Done."""

RODE_MOTIONS = 2
"""Motions that finish after the fault has begun, the first of them under way, for a ride."""


@dataclass(frozen=True)
class TruthSample:
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
class ObservedRun:
    """What was seen of one run: the samples from before the fault on, and how the goal ended.

    Attributes:
        truth: samples, oldest first.
        fault_s: simulated time at which the fault began.
        mended_s: simulated time at which it was mended by itself; infinite when it was not. Who
            had to stop may move again then, if the bound was over before.
        outcome: of the goal; empty while it lasts.
        message: the sentence with it.
        vetoes: MoveAheads that were decided and forbidden after the fault began.
        ended_s: simulated time at which the goal ended; infinite while it lasts.
    """

    truth: Sequence[TruthSample]
    fault_s: float
    mended_s: float
    outcome: str
    message: str
    vetoes: int
    ended_s: float = math.inf


class LastMotion(Enum):
    """What became of the last motion that the fault met, or that began after it."""

    NONE = "none"
    CUT_SHORT = "cut short"
    FINISHED = "finished"
    LASTS = "lasts"


@dataclass(frozen=True)
class Judgement:
    """What a run came to.

    Attributes:
        reaction: what the deployment did.
        stop_s: seconds from the fault to the end of what was bounded, or of the last motion; None
            where nothing was stopped (the last motion finished, or none was under way) or bounded,
            and where only drives are and none was.
        last_motion: what became of it.
        contacts: with anything, after the fault.
        as_expected: whether reaction, time, outcome and sentence are those of the expectation.
    """

    reaction: Reaction
    stop_s: float | None
    last_motion: LastMotion
    contacts: int
    as_expected: bool


def rests(truth: Sequence[TruthSample]) -> list[TruthSample]:
    """The newest sample of each rest; twitches of a base that settles are part of it."""
    found = [truth[0]]
    for now in truth[1:]:
        if now.still_since and not _moved(found[-1], now):
            found[-1] = replace(now, still_since=found[-1].still_since)
        elif now.still_since:
            found.append(now)
    return found


def motions(truth: Sequence[TruthSample]) -> list[MotionSeen]:
    """Split samples into motions between rests; the first sample counts as a rest."""
    stops = rests(truth)
    found = [_motion(a, b, b.still_since) for a, b in itertools.pairwise(stops)]
    if not truth[-1].still_since and _moved(stops[-1], truth[-1]):
        found.append(_motion(stops[-1], truth[-1], math.inf))
    return found


def _moved(rest: TruthSample, now: TruthSample) -> bool:
    distance = math.hypot(now.x - rest.x, now.y - rest.y)
    return distance > TWITCH_M or abs(math.remainder(now.yaw - rest.yaw, math.tau)) > TWITCH_RAD


def _motion(rest: TruthSample, now: TruthSample, end: float) -> MotionSeen:
    dx, dy = now.x - rest.x, now.y - rest.y
    c, s = math.cos(rest.yaw), math.sin(rest.yaw)
    turn = math.remainder(now.yaw - rest.yaw, math.tau)
    return MotionSeen(rest.t, end, c * dx + s * dy, c * dy - s * dx, turn)


def rode(run: ObservedRun) -> bool:
    """Whether motions have finished as if nothing were wrong."""
    seen = [m for m in motions(run.truth) if m.end > run.fault_s]
    finished = [m for m in seen if m.end < math.inf]
    whole = all(m.complete for m in finished)
    return whole and len(finished) >= RODE_MOTIONS and not run.vetoes


def judge(run: ObservedRun, expected: Expectation) -> Judgement:
    """Name the reaction, measure it, and compare it with what was expected."""
    bound = expected.bound_s
    until = _free_again(run, expected)
    truth = [sample for sample in run.truth if sample.t <= until]
    seen = [m for m in motions(truth) if m.end > run.fault_s]
    last = truth[-1].t
    times = {
        Bounded.MOTIONS: max((min(m.end, last) - run.fault_s for m in seen), default=0.0),
        Bounded.DRIVES: max((s.t - run.fault_s for s in truth if abs(s.v) > DRIVING_V), default=0),
        Bounded.UNDER_WAY: min(seen[0].end, last) - run.fault_s if seen else 0.0,
    }
    reaction = _reaction(replace(run, truth=truth), expected, seen, times)
    bounded_s = max(times.get(expected.bounded, 0.0), 0.0)
    drives = expected.bounded is Bounded.DRIVES
    stop_s = bounded_s if drives else bounded_s or times[Bounded.MOTIONS]
    contacts = truth[-1].collisions - truth[0].collisions
    in_time = bound is None or bounded_s <= bound
    last_motion = _last(seen[:1] if expected.bounded is Bounded.UNDER_WAY else seen)
    cut = stop_s > 0 if drives else last_motion in (LastMotion.CUT_SHORT, LastMotion.LASTS)
    return Judgement(
        reaction,
        round(stop_s, 3) if cut and bound is not None else None,
        last_motion,
        contacts,
        expected.met_by(reaction) and in_time and _told(run, expected) and not contacts,
    )


def _reaction(
    run: ObservedRun,
    expected: Expectation,
    seen: Sequence[MotionSeen],
    times: Mapping[Bounded, float],
) -> Reaction:
    bound = expected.bound_s or 0.0
    begun_late = any(m.begin > run.fault_s + bound for m in seen)
    if expected.bounded is Bounded.UNDER_WAY:
        begun_late = len(seen) > 1
    if run.outcome == "refused" and not seen:
        return Reaction.REFUSE
    if rode(run):
        return Reaction.RIDE_THROUGH
    if begun_late or _last(seen) is LastMotion.LASTS:
        return Reaction.DEGRADE
    turn_is_free = expected.bounded is Bounded.DRIVES
    late = times[Bounded.DRIVES] <= bound < times[Bounded.MOTIONS]
    return Reaction.DEGRADE if turn_is_free and late else Reaction.STOP


def _last(seen: Sequence[MotionSeen]) -> LastMotion:
    if not seen:
        return LastMotion.NONE
    if seen[-1].end == math.inf:
        return LastMotion.LASTS
    return LastMotion.FINISHED if seen[-1].complete else LastMotion.CUT_SHORT


def _told(run: ObservedRun, expected: Expectation) -> bool:
    """Whether the goal ended as it should, with a sentence that names the cause; or goes on."""
    if expected.ends or expected.reaction is Reaction.REFUSE:
        in_time = expected.end_s is None or run.ended_s - run.fault_s <= expected.end_s
        return run.outcome in ENDED and in_time and _names_cause(run, expected)
    if expected.reaction is Reaction.RIDE_THROUGH:
        return not run.outcome
    if run.outcome == "step_limit":  # a way that stays closed is asked for again and again
        return True
    return not run.outcome or (run.outcome in ENDED and _names_cause(run, expected))


def _names_cause(run: ObservedRun, expected: Expectation) -> bool:
    return bool(re.search(_cause(expected.fault), run.message))


def _free_again(run: ObservedRun, expected: Expectation) -> float:
    """When a robot that had to stop may move again; what is over at once has left its mark."""
    bound = expected.bound_s or 0.0
    mended = expected.reaction is Reaction.STOP and run.mended_s > run.fault_s + bound
    return run.mended_s if mended else math.inf


def _cause(fault: str) -> str:
    return next(words for begin, words in NAMES_CAUSE.items() if fault.startswith(begin))
