"""Figures of drives, each with its source; what cannot be known is said to be missing. Pure.

Success and collisions are taken from the best source that a drive has: the simulator's truth, by
the rules of ``outcome.py``; else an episodes file; else what a real robot can know. ``success_by``
and ``collisions_by`` show all sources side by side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfnav_core.task.actions import Action
from cfnav_ros.bags.files.events import Decided
from cfnav_ros.bags.judge.contacts import BUMP, OBSERVABLE, STALL, TRUTH, Contact, observable
from cfnav_ros.bags.judge.drive_log import FILE, POLICY, Drive, moved
from cfnav_ros.bags.judge.shortest import shortest_path
from cfnav_ros.drive.outcome import UNFINISHED, Outcome, nearest

SEEN_SCORE = 0.5
"""Detection score from which a goal counts as seen at Done: rather there than not."""

LEAST_WAY_M = 0.1
"""Collisions per metre of less way say nothing."""

DONE = "done"

UNSEEN = "cells of the map that nobody has seen count as free"


@dataclass(frozen=True)
class Fact:
    """One figure; ``value`` is None when it is missing.

    ``why`` says why it is missing, or what to bear in mind, or nothing.
    """

    value: Any
    source: str = ""
    why: str = ""

    @property
    def known(self) -> bool:
        """Whether there is a value."""
        return self.value is not None


def sources_of(*facts: Fact) -> str:
    """Where facts come from, each source once."""
    return ", ".join(dict.fromkeys(fact.source for fact in facts))


@dataclass(frozen=True)
class DriveOutcome:
    """The figures of one drive.

    Attributes:
        goal: what was sought; ``bundle``, ``room``, ``outcome``, ``message``: as the bag tells.
        seconds: how long it took.
        steps: decisions of the policy, None when the bag has none of a drive without episode.
        vetoes: decisions that were not executed.
        success: bool; ``success_by`` has the answer of each source that could tell.
        collisions: number; ``collisions_by`` the same by source, observable among them.
        cf_success: bool, S_i of Eq. 1.
        path_length_m: by odometry; ``truth_length_m``: truly driven.
        shortest_path_m: to where the goal can be seen.
        collisions_per_m: collisions over the way by the same kind of source.
        impact_speed: m/s, of the hardest contact.
        clearance_m: least clearance ahead that a LiDAR estimate showed.
        notes: of the drive.
    """

    goal: str
    bundle: str
    room: str
    outcome: str
    message: str
    seconds: float
    steps: int | None
    vetoes: int | None
    success: Fact
    success_by: Mapping[str, bool]
    collisions: Fact
    collisions_by: Mapping[str, int]
    cf_success: Fact
    path_length_m: Fact
    truth_length_m: Fact
    shortest_path_m: Fact
    collisions_per_m: Fact
    impact_speed: Fact
    clearance_m: Fact
    notes: tuple[str, ...] = ()

    @property
    def driven_m(self) -> Fact:
        """The way that counts: the true one where truth tells of success, as in ``outcome.py``."""
        truly = self.success.source == TRUTH and self.truth_length_m.known
        return self.truth_length_m if truly else self.path_length_m

    @property
    def counted_m(self) -> Fact:
        """The way on which the collisions were counted."""
        return self.truth_length_m if self.collisions.source == TRUTH else self.path_length_m


def judge(drive: Drive) -> DriveOutcome:
    """Work out the figures of a drive."""
    success_by = _successes(drive)
    contacts_by = contacts_of(drive)
    counts = {source: sum(c.count for c in found) for source, found in contacts_by.items()}
    success = _success(drive, success_by)
    collisions = _collisions(counts, drive.stalls_about)
    way = _length(drive.path_length_m, "odometry", drive.path_about)
    no_truth = "" if drive.truth_length_m is not None else "the drive holds no ground truth"
    true_way = _length(drive.truth_length_m, TRUTH, no_truth)
    told = bool(drive.decisions) or drive.found == POLICY
    return DriveOutcome(
        goal=drive.goal,
        bundle=drive.bundle,
        room=drive.truths[-1].room if drive.truths else "",
        outcome=drive.outcome,
        message=drive.message,
        seconds=drive.seconds,
        steps=len(drive.decisions) if told else None,
        vetoes=sum(d.vetoed for d in drive.decisions) if told else None,
        success=success,
        success_by=success_by,
        collisions=collisions,
        collisions_by=counts,
        cf_success=_cf_success(success, collisions),
        path_length_m=way,
        truth_length_m=true_way,
        shortest_path_m=_shortest(drive),
        collisions_per_m=_rate(collisions, true_way if collisions.source == TRUTH else way),
        impact_speed=_impact(collisions, contacts_by),
        clearance_m=_clearance(drive),
        notes=drive.notes,
    )


def live_outcome(drive: Drive) -> Outcome | None:
    """The drive as the simulator accounts for it live (``outcome.agree``).

    None without truth, or when the bag does not tell how the episode ended.

    Args:
        drive: an episode of the policy node.
    """
    successes = _successes(drive)
    if TRUTH not in successes or drive.truth_length_m is None:
        return None
    collisions = sum(c.count for c in drive.contacts[TRUTH])
    last = drive.truths[-1]
    return Outcome(
        goal=drive.goal,
        room=last.room,
        outcome=drive.outcome,
        success=successes[TRUTH],
        collisions=collisions,
        cf_success=successes[TRUTH] and collisions == 0,
        steps=len(drive.decisions),
        path_length_m=drive.truth_length_m,
        shortest_path_m=last.shortest_path,
    )


def _successes(drive: Drive) -> dict[str, bool]:
    """Whether the goal was found, by each source that can tell."""
    found: dict[str, bool] = {}
    if not drive.goal:
        return found
    done = _done(drive)
    if done is not None or _end_told(drive) not in ("", DONE):
        if drive.truths and drive.truths[-1].goal == drive.goal:
            visible = done is not None and nearest(drive.truths, done.t_ns).goal_visible
            found[TRUTH] = visible
        # what a detector says of one picture tells little of what was in view, and a policy that
        # remembers says Done without it
        if done is None or not done.by_detections:
            found[OBSERVABLE] = done is not None and done.detection_score >= SEEN_SCORE
    if drive.reached is not None:
        found[FILE] = drive.reached
    return found


def _end_told(drive: Drive) -> str:
    """How the drive ended, as the policy node tells it; empty when the bag does not hold that."""
    return "" if drive.outcome == UNFINISHED else drive.outcome


def _done(drive: Drive) -> Decided | None:
    """The Done for the drive's goal that ended it; None when none did."""
    sought = [d for d in drive.decisions if d.goal == drive.goal]
    said = [d for d in sought if d.action is Action.Done and not d.vetoed]
    end = _end_told(drive)
    ended = end == DONE or (not end and said and said[-1] is sought[-1])
    return said[-1] if said and ended else None


def _success(drive: Drive, by: Mapping[str, bool]) -> Fact:
    for source in (TRUTH, FILE, OBSERVABLE):
        if source in by:
            return Fact(by[source], source)
    if not drive.goal:
        return Fact(None, why="the drive has no goal")
    if drive.outcome == UNFINISHED:
        return Fact(None, why="the bag does not hold its end")
    if _done(drive) is not None:
        return Fact(None, why="a detector's boxes do not tell whether the goal was in view at Done")
    if drive.outcome == DONE:
        return Fact(None, why="it ended as done, but the bag does not hold the decision Done")
    return Fact(None, why="neither the policy nor a file says whether the goal was reached")


def contacts_of(drive: Drive) -> dict[str, tuple[Contact, ...]]:
    """The contacts by source, with ``OBSERVABLE``: what a real robot can know, each touch once."""
    found = {**drive.contacts}
    if BUMP in found or STALL in found:
        found[OBSERVABLE] = observable(found.get(BUMP, ()), found.get(STALL, ()))
    return found


def counted_contacts(drive: Drive) -> tuple[Contact, ...]:
    """The contacts that count: the truth's, else what a real robot can know."""
    found = contacts_of(drive)
    return found.get(TRUTH, found.get(OBSERVABLE, ()))


def _collisions(counts: Mapping[str, int], unseen: str) -> Fact:
    """The count; ``unseen``: which stalls could not be seen."""
    if TRUTH in counts:
        return Fact(counts[TRUTH], TRUTH)
    if OBSERVABLE in counts:
        return Fact(counts[OBSERVABLE], OBSERVABLE, unseen)
    nothing = "the bag holds neither ground truth nor bumps nor odometry with commands"
    return Fact(None, why=unseen or nothing)


def _cf_success(success: Fact, collisions: Fact) -> Fact:
    if success.known and not success.value:
        return Fact(False, success.source)
    if not (success.known and collisions.known):
        return Fact(None, why=success.why or collisions.why)
    return Fact(collisions.value == 0, sources_of(success, collisions))


def _length(metres: float | None, source: str, about: str) -> Fact:
    return Fact(metres, "" if metres is None else source, about)


def _rate(collisions: Fact, way: Fact) -> Fact:
    if not (collisions.known and way.known):
        return Fact(None, why=collisions.why or way.why)
    if way.value < LEAST_WAY_M:
        return Fact(None, why=f"it drove less than {LEAST_WAY_M:g} m")
    return Fact(collisions.value / way.value, sources_of(collisions, way))


def _impact(collisions: Fact, by: Mapping[str, tuple[Contact, ...]]) -> Fact:
    if not collisions.known:
        return Fact(None, why=collisions.why)
    if not collisions.value:
        return Fact(None, why="it touched nothing")
    speeds = [c.speed for c in by[collisions.source] if c.speed is not None]
    if not speeds:
        return Fact(None, why="the speed before the contact was not recorded")
    return Fact(max(speeds), TRUTH if collisions.source == TRUTH else "odometry")


def _clearance(drive: Drive) -> Fact:
    missing = "" if drive.clearance_m is not None else "no LiDAR estimate could be made"
    return Fact(drive.clearance_m, "" if missing else "LiDAR", missing)


def _shortest(drive: Drive) -> Fact:
    """The truth's, else that of the recorded map to the goal of the file."""
    if not drive.goal:
        return Fact(None, why="the drive has no goal")
    if drive.truths and drive.truths[-1].goal == drive.goal:
        return Fact(drive.truths[-1].shortest_path, TRUTH)
    missing = _no_way(drive)
    if missing or drive.map is None or drive.odom_in_map is None or drive.goal_at is None:
        return Fact(None, why=missing)
    ends = np.array([drive.path[0, 1:], (*drive.goal_at, 0.0)])
    (x, y, _), (goal_x, goal_y, _) = moved(ends, drive.odom_in_map).tolist()
    try:
        return Fact(shortest_path(drive.map, (x, y), (goal_x, goal_y)), "map", UNSEEN)
    except ValueError as error:
        return Fact(None, why=str(error))


def _no_way(drive: Drive) -> str:
    """What a shortest path through the map lacks; empty when it lacks nothing."""
    lacks = {
        "no map": drive.map is None,
        "no transform from map to odom": drive.odom_in_map is None,
        "no odometry": not len(drive.path),
        "no place of the goal in an episodes file": drive.goal_at is None,
    }
    missing = [what for what, true in lacks.items() if true]
    return f"no ground truth, and for the map's way {', '.join(missing)}" if missing else ""
