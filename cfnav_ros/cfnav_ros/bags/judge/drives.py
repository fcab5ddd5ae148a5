"""Drives of a bag, found while its events go by.

A drive is an episode of the policy node (its ``Told`` events), or a row of an episodes file, or,
with neither, the whole bag, which is then judged for safety only. Pure.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Sequence

from cfnav_ros.bags.files.events import (
    Bumps,
    Decided,
    Event,
    Frames,
    Judged,
    OccupancyMap,
    Pose,
    Told,
    Truth,
    Velocity,
)
from cfnav_ros.bags.judge.clocks import Clocks
from cfnav_ros.bags.judge.contacts import Contact
from cfnav_ros.bags.judge.detectors import Detectors
from cfnav_ros.bags.judge.drive_log import BAG, FILE, POLICY, Drive, DriveLog
from cfnav_ros.bags.judge.episodes_file import EpisodeRow
from cfnav_ros.bags.judge.latched import Latched
from cfnav_ros.drive.outcome import UNFINISHED
from cfnav_ros.lidar.frames import FrameTree

USED = (Bumps, Decided, Judged, OccupancyMap, Pose, Told, Truth, Velocity)

MOST = 1e6
"""Larger numbers, metres or radians, come from no drive."""

RECENT = 4096
"""Messages of the last ``LATE_S`` at most: a log whose time stands must not fill the memory."""

LATE_S = 1.0
"""Messages are recorded up to this much after what they tell of: a drive is closed so much later,
and one that begins takes what was recorded so much earlier if its stamp is later."""

MAP_FRAMES = ("map", "odom")
"""Names of REP 105, in any namespace."""

NEVER_BEGAN = ("preempted", "refused", "canceled")
"""Outcomes of goals that are answered without a decision: they are no drives."""


class DriveFinder:
    """Finds the drives of one bag; feed it every event in the order of log times.

    Estimates may be those that were recorded or replayed ones: feed it one of them.

    Attributes:
        notes: what was found of episodes that are no drives, a sentence each.
        contacts: those that the last event showed, by the noise of the odometry until then.
    """

    def __init__(self, rows: Sequence[EpisodeRow] = (), begin_ns: int = 0) -> None:
        """Begin a bag.

        Args:
            rows: its rows of an episodes file; with any, only they make drives.
            begin_ns: log time that they count from; 0: that of the first event.
        """
        self.notes: list[str] = []
        self.contacts: list[Contact] = []
        self._rows = deque(sorted(rows, key=lambda row: row.start))
        self._by_file = bool(rows)
        self._clocks = Clocks()
        self._detectors = Detectors()
        self._latched = Latched()
        self._begin_ns: int | None = None
        self._rows_begin_ns = begin_ns
        self._log_ns = 0
        self._heard: frozenset[type[Event]] = frozenset()
        self._recent: deque[tuple[int, int, Event | Contact]] = deque(maxlen=RECENT)
        self._unsound: Counter[str] = Counter()
        self._found = False
        self._map: OccupancyMap | None = None
        self._odom_in_map: tuple[float, float, float] | None = None
        self._odometry_frame = ""
        self._open: DriveLog | None = None
        self._closing: list[tuple[int, DriveLog]] = []
        self._rest: DriveLog | None = None  # what no drive has claimed yet

    def see(self, event: Event) -> list[Drive]:
        """Take the next event; returns the drives that are finished with it."""
        self.contacts = []
        if isinstance(event, Frames):
            self._take_frames(event)
        return [d for each, old in self._latched.see(event) for d in self._see(each, old)]

    def _see(self, event: Event, old: bool) -> list[Drive]:
        """Take an event; ``old``: it is a message of the policy node from before the bag."""
        self._log_ns = max(self._log_ns, event.log_ns)
        if self._begin_ns is None and event.log_ns > 0:
            self._begin_ns = event.log_ns
            self._rows_begin_ns = self._rows_begin_ns or event.log_ns
        if not isinstance(event, USED):
            return []
        if not _sensible(event):
            self._unsound[event.topic] += 1
            return []
        t = self._clocks.time(event)
        self._heard |= {type(event)}
        if isinstance(event, OccupancyMap):
            self._map = event
        elif isinstance(event, Pose):
            self._odometry_frame = event.frames.partition(" to ")[0].lstrip("/")
        if self._rest is None and self._open is None:
            self._rest = DriveLog(BAG, t)
        self._begin_rows()
        if isinstance(event, Told):
            self._hear(t, event, old)
        contacts = self._detectors.see(t, event, self._begin_ns or 0)
        self.contacts += filter(self._detectors.counts, contacts)
        for item in (event, *contacts):
            when = item.t_ns if isinstance(item, Contact) else t
            self._recent.append((event.log_ns, when, item))
            self._deal(when, item)
        while event.log_ns - self._recent[0][0] > LATE_S * 1e9:
            self._recent.popleft()
        return self._close()

    def finish(self) -> list[Drive]:
        """The bag is over; returns the drives that were not finished yet."""
        found = [d for event, old in self._latched.finish() for d in self._see(event, old)]
        left = [log for _, log in self._closing]
        if self._open is not None:
            left.append(self._ended_early(self._open))
        elif not self._found and not self._by_file and self._rest is not None:
            left.append(self._rest)
        self.notes += [
            f"The episode of {row.goal or 'no goal'} from {row.start:g} s is beyond the bag's end."
            for row in self._rows
        ]
        self.notes += [
            f"{count} messages of {topic} hold a number that makes no sense; they are left out."
            for topic, count in self._unsound.items()
        ]
        self._unsound.clear()
        self._closing, self._open, self._rest = [], None, None
        self._rows.clear()
        return found + [self._drive(log) for log in left]

    # Drives begin and end

    def _begin_rows(self) -> None:
        """Begin and end the drives of the file."""
        begin, now = self._rows_begin_ns, self._log_ns
        if not self._by_file or self._begin_ns is None:
            return
        if self._open and self._open.end_ns is not None and now > self._open.end_ns:
            self._end(self._open)
        while self._rows and now >= begin + self._rows[0].start * 1e9:
            row = self._rows.popleft()
            if self._open:
                self._end(self._open)
            log = DriveLog(FILE, begin + round(row.start * 1e9), row.goal)
            log.row, log.end_ns = row, begin + round(row.end * 1e9)
            self._begin(log)

    def _hear(self, t: int, told: Told, old: bool) -> None:
        """Begin or end a drive as the policy node tells; ``old``: before the bag began."""
        if self._by_file:
            return
        if told.started:
            if self._open and (self._open.start_ns, self._open.goal) == (t, told.goal):
                return  # recorded twice
            if self._open and old:
                self._over_before(self._open.goal)
            elif self._open:
                self._open.end_ns = t
                self._open.notes.append("Another episode began before this one's end was told.")
                self._open.outcome = UNFINISHED
                self._end(self._open)
            log = DriveLog(POLICY, t, told.goal, told.bundle)
            rest = self._rest
            self._begin(log)
            if old:  # its end may be old, too
                log.notes.append("The episode began before the recording did.")
                self._rest = rest
        elif self._open and told.goal == self._open.goal:
            self._finish_open(t, told, old)
        else:
            self._end_unstarted(t, told, old)

    def _finish_open(self, t: int, told: Told, old: bool) -> None:
        log = self._open
        assert log is not None
        if old:
            self._over_before(told.goal)
            self._open = None
            return
        if told.outcome in NEVER_BEGAN and not log.decisions:
            self._never_began(told)
            self._open, self._rest = None, DriveLog(BAG, log.start_ns)
            return
        log.end_ns, log.outcome, log.message = t, told.outcome, told.message
        self._end(log)

    def _never_began(self, told: Told) -> None:
        self.notes.append(
            f"The goal {told.goal} was answered with {told.outcome!r} and never began."
        )

    def _end_unstarted(self, t: int, told: Told, old: bool) -> None:
        """The end of an episode that was not seen to begin."""
        rest = self._rest
        drove = rest is not None and any(d.goal == told.goal for d in rest.decisions)
        if old and not drove:
            self._over_before(told.goal)
        elif rest is not None and rest.start_ns == t:
            self.notes.append(
                f"The end of an episode of {told.goal} is all that was recorded of it."
            )
        elif self._open or rest is None or (told.outcome in NEVER_BEGAN and not drove):
            self._never_began(told)
        else:
            rest.found, rest.goal, rest.bundle = POLICY, told.goal, told.bundle
            rest.end_ns, rest.outcome, rest.message = t, told.outcome, told.message
            rest.notes.append(
                "The episode's start was not recorded: it counts from where the bag begins, or "
                "from the end of the episode before."
            )
            self._end(rest)

    def _over_before(self, goal: str) -> None:
        """Say that an episode is none of the bag's."""
        self.notes.append(f"The episode of {goal} was over before the recording began.")

    def _begin(self, log: DriveLog) -> None:
        log.map, log.odom_in_map = self._map, self._odom_in_map
        self._open, self._rest = log, None
        for _, when, item in self._recent:
            if log.covers(when):
                log.take(when, item)

    def _end(self, log: DriveLog) -> None:
        """The end of a drive is known; what tells of it may still come."""
        self._found = True
        if log.end_ns is not None and log.end_ns < log.start_ns:
            log.end_ns = log.last_ns
            log.notes.append("The clock went back: the drive ends with its last message before.")
        self._closing.append((self._log_ns, log))
        self._open = None
        self._rest = DriveLog(BAG, log.end_ns or self._log_ns)

    def _ended_early(self, log: DriveLog) -> DriveLog:
        if log.end_ns is None:
            log.outcome = UNFINISHED
            log.message = "the recording ended before the episode did"
            log.notes.append("The bag ends before the episode does.")
        elif log.end_ns > self._log_ns:
            late = (log.end_ns - self._log_ns) * 1e-9
            log.end_ns = None
            log.notes.append(f"The bag ends {late:.1f} s before the end that the file names.")
        return log

    def _close(self) -> list[Drive]:
        """The drives of which nothing more can come."""
        if not self._closing:
            return []
        due = [log for ended, log in self._closing if self._log_ns - ended > LATE_S * 1e9]
        self._closing = [(e, log) for e, log in self._closing if log not in due]
        return [self._drive(log) for log in due]

    def _drive(self, log: DriveLog) -> Drive:
        return log.close(self._heard, self._detectors)

    def _deal(self, when: int, item: Event | Contact) -> None:
        """Give an event or a contact to the drives within whose time it is."""
        logs = [self._open, self._rest, *(log for _, log in self._closing)]
        for log in logs:
            if log is not None and log.covers(when):
                log.take(when, item)
                log.odom_in_map = self._odom_in_map or log.odom_in_map

    def _take_frames(self, event: Frames) -> None:
        """Keep where the odometry frame is in the map's."""
        for parent, child, at, quaternion in event.transforms:
            names = (parent.split("/")[-1], child.split("/")[-1])
            # where frames bear a robot's name, another robot's are not this one's
            named = "/" in self._odometry_frame
            own = not named or self._odometry_frame == child.lstrip("/")
            tree = FrameTree()
            sensible = names == MAP_FRAMES and own and _within(*at, *quaternion)
            if not sensible or not tree.add(*names, at, quaternion):
                continue
            pose = tree.pose(*names)
            assert pose is not None
            yaw = math.atan2(pose[1, 0], pose[0, 0])
            self._odom_in_map = (float(pose[0, 3]), float(pose[1, 3]), yaw)


def _sensible(event: Event) -> bool:
    """Whether the numbers of an event make sense."""
    if isinstance(event, Pose):
        return _within(event.x, event.y, event.yaw, event.v, event.w)
    if isinstance(event, Truth):
        return _within(event.x, event.y, event.yaw, event.impact_speed, event.shortest_path)
    if isinstance(event, Judged):
        return _within(event.estimate.clearance) and 0 <= event.estimate.probability <= 1
    return not isinstance(event, Decided) or _within(event.detection_score)


def _within(*numbers: float) -> bool:
    return all(abs(number) <= MOST for number in numbers)  # not so if it is not a number
