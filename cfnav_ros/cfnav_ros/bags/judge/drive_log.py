"""What is kept of one drive while a bag goes by: in memory bounded whatever the drive's length."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cfnav_ros.bags.files.events import (
    Bumps,
    Decided,
    Event,
    Judged,
    OccupancyMap,
    Pose,
    Told,
    Truth,
    Velocity,
)
from cfnav_ros.bags.judge.block_stalls import Sight
from cfnav_ros.bags.judge.contacts import SOURCES, STALL, Contact, TruthContacts
from cfnav_ros.bags.judge.detectors import Detectors
from cfnav_ros.bags.judge.episodes_file import EpisodeRow
from cfnav_ros.bags.judge.stalls import NO_START
from cfnav_ros.bags.judge.thinned import Thinned
from cfnav_ros.bags.judge.way import TWO_SOURCES, Way
from cfnav_ros.drive.motion import wrap
from cfnav_ros.lidar.estimate import Verdict

POSE_M, POSE_RAD = 0.02, math.radians(2.0)
"""A pose is kept when it differs so much from the last that was."""

SAMPLE_S = 0.1
"""Estimates are kept at most so often; the A1M8 turns 7.7 times a second."""

SILENT_S = 1.0
"""A source that says nothing for so long before the drive ends may have missed what happened."""

POLICY, FILE, BAG = "policy", "file", "bag"
"""How a drive was found: an episode of the policy node, a row of a file, the whole bag."""


@dataclass(frozen=True)
class Drive:
    """One drive, with what its figures need.

    Attributes:
        found: how: ``POLICY``, ``FILE`` or ``BAG``.
        start_ns: nanoseconds of the bag's one time (``clocks``).
        end_ns: its end; for an unfinished one the last that the bag holds.
        goal: what was sought, empty for nothing.
        goal_at: where it is, metres in the odometry frame, None if unknown.
        reached: what the file says, None if it does not.
        bundle: that drove, as the policy node names it.
        outcome: of the goal as the policy node tells it, ``unfinished`` without its end, else
            empty.
        message: its sentence.
        path: float64 [N, 4]: s from the start, x, y (m), yaw (rad) in the odometry frame; thinned.
        path_length_m: by all odometry, None if unknown.
        path_about: what to bear in mind of it, or why it is unknown; part of a sentence.
        decisions: of the policy.
        contacts: by source, only those sources that could tell.
        stalls_about: which stalls cannot be seen in it; part of a sentence, empty for none.
        estimates: float64 [N, 4]: s from the start, p_hat, clearance (m), verdict; thinned.
        clearance_m: least clearance of all that were not BLIND, None without.
        truths: of the simulator, thinned; none is left out where something changes.
        truth_length_m: truly driven, None without truth.
        map: newest map by its end, None without.
        odom_in_map: x, y (m), yaw (rad) of the odometry frame in the map's, None if unknown.
        notes: what is incomplete or was decided, a sentence each.
    """

    found: str
    start_ns: int
    end_ns: int
    goal: str = ""
    goal_at: tuple[float, float] | None = None
    reached: bool | None = None
    bundle: str = ""
    outcome: str = ""
    message: str = ""
    path: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))
    path_length_m: float | None = None
    path_about: str = ""
    decisions: tuple[Decided, ...] = ()
    contacts: Mapping[str, tuple[Contact, ...]] = field(default_factory=dict)
    stalls_about: str = ""
    estimates: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))
    clearance_m: float | None = None
    truths: tuple[Truth, ...] = ()
    truth_length_m: float | None = None
    map: OccupancyMap | None = None
    odom_in_map: tuple[float, float, float] | None = None
    notes: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """How long it took."""
        return self.since_start(self.end_ns)

    def since_start(self, t_ns: int) -> float:
        """Seconds from its start to a time, nanoseconds."""
        return (t_ns - self.start_ns) * 1e-9

    def __repr__(self) -> str:
        name = self.goal or "nowhere"
        return f"<Drive to {name}: {self.seconds:.1f} s, {len(self.decisions)} decisions>"


def moved(poses: np.ndarray, frame: tuple[float, float, float]) -> np.ndarray:
    """Poses of one frame in another.

    Args:
        poses: float64 [N, 3]: x, y (m), yaw (rad).
        frame: x, y (m), yaw (rad) of their frame in the other.

    Returns:
        Float64 [N, 3].
    """
    x, y, yaw = frame
    c, s = math.cos(yaw), math.sin(yaw)
    turned = poses[:, :2] @ np.array([[c, s], [-s, c]])
    return np.column_stack([turned[:, 0] + x, turned[:, 1] + y, poses[:, 2] + yaw])


class DriveLog:
    """Takes the events of one drive; ``close`` makes the ``Drive``."""

    def __init__(self, found: str, start_ns: int, goal: str = "", bundle: str = "") -> None:
        """Begin a drive; see ``Drive`` for the arguments."""
        self.found, self.start_ns, self.goal, self.bundle = found, start_ns, goal, bundle
        self.end_ns: int | None = None
        self.row: EpisodeRow | None = None
        self.outcome = self.message = ""
        self.notes: list[str] = []
        self.decisions: list[Decided] = []
        self.map: OccupancyMap | None = None
        self.odom_in_map: tuple[float, float, float] | None = None
        self._contacts: list[Contact] = []
        self._path: Thinned[tuple[float, ...]] = Thinned(_moved)
        self._estimates: Thinned[tuple[float, ...]] = Thinned(_later)
        self._clearance = math.inf
        self._truths: Thinned[Truth] = Thinned(_truth_moved)
        self._truth_length = 0.0
        self._collisions = TruthContacts()
        self._way = Way()
        self._last: dict[type[Event], int] = {}

    def covers(self, t_ns: int) -> bool:
        """Whether a time lies within the drive."""
        return self.start_ns <= t_ns and (self.end_ns is None or t_ns <= self.end_ns)

    @property
    def last_ns(self) -> int:
        """Time of the latest event of the drive so far."""
        return max(self._last.values(), default=self.start_ns)

    def take(self, t_ns: int, event: Event | Contact) -> None:
        """Take an event or a contact of the drive's time."""
        if isinstance(event, Contact):
            self._contacts.append(event)
            return
        if self._of_another(event):
            return
        self._last[type(event)] = max(t_ns, self._last.get(type(event), t_ns))
        t = (t_ns - self.start_ns) * 1e-9
        if isinstance(event, Pose):
            self._way.take(t_ns, event)
            self._path.take((t, event.x, event.y, event.yaw))
        elif isinstance(event, Judged):
            self._take_estimate(t, event)
        elif isinstance(event, Truth):
            self._take_truth(t_ns, event)
        elif isinstance(event, Decided):
            self.decisions.append(replace(event, t_ns=t_ns))
        elif isinstance(event, OccupancyMap):
            self.map = event
        elif isinstance(event, Told) and self.row and not event.started:
            self.bundle = event.bundle
            if self.goal in ("", event.goal):
                self.outcome, self.message = event.outcome, event.message

    def close(self, heard: frozenset[type[Event]], detectors: Detectors) -> Drive:
        """Make the drive.

        Args:
            heard: kinds of events that the bag has held so far.
            detectors: that have seen the same.
        """
        end_ns = self.last_ns if self.end_ns is None else self.end_ns
        found = [c for c in self._contacts if detectors.counts(c)]
        could = self._could_tell(heard)
        sight = detectors.sight if STALL in could else Sight()
        if self._way.of_two_sources(detectors.quality):
            sight = Sight(TWO_SOURCES, blind=True)
        stalled = any(c.source == STALL for c in found)
        if sight.blind or (sight.unseen and not stalled):
            could = [source for source in could if source != STALL]
        notes = (*self.notes, *self._incomplete(end_ns, found))
        row = self.row
        metres, path_about = self._way.length(detectors.quality)
        return Drive(
            found=self.found,
            start_ns=self.start_ns,
            end_ns=end_ns,
            goal=self.goal,
            goal_at=row.goal_at if row else None,
            reached=row.reached if row else None,
            bundle=self.bundle,
            outcome=self.outcome,
            message=self.message,
            path=np.array(self._path.all(), np.float64).reshape(-1, 4),
            path_length_m=metres,
            path_about=path_about,
            decisions=tuple(self.decisions),
            contacts={s: tuple(c for c in found if c.source == s) for s in could},
            stalls_about=sight.unseen,
            estimates=np.array(self._estimates.all(), np.float64).reshape(-1, 4),
            clearance_m=self._clearance if math.isfinite(self._clearance) else None,
            truths=tuple(self._truths.all()),
            truth_length_m=self._truth_length if Truth in self._last else None,
            map=self.map,
            odom_in_map=self.odom_in_map,
            notes=notes,
        )

    def _take_estimate(self, t: float, event: Judged) -> None:
        estimate = event.estimate
        if estimate.verdict is not Verdict.BLIND:
            self._clearance = min(self._clearance, estimate.clearance)
        self._estimates.take((t, estimate.probability, estimate.clearance, float(estimate.verdict)))

    def _of_another(self, event: Event) -> bool:
        """Whether its goal shows that the robot was placed for another episode."""
        return isinstance(event, Truth) and self.found == POLICY and event.goal != self.goal

    def _take_truth(self, t_ns: int, event: Truth) -> None:
        """Take a sample."""
        sample = event if event.t_ns == t_ns else replace(event, t_ns=t_ns)
        before = self._truths.newest
        changed = before is not None and _state(before) != _state(sample)
        if before is not None and (before.room, before.goal) == (sample.room, sample.goal):
            self._truth_length += math.hypot(sample.x - before.x, sample.y - before.y)
        self._truths.take(sample, pin=changed)
        contact = self._collisions.see(sample)
        if contact:
            self._contacts.append(contact)

    def _could_tell(self, heard: frozenset[type[Event]]) -> list[str]:
        """The sources of contacts that could tell of them in this drive."""
        # A bumper may report only when it is pressed; a base told nothing cannot disobey.
        there = (
            self._truths.newest is not None,
            Bumps in heard,
            Pose in self._last and Velocity in heard,
            math.isfinite(self._clearance),
        )
        return [source for source, tells in zip(SOURCES, there, strict=True) if tells]

    def _incomplete(self, end_ns: int, found: Sequence[Contact]) -> list[str]:
        """One sentence for each thing that makes the figures less than they seem."""
        notes = []
        jumps = self._way.jumps
        if jumps:
            notes.append(f"Odometry jumped {jumps} times; the leaps are not counted as way.")
        idle = sum(c.source == NO_START for c in found)
        if idle:
            notes.append(
                f"The base was told to move and never started {idle} times; that is no contact: "
                "it may have had no power, or heeded another controller."
            )
        kinds = {"odometry": Pose, "the simulator's truth": Truth, "LiDAR estimates": Judged}
        for name, kind in kinds.items():
            silent = (end_ns - self._last.get(kind, end_ns)) * 1e-9
            if silent > SILENT_S:
                notes.append(
                    f"The last {silent:.1f} s of the drive hold no {name}: contacts there are "
                    "unknown to them."
                )
        return notes


def _moved(a: tuple[float, ...], b: tuple[float, ...], spacing: float) -> bool:
    """Whether two rows of a path differ by more than so many times the usual."""
    turned = abs(wrap(b[3] - a[3])) >= POSE_RAD * spacing
    return turned or math.hypot(b[1] - a[1], b[2] - a[2]) >= POSE_M * spacing


def _later(a: tuple[float, ...], b: tuple[float, ...], spacing: float) -> bool:
    return b[0] - a[0] >= SAMPLE_S * spacing


def _truth_moved(a: Truth, b: Truth, spacing: float) -> bool:
    return _moved((0.0, a.x, a.y, a.yaw), (0.0, b.x, b.y, b.yaw), spacing)


def _state(sample: Truth) -> tuple[Any, ...]:
    """What changes at a moment that counts."""
    return (
        sample.collisions,
        sample.goal_visible,
        sample.room,
        sample.goal,
        sample.shortest_path,
    )
