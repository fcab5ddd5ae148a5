"""One bag in one pass: its drives judged, bundles replayed over them, its sensors watched.

Memory does not grow with the bag: pictures live for seconds, and of each drive a handful stay as
small JPEG files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from cfnav_core.policy.policy import Policy
from cfnav_core.robot.robot import Robot
from cfnav_ros.bags.files.decode import TILT_JOINT
from cfnav_ros.bags.files.events import (
    Bumps,
    Detected,
    Event,
    Joint,
    Judged,
    LaserTurn,
    Picture,
    Pose,
)
from cfnav_ros.bags.files.parameters_file import RobotParameters
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.roles import ROLES, Roles, assign, names_of, told
from cfnav_ros.bags.files.storage import BagTopic
from cfnav_ros.bags.film import Film
from cfnav_ros.bags.health.health import Finding, Health
from cfnav_ros.bags.health.topic_watch import TopicHealth
from cfnav_ros.bags.judge.contacts import STALL, Contact
from cfnav_ros.bags.judge.drive_log import Drive
from cfnav_ros.bags.judge.drives import DriveFinder
from cfnav_ros.bags.judge.episodes_file import EpisodeRow
from cfnav_ros.bags.judge.odometry import OneOdometry
from cfnav_ros.bags.judge.outcomes import DriveOutcome, counted_contacts, judge
from cfnav_ros.bags.replay.estimates import Estimates
from cfnav_ros.bags.replay.replay import Replay
from cfnav_ros.bags.replay.step import LeftOut, ReplayStep, labelled
from cfnav_ros.bags.scan_map import ScanMap
from cfnav_ros.drive.detection_watch import DetectionSettings, DetectionWatch
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.lidar.scan_watch import LidarParameters

TICK = 1000
"""Events between two words of progress."""

ANOTHER = "--namespace {} judges another"
"""How one of several robots is chosen."""

STEADY: dict[str, type[Event]] = {
    "image": Picture,
    "detections": Detected,
    "scan": LaserTurn,
    "odom": Pose,
    "joint_states": Joint,
    "hazards": Bumps,
    "estimate": Judged,
}
"""Roles whose topics speak all the time on every robot that has them, not on some occasion only."""


@dataclass(frozen=True)
class JudgeOptions:
    """How bags are evaluated.

    Attributes:
        bundles: folders of those that are replayed, by name, or names of shipped ones.
        topics: names of topics by role, where they are not the usual ones.
        namespace: of the robot, where a bag holds several.
        rows: of an episodes file.
        lidar: of the LiDAR node; ``mount_given``: its mounting was set by somebody.
        limits: of the policy node. detections: how it takes what a detector says.
        robot: that drove. room_type: where, for bundles that look it up.
        tilt_joint: name of the camera's tilt.
    """

    bundles: Mapping[str, str] = field(default_factory=dict)
    topics: Mapping[str, str] = field(default_factory=dict)
    namespace: str = ""
    rows: tuple[EpisodeRow, ...] = ()
    lidar: LidarParameters = field(default_factory=LidarParameters)
    mount_given: bool = False
    limits: EpisodeLimits = field(default_factory=EpisodeLimits)
    detections: DetectionSettings = field(default_factory=DetectionSettings)
    robot: Robot = field(default_factory=Robot)
    tilt_joint: str = TILT_JOINT
    room_type: str = ""

    @classmethod
    def of(cls, told: RobotParameters, topics: Mapping[str, str], **others: Any) -> JudgeOptions:
        """By what the nodes of a robot were told; ``topics`` go before the robot's."""
        return cls(
            topics={**names_of(told.robot), **topics}, robot=told.robot, lidar=told.lidar,
            mount_given=told.mount_given, limits=told.policy.episode,
            detections=told.policy.detections, tilt_joint=told.policy.tilt_joint,
            room_type=told.policy.room_type, **others,
        )  # fmt: skip

    def check(self) -> None:
        """Before hours are spent: whether the bundles can be replayed so.

        Raises:
            ValueError: one cannot; one sentence.
        """
        for folder in self.bundles.values():
            if policy_of(folder, self.room_type).reads_sightings:
                DetectionWatch(self.detections, self.robot)

    @property
    def reads_sightings(self) -> bool:
        """Whether one of the bundles does; else no detection is of concern."""
        return any(policy_of(folder).reads_sightings for folder in self.bundles.values())

    def assigned(self, topics: Sequence[BagTopic]) -> Roles:
        """Which topic of a bag plays which role."""
        roles = {r: of for r, of in ROLES.items() if r != "detections" or self.reads_sightings}
        return assign(topics, self.topics, roles, self.namespace)


@dataclass(frozen=True)
class EvaluatedDrive:
    """A drive with its figures.

    Attributes:
        drive: what happened.
        outcome: its figures.
        contacts: those that count: of the truth, else what a real robot can know.
        steps: answers of the bundles to its decisions, labelled.
        pictures: JPEG files of the decisions worth a picture, by the picture's stamp.
        points: float32 [N, 2], what the LiDAR saw around, metres in the odometry frame.
    """

    drive: Drive
    outcome: DriveOutcome
    contacts: tuple[Contact, ...]
    steps: tuple[ReplayStep, ...]
    pictures: Mapping[int, bytes]
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 2), np.float32))

    def __repr__(self) -> str:
        o = self.outcome
        reached = {True: "reached", False: "not reached", None: "reached or not"}[o.success.value]
        touches = "?" if o.collisions.value is None else o.collisions.value
        metres = "?" if o.driven_m.value is None else f"{o.driven_m.value:.2f}"
        return (
            f"<Drive to {o.goal or 'nowhere'}: {o.outcome or 'not told'}, {reached}, "
            f"{touches} touches, {'?' if o.steps is None else o.steps} steps, {metres} m>"
        )


@dataclass(frozen=True)
class BagEvaluation:
    """What one bag says.

    Attributes:
        name: of the bag.
        seconds: from its first event to its last, by log time.
        events: that were read.
        roles: names of the topics by role.
        missing: roles without a topic.
        drives: in the order of their starts.
        left_out: decisions that no bundle could answer, and why.
        topics: health of each topic.
        findings: what is wrong with the sensors, and how it was treated.
        notes: what was chosen and what could not be read, a sentence each.
        damaged: whether some of it could not be read.
        messages: that were read.
        unchecked: how many of them no checksum protects: damage within them goes unnoticed.
        bundles: names that the replayed bundles give themselves, by that of their steps.
        unused: topics that play no role, as told in a sentence.
    """

    name: str
    seconds: float
    events: int
    roles: Mapping[str, str]
    missing: tuple[str, ...]
    drives: tuple[EvaluatedDrive, ...]
    left_out: tuple[LeftOut, ...]
    topics: tuple[TopicHealth, ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]
    damaged: bool
    messages: int = 0
    unchecked: int = 0
    bundles: Mapping[str, str] = field(default_factory=dict)
    unused: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Evaluation of bag {self.name}: {len(self.drives)} drives, {self.seconds:.1f} s>"


@lru_cache(maxsize=8)
def policy_of(folder: str, room_type: str = "") -> Policy:
    """A bundle, loaded once in this process; see ``Policy.load``."""
    return Policy.load(folder, room_type=room_type)


def evaluate(
    path: Path,
    options: JudgeOptions,
    tick: Callable[[int], None] = lambda events: None,
    name: str = "",
) -> BagEvaluation:
    """Evaluate one bag.

    Args:
        path: one of those that ``find_bags`` gives.
        options: how.
        tick: told now and then how many more events have been read.
        name: of the bag, that of its folder or file when not given; no two bags of one report
            may have the same.

    Raises:
        BundleError: a bundle cannot be used.
    """
    with Bag(path) as bag:
        roles = options.assigned(bag.topics)
        work = _Work(name or path.name, roles, options, bag.begin_ns if options.rows else 0)
        for count, event in enumerate(bag.events(roles, options.tilt_joint), 1):
            work.see(event)
            if count % TICK == 0:
                tick(TICK)
        tick(work.events % TICK)
        found = work.finish(tuple(bag.notes))
        used = {topic.key for topic in roles.topics.values()}
        unused = tuple(told(topic) for topic in bag.topics if topic.key not in used)
        return replace(found, messages=bag.read, unchecked=bag.unchecked, unused=unused)


class _Work:
    """Every part of the evaluation, shown the same events."""

    def __init__(self, name: str, roles: Roles, options: JudgeOptions, begin_ns: int) -> None:
        self.events, self._begin_ns = 0, begin_ns
        self._name, self._roles = name, roles
        self._rows = tuple(sorted(options.rows, key=lambda row: row.start))
        steady = [(t, STEADY[role]) for role, t in roles.topics.items() if role in STEADY]
        self._health = Health({t.name: kind for t, kind in steady if t.count == 0})
        self._finder, self._film = DriveFinder(options.rows, begin_ns), Film()
        self._odometry = OneOdometry()
        self._scan_map = ScanMap()
        self._estimates = Estimates(options.lidar, options.mount_given)
        self._scanned = _holds(roles, "scan")
        self._infer = not _holds(roles, "decision")
        self._policies = {
            key: policy_of(folder, options.room_type) for key, folder in options.bundles.items()
        }
        self._replay = Replay(
            self._policies, self._estimates, options.limits, infer=self._infer, bag=name,
            watch=self._watch(options),
            look=self._film.add,
        )  # fmt: skip
        self._first_ns = self._last_ns = 0
        self._next = 0
        self._running: EpisodeRow | None = None
        self._finished: list[tuple[Drive, Mapping[int, bytes], np.ndarray]] = []

    def _watch(self, options: JudgeOptions) -> DetectionWatch | None:
        """What makes sightings of detections, where a bundle reads them."""
        if not options.reads_sightings:
            return None
        return DetectionWatch(options.detections, options.robot)

    def see(self, event: Event) -> None:
        """Take the next event."""
        self.events += 1
        self._first_ns = self._first_ns or event.log_ns
        self._last_ns = max(self._last_ns, event.log_ns)
        self._health.see(event)
        if isinstance(event, Judged) and self._scanned:
            return  # those made again count, as the bundles see them
        if isinstance(event, Pose) and not self._odometry.takes(event):
            return
        for judged in self._estimates.see(event) if self._scanned else ():
            self._health.see(judged)
            self._keep(self._finder.see(judged))
        if self._infer:
            self._begin_rows(event)
        self._replay.see(event)
        mount = self._estimates.mount_of(event.scan.frame) if isinstance(event, LaserTurn) else None
        self._scan_map.see(event, mount)
        if not isinstance(event, LaserTurn):
            self._keep(self._finder.see(event))
            if any(contact.source == STALL for contact in self._finder.contacts):
                self._replay.stalled()

    def finish(self, notes: Sequence[str]) -> BagEvaluation:
        """The bag is over."""
        self._replay.finish()
        self._keep(self._finder.finish())
        return BagEvaluation(
            name=self._name,
            seconds=(self._last_ns - self._first_ns) * 1e-9,
            events=self.events,
            roles={role: topic.name for role, topic in self._roles.topics.items()},
            missing=self._roles.missing,
            drives=tuple(self._evaluated(*kept) for kept in self._finished),
            left_out=tuple(self._replay.left_out),
            topics=self._health.topics(),
            findings=self._health.findings(),
            notes=(
                *self._roles.about_robots(ANOTHER),
                *self._roles.notes,
                *self._odometry.notes,
                *self._finder.notes,
                *notes,
            ),
            damaged=bool(notes),
            bundles={key: policy.name for key, policy in self._policies.items()},
        )

    def _begin_rows(self, event: Event) -> None:
        """Tell the replay of the drives of an episodes file; recorded ones tell it themselves."""
        seconds = (event.log_ns - (self._begin_ns or self._first_ns)) * 1e-9
        if self._running and seconds > self._running.end:
            self._replay.end(event.log_ns)
            self._running = None
        if self._next < len(self._rows) and seconds >= self._rows[self._next].start:
            self._running = self._rows[self._next]
            self._next += 1
            self._replay.begin(self._running.goal, event.log_ns)

    def _keep(self, drives: Sequence[Drive]) -> None:
        for drive in drives:
            pictures = self._film.cut(drive, self._steps_of(drive))
            self._finished.append((drive, pictures, self._scan_map.cut(drive)))

    def _steps_of(self, drive: Drive) -> list[ReplayStep]:
        return [s for s in self._replay.steps if drive.start_ns <= s.t_ns <= drive.end_ns]

    def _evaluated(
        self, drive: Drive, pictures: Mapping[int, bytes], points: np.ndarray
    ) -> EvaluatedDrive:
        outcome, contacts, steps = judge(drive), counted_contacts(drive), self._steps_of(drive)
        if outcome.collisions.known:
            steps = labelled(steps, [contact.t_ns for contact in contacts])
        return EvaluatedDrive(drive, outcome, contacts, tuple(steps), pictures, points)


def _holds(roles: Roles, role: str) -> bool:
    topic = roles.topics.get(role)
    return topic is not None and topic.count != 0
