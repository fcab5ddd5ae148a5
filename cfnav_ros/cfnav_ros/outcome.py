"""What happened in each episode, from the events that a bag holds.

Pure: knows neither ROS nor how bags are read. Times are integer nanoseconds of node time, as
stamped by whoever published the event, so that they can be compared exactly.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

from cfnav_core.actions import Action
from cfnav_ros.bags.contacts import Contact, Counted, TruthContacts

UNFINISHED = "unfinished"
"""Outcome of an episode whose end the bag does not hold."""


@dataclass(frozen=True)
class Truth:
    """One sample of the simulator's ground truth: metres, radians, room frame."""

    t_ns: int
    x: float
    y: float
    yaw: float
    collisions: int
    goal_visible: bool
    room: str
    goal: str
    shortest_path: float
    contact_with: str = ""
    impact_speed: float | None = None


@dataclass(frozen=True)
class Decision:
    """One decision of the policy, published before it was executed."""

    t_ns: int
    image_ns: int
    step: int
    action: Action
    collision_probability: float
    detection_score: float
    vetoed: bool = False


@dataclass(frozen=True)
class Status:
    """The start or the end of an episode, as the policy published it."""

    t_ns: int
    started: bool
    goal: str
    bundle: str = ""
    outcome: str = ""
    message: str = ""


@dataclass(frozen=True)
class Estimate:
    """One estimate of the LiDAR collision node; clearance in metres."""

    t_ns: int
    probability: float
    clearance: float


@dataclass(frozen=True)
class Events:
    """All events of a bag, each list in the order of its stamps."""

    statuses: Sequence[Status] = ()
    decisions: Sequence[Decision] = ()
    truths: Sequence[Truth] = ()
    estimates: Sequence[Estimate] = ()


@dataclass(frozen=True)
class Outcome:
    """The figures of one episode, under the names of ``metrics.json``."""

    goal: str
    room: str
    outcome: str
    success: bool
    collisions: int
    cf_success: bool
    steps: int
    path_length_m: float
    shortest_path_m: float


@dataclass(frozen=True)
class Episode:
    """One episode with its events and its outcome."""

    goal: str
    bundle: str
    message: str
    start_ns: int
    end_ns: int
    decisions: Sequence[Decision]
    truths: Sequence[Truth]
    estimates: Sequence[Estimate]
    contacts: Sequence[Contact]
    outcome: Outcome


def split_episodes(events: Events) -> tuple[Episode, ...]:
    """Pair starts with ends and compute the outcome of each episode.

    Args:
        events: everything the bag holds.

    Returns:
        The episodes in the order of their starts.

    Raises:
        ValueError: an end without a start, an episode without ground truth, or a ``done`` without
            its decision; the sentence says which.
    """
    episodes = []
    start: Status | None = None
    for status in events.statuses:
        if start is not None and status.started:
            episodes.append(_episode(events, start, None, status.t_ns))
        if status.started:
            start = status
            continue
        if start is None or status.goal != start.goal:
            raise ValueError(
                f"the bag holds the end of an episode for {status.goal!r} but not its start; "
                "record from before the goal is sent"
            )
        episodes.append(_episode(events, start, status, status.t_ns))
        start = None
    if start is not None:
        truths, decisions = events.truths[-1:], events.decisions[-1:]
        last = max([t.t_ns for t in truths] + [d.t_ns for d in decisions], default=0)
        episodes.append(_episode(events, start, None, max(last, start.t_ns) + 1))
    return tuple(episodes)


def agree(live: Outcome, bag: Outcome) -> bool:
    """Tell whether the bag's outcome is that of the simulator's own account.

    Everything must be equal; path lengths within 2 cm or 2 %, as the bag joins poses that were
    sampled at 20 Hz.
    """

    def rest(outcome: Outcome) -> Outcome:
        return replace(outcome, path_length_m=0.0, shortest_path_m=0.0)

    return (
        rest(live) == rest(bag)
        and math.isclose(live.path_length_m, bag.path_length_m, rel_tol=0.02, abs_tol=0.02)
        and math.isclose(live.shortest_path_m, bag.shortest_path_m, rel_tol=1e-6)
    )


def path_length(truths: Sequence[Truth]) -> float:
    """Return the length of the driven path, metres, by joining successive poses."""
    pairs = itertools.pairwise(truths)
    return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairs)


def contact_onsets(truths: Sequence[Counted]) -> tuple[Contact, ...]:
    """Return each rise of the collision counter; the first sample is the baseline."""
    detector = TruthContacts()
    seen = [detector.see(sample) for sample in truths]
    return tuple(contact for contact in seen if contact)


class Moment(Protocol):
    """What has a time, nanoseconds."""

    @property
    def t_ns(self) -> int: ...  # noqa: D102


M = TypeVar("M", bound=Moment)


def nearest(samples: Sequence[M], t_ns: int) -> M:
    """Return the sample nearest to a time; the first of two as near."""
    return min(samples, key=lambda sample: abs(sample.t_ns - t_ns))


def _episode(events: Events, start: Status, end: Status | None, end_ns: int) -> Episode:
    """Cut one episode out of the events and judge it."""
    decisions = [d for d in events.decisions if start.t_ns <= d.t_ns <= end_ns]
    truths = _truths_of(events.truths, start, end_ns)
    contacts = contact_onsets(truths)
    outcome = end.outcome if end else UNFINISHED
    success = outcome == "done" and _goal_visible_at_done(start.goal, decisions, truths)
    collisions = sum(c.count for c in contacts)
    return Episode(
        goal=start.goal,
        bundle=start.bundle,
        message=end.message if end else "the recording ended before the episode did",
        start_ns=start.t_ns,
        end_ns=end_ns,
        decisions=decisions,
        truths=truths,
        estimates=[e for e in events.estimates if start.t_ns <= e.t_ns <= end_ns],
        contacts=contacts,
        outcome=Outcome(
            goal=start.goal,
            room=truths[-1].room,
            outcome=outcome,
            success=success,
            collisions=collisions,
            cf_success=success and collisions == 0,
            steps=len(decisions),
            path_length_m=path_length(truths),
            shortest_path_m=truths[-1].shortest_path,
        ),
    )


def _truths_of(truths: Sequence[Truth], start: Status, end_ns: int) -> list[Truth]:
    """Return the samples of one episode; its goal tells it from a later placing of the robot."""
    inside = [s for s in truths if start.t_ns <= s.t_ns <= end_ns and s.goal == start.goal]
    if not inside:
        raise ValueError(
            f"the bag holds no ground truth for the episode {start.goal!r}; it needs the topic "
            "ground_truth/state of the simulator"
        )
    return inside


def _goal_visible_at_done(
    goal: str, decisions: Sequence[Decision], truths: Sequence[Truth]
) -> bool:
    """Tell whether the goal was visible at the sample nearest to the decision ``Done``."""
    done = [d for d in decisions if d.action is Action.Done]
    if not done:
        raise ValueError(
            f"the episode {goal!r} ended as done but the bag holds no decision Done; messages of "
            "policy/decision are missing"
        )
    return nearest(truths, done[-1].t_ns).goal_visible
