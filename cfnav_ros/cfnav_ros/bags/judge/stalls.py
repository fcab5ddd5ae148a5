"""Contacts inferred from commands and odometry: the base is told to move and does not. Pure.

Three signs, each of the executor's or the watch's own magnitudes:

- **stands**: for ``STALL_S`` the base was told to go one way, and its pose made less than
  ``SLIP_SHARE`` of what the commands promised and stands now;
- **slips**: its wheels turn while its pose stands (``disturbance.Slip``);
- **backs off**: within ``REFLEX_S`` of being told ahead, and never told back, it goes back by more
  than a motion may (``RETREAT`` stalls): the reflex of a base whose bumper was hit.

A base that made no way at all since it was told to move was hindered by something else just as
likely (no power, docked, another controller): that is ``NO_START`` and no collision.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from dataclasses import dataclass, replace
from itertools import pairwise

from cfnav_ros.bags.files.events import Pose, Velocity
from cfnav_ros.bags.judge.contacts import STALL, Contact, Whereabouts
from cfnav_ros.drive.conduct import REFLEX_S
from cfnav_ros.drive.disturbance import SLIP_RAD, SLIP_SHARE, SLIP_WINDOW_S
from cfnav_ros.drive.inputs import AgeLimits
from cfnav_ros.drive.motion import RETREAT, STALL_M, MotionLimits, Odometry, wrap
from cfnav_ros.drive.track import BUMP_GAP_S, DRIFT_V, DRIFT_W, MIN_DT_S, STILL_V, STILL_W, Track

NO_START = "no start"
"""Source of a contact that is none: told to move, and never moved."""

STALL_S = 0.5
"""The executor gives up 1 s after its last 2 cm of way (``stall_time``), of which creeping takes
0.4 s: so long at least it goes on telling a blocked base to move."""

IMPACT_S = 0.5
"""The impact was at most so long before the base stood: it pushes on a little. Nobody told it to
brake."""

COMMAND_S = 0.5
"""A base forgets a command after this time (create3_sim ``motion_control_node.cpp``)."""

STARTED_M, STARTED_RAD = MotionLimits().tolerance_m, math.radians(MotionLimits().tolerance_deg)
"""Way from which a base has started: less is within the tolerance of a motion's end."""

GAP_S, GAP_PERIODS = AgeLimits().odometry, 2.5
"""Odometry that pauses longer, seconds and usual intervals, tells nothing of the time between."""

MOST_COMMANDS = 4096
"""Kept while no odometry comes."""

INTERVALS = 15
"""Intervals whose median is the usual one."""

LEAST = 3
"""Poses that must show a stall, so that one late pose does not: as many lie within a stall of so
many times their spacing, wherever it begins. Of blocks the first and the last need not stand all
the time."""

AGAIN = 1.25
"""A base that was seen to heed a command for some time heeds the next one so many times longer."""

HEEDED = 0.5
"""Share of the ordered speed from which a base heeds its command. One that coasts to rest passes it
half-way, so that with ``AGAIN`` a command counts about as long as the base moves."""

LEAVING = 1.5
"""A base has left a place that is further than so many times what passes for standing."""

SLACK = 1.05
"""Periods and gaps are known to about this factor."""


@dataclass(frozen=True)
class SteadyCommand:
    """One way that the base is told to go without a pause: ``turns`` or drives, ``side`` +1, -1."""

    turns: bool
    side: int
    since: float

    def way(self, a: Odometry, b: Odometry) -> float:
        """Way made in the sense of the order between two samples: metres or radians."""
        if self.turns:
            return self.side * wrap(b.yaw - a.yaw)
        return self.side * ((b.x - a.x) * math.cos(a.yaw) + (b.y - a.y) * math.sin(a.yaw))


class StallContacts:
    """Follows commands and odometry; times in nanoseconds, of one clock."""

    def __init__(self, block_s: float = 0.0) -> None:
        """Know nothing yet; ``block_s``: over which the odometry is averaged, seconds."""
        self._started_m = max(STARTED_M, DRIFT_V * block_s)
        self._started_rad = max(STARTED_RAD, DRIFT_W * block_s)
        self._left_m = max(STALL_M, LEAVING * DRIFT_V * block_s)
        self._intervals: deque[float] = deque(maxlen=INTERVALS)
        self._gaps: deque[float] = deque(maxlen=INTERVALS)
        self._heeded_s = 0.0
        self._track = Track()
        self._poses: deque[Odometry] = deque()
        # (seconds, rate as ordered)
        self._commands: deque[tuple[float, float]] = deque(maxlen=MOST_COMMANDS)
        self._order: SteadyCommand | None = None
        self._started = False
        self._begin: Odometry | None = None
        self._moved_at = -math.inf
        self._held: Odometry | None = None
        self._counted_at = -math.inf
        self._ahead_at = -math.inf
        self._foremost: tuple[Odometry, bool] | None = None  # (pose, held there already)

    def told(self, t_ns: int, velocity: Velocity) -> None:
        """Take the next command."""
        t, v, w = t_ns * 1e-9, velocity.v, velocity.w
        if not (math.isfinite(v) and math.isfinite(w)):
            v = w = 0.0  # so the base takes it
        if v >= STILL_V:
            self._ahead_at = t
        elif v <= -STILL_V:
            self._ahead_at, self._foremost = -math.inf, None
        gap = t - self._commands[-1][0] if self._commands else 0.0
        turns = abs(v) < STILL_V
        rate = w if turns else v
        if turns and abs(w) < STILL_W:
            self._drop()
            return
        side, order = (1 if rate > 0 else -1), self._order
        same = order is not None and (order.turns, order.side) == (turns, side)
        if same:
            self._gaps.append(gap)
        if not same or gap > self._memory_s:
            self._drop()
            self._order = SteadyCommand(turns, side, t)
        self._commands.append((t, abs(rate)))

    @property
    def _memory_s(self) -> float:
        """How long the base heeds a command: some forget it, some go on until the next."""
        seen = AGAIN * self._heeded_s + self._usual_s if self._heeded_s else 0.0
        return max(COMMAND_S, seen)

    @property
    def _usual_s(self) -> float:
        """Usual time between two samples."""
        return statistics.median_low(self._intervals) if self._intervals else 0.0

    @property
    def slow_commands_s(self) -> float:
        """Usual time between two commands of one way where the base forgets them before; else 0."""
        usual = statistics.median_low(self._gaps) if self._gaps else 0.0
        return usual if usual > SLACK * self._memory_s else 0.0

    def moved(self, t_ns: int, pose: Pose, where: Whereabouts) -> Contact | None:
        """Take the next odometry; a contact when it shows one, stamped when it last moved."""
        sample = Odometry(t_ns * 1e-9, pose.x, pose.y, pose.yaw, pose.v, pose.w)
        before = self._poses[-1] if self._poses else None
        if before and sample.stamp == before.stamp:
            return None
        paused = before is not None and self._pauses(sample.stamp - before.stamp)
        if not self._track.odometry(sample) or paused:
            self._restart(sample.stamp)
        elif before and _moves(before, sample):
            self._moved_at = sample.stamp
            self._note_heeding(before, sample)
        self._poses.append(sample)
        while len(self._poses) > LEAST and sample.stamp - self._poses[0].stamp > STALL_S:
            self._poses.popleft()
        while len(self._commands) > 1 and self._commands[1][0] <= self._poses[0].stamp:
            self._commands.popleft()
        self._note_start(sample)
        self._release(sample)
        if self._backs_off(sample):
            return self._contact(sample, STALL, where)
        if self._held is None and self._stands(sample):
            return self._contact(sample, STALL if self._started else NO_START, where)
        return None

    def _contact(self, sample: Odometry, source: str, where: Whereabouts) -> Contact | None:
        """The contact at a sample; it is held until the base has left the place.

        None when it is too near in time to the contact before: the base slides along what it
        touches.
        """
        self._held = sample
        t = self._moved_at if math.isfinite(self._moved_at) else sample.stamp
        slid, self._counted_at = t - self._counted_at <= BUMP_GAP_S, t
        if slid:
            return None
        return where.contact(round(t * 1e9), source, before=IMPACT_S)

    def _drop(self) -> None:
        """The base is not told to go on as it was."""
        self._order, self._begin, self._started = None, None, False
        self._commands.clear()

    def _pauses(self, interval: float) -> bool:
        """Whether the odometry paused so long before this sample, or went back in time."""
        if interval > 0:
            self._intervals.append(interval)
        return not 0 < interval <= max(GAP_S, GAP_PERIODS * self._usual_s)

    def _note_heeding(self, before: Odometry, sample: Odometry) -> None:
        """Learn how long the base heeds a command, from one that was left without a next."""
        order = self._order
        if order is None or not self._commands:
            return
        told, rate = self._commands[-1]
        age, dt = sample.stamp - told, sample.stamp - before.stamp
        if age > COMMAND_S and order.way(before, sample) >= HEEDED * rate * dt:
            self._heeded_s = max(self._heeded_s, age)

    def _restart(self, t: float) -> None:
        """What was before tells nothing of what comes."""
        self._poses.clear()
        self._track = Track()
        self._foremost = self._begin = self._held = None
        if self._order:
            self._order = replace(self._order, since=t)

    def _note_start(self, sample: Odometry) -> None:
        order = self._order
        if order is None or sample.stamp < order.since:
            return
        self._begin = self._begin or sample
        least = self._started_rad if order.turns else self._started_m
        self._started = self._started or order.way(self._begin, sample) >= least

    def _release(self, sample: Odometry) -> None:
        """A base that has left the place of its last contact may have another."""
        held = self._held
        if held is None:
            return
        away = math.hypot(sample.x - held.x, sample.y - held.y)
        turning = self._order is not None and self._order.turns
        if away >= self._left_m or (turning and abs(wrap(sample.yaw - held.yaw)) >= SLIP_RAD):
            self._held = None

    def _backs_off(self, sample: Odometry) -> bool:
        if sample.stamp - self._ahead_at > REFLEX_S:
            self._foremost = None
            return False
        foremost = self._foremost
        if foremost is None:
            # A base that was told back before still rolls back.
            self._foremost = (sample, self._held is not None) if sample.v > -STILL_V else None
            return False
        pose, held = foremost
        ahead = SteadyCommand(False, 1, 0.0).way(pose, sample)
        if ahead >= 0:
            self._foremost = (sample, self._held is not None)
        if ahead > -RETREAT * self._left_m:
            return False
        self._foremost, self._ahead_at = None, -math.inf
        self._moved_at = pose.stamp
        return not held

    def _stands(self, sample: Odometry) -> bool:
        order, t = self._order, sample.stamp
        if order is None or not self._commands or t - self._commands[-1][0] > self._memory_s:
            return False
        if t - order.since < SLIP_WINDOW_S or len(self._poses) < LEAST or self._moved_at >= t:
            return False
        recent = [p for p in self._poses if p.stamp >= max(order.since, t - SLIP_WINDOW_S)]
        slow = len(recent) < LEAST
        if slow:
            recent = [p for p in self._poses if p.stamp >= order.since][-LEAST:]
        if len(recent) < LEAST or _frozen(recent):
            return False
        still = not any(_moves(a, b) for a, b in pairwise(recent))
        if self._started and (still or not slow) and self._track.slip.complaint():
            return True
        oldest = self._poses[0]
        promised = self._promised(max(order.since, oldest.stamp), t)
        least = SLIP_RAD if order.turns else STALL_M
        if t - order.since < STALL_S or promised < least:
            return False
        return still and order.way(oldest, sample) < SLIP_SHARE * promised

    def _promised(self, begin: float, end: float) -> float:
        """Way that the commands promise between two times, metres or radians."""
        total = 0.0
        ends = [*[t for t, _ in self._commands][1:], end]
        for (t, rate), until in zip(self._commands, ends, strict=True):
            total += rate * max(min(until, end) - max(t, begin), 0.0)
        return total


def _moves(a: Odometry, b: Odometry) -> bool:
    """Whether the pose moved between two samples."""
    dt = max(b.stamp - a.stamp, MIN_DT_S)
    way = math.hypot(b.x - a.x, b.y - a.y)
    return way >= DRIFT_V * dt or abs(wrap(b.yaw - a.yaw)) >= DRIFT_W * dt


def _frozen(samples: list[Odometry]) -> bool:
    """Whether odometry repeats itself to the last bit while it says that it moves."""
    kinds = {(p.x, p.y, p.yaw, p.v, p.w) for p in samples}
    claims = any(abs(p.v) >= STILL_V or abs(p.w) >= STILL_W for p in samples)
    return len(kinds) == 1 and claims
