"""Watches the messages of one topic: rate, gaps, stamps, repetitions, reasons.

Memory is bounded: only so many intervals and reasons are kept, the rest is counted. Pure.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

from cfnav_ros.bags.files.events import (
    Bumps,
    Decided,
    Event,
    Joint,
    Judged,
    LaserTurn,
    Picture,
    Pose,
    Tick,
    Truth,
    Unreadable,
    Velocity,
)
from cfnav_ros.bags.health.frozen import Frozen
from cfnav_ros.bags.judge.clocks import LOOKED_AT, OTHER_CLOCK_S, Clocks
from cfnav_ros.bags.replay.estimates import TOPIC as MADE_AGAIN
from cfnav_ros.drive.inputs import AgeLimits
from cfnav_ros.lidar.estimate import Verdict
from cfnav_ros.robot.stamps import FUTURE_S

_AGES = AgeLimits()
LIMITS_S: dict[type[Event], float] = {
    Picture: _AGES.frame,
    LaserTurn: _AGES.estimate,
    Judged: _AGES.estimate,
    Pose: _AGES.odometry,
    Joint: _AGES.tilt,
}
"""Longest time without a message, or oldest message, that the nodes act on by default, seconds,
whatever the parameters of the robot. Other topics speak when something happens, so silence is no
gap in them."""

EDGE_S = 1.0
"""Nodes and recorder start and end one after the other: silence at the beginning and the end of a
bag is no gap for so long."""

ORDERED = (Picture, LaserTurn, Pose, Joint)
"""What has one publisher and new stamps in every message."""

MOST_REASONS = 24
"""Different reasons kept of a topic; others are counted together."""

OTHERS = "other reasons"

MOST_INTERVALS = 48
"""Intervals kept of a kind and topic; the rest is counted."""

JOIN_S = 1.0
"""Intervals less than this apart are one: a report of each dropped message helps nobody."""

STAMPED = (*LIMITS_S, Truth, Decided, Bumps, Velocity)
"""What is stamped when it is made; latched topics tell late listeners of long ago."""


@dataclass
class Interval:
    """From ``start`` to ``end``, s from the start of the bag, with ``count`` occasions.

    ``low`` and ``high`` are the least and the greatest size of an occasion, whatever is measured.
    """

    start: float
    end: float
    low: float = 0.0
    high: float = 0.0
    count: int = 1

    @property
    def seconds(self) -> float:
        """How long it is."""
        return self.end - self.start


class Intervals:
    """Merges intervals that come in the order of their ends.

    Attributes:
        kept: the first of them.
        more: how many came after those.
    """

    def __init__(self, most: int = MOST_INTERVALS, join: float = JOIN_S) -> None:
        self.kept: list[Interval] = []
        self.more = 0
        self._most, self._join = most, join
        self._last: Interval | None = None

    def add(self, start: float, end: float, size: float = 0.0) -> None:
        """Take the next, seconds, and its size."""
        last = self._last
        if last is not None and start - last.end <= self._join:
            last.end, last.count = max(end, last.end), last.count + 1
            last.low, last.high = min(size, last.low), max(size, last.high)
            return
        self._last = Interval(start, end, size, size)
        if len(self.kept) < self._most:
            self.kept.append(self._last)
        else:
            self.more += 1


@dataclass
class TopicHealth:
    """Figures of one topic.

    Attributes:
        topic: its name in the bag.
        kind: of its events, such as ``Picture``.
        messages: how many.
        first: log time of the first, s from the start of the bag; ``last`` likewise.
        longest_gap: between two messages, s of log time; of a topic with a limit also between one
            and the beginning or the end of the bag, where that is a finding.
        verdicts: s of time that the estimates of each verdict held, for a topic of estimates.
    """

    topic: str
    kind: str
    messages: int = 0
    first: float = math.nan
    last: float = math.nan
    longest_gap: float = 0.0
    verdicts: dict[str, float] = field(default_factory=dict)

    @property
    def rate(self) -> float | None:
        """Mean rate from the first to the last, messages a second; None with fewer than two."""
        lasted = self.last - self.first
        return (self.messages - 1) / lasted if self.messages > 1 and lasted > 0 else None


@dataclass
class Reason:
    """Messages for one reason: ``text`` is that of the first; ``start`` and ``end`` in seconds."""

    text: str
    start: float
    end: float
    count: int = 0
    seconds: float = 0.0


class TopicWatch:
    """One topic.

    Attributes:
        figures: its figures so far.
        found: intervals by kind of finding (``health.TREATED``).
        reasons: by (blind, degraded or unreadable; reason without its numbers).
    """

    def __init__(self, topic: str, kind: type[Event]) -> None:
        self.figures = TopicHealth(topic, kind.__name__)
        self.found: dict[str, Intervals] = {}
        self.reasons: dict[tuple[str, str], Reason] = {}
        self._clocks = Clocks()
        self._limit = LIMITS_S.get(kind)
        # estimates made again have node times; the scans tell of their silence
        self._edged = self._limit is not None and topic != MADE_AGAIN
        self._ordered = kind in ORDERED
        self._stamped = kind in STAMPED
        self._frozen = Frozen()
        self._stamp_ns: int | None = None
        self._verdict: tuple[float, str, Reason | None] | None = None

    def see(self, t: float, event: Event, pose: Pose | None) -> None:
        """Take the next message.

        Args:
            t: its log time, s from the start of the bag.
            event: what it holds.
            pose: newest odometry.
        """
        figures = self.figures
        before = figures.last
        figures.messages += 1
        if event.log_ns > 0:
            self._rate(t)
        if self._stamped:
            self._stamp(t, before if math.isfinite(before) else t, event)
        if isinstance(event, Picture):
            self._repeats("frozen pictures", t, event, event.data, pose)
        elif isinstance(event, LaserTurn):
            self._repeats("frozen scans", t, event, event.scan.ranges, pose)
        elif isinstance(event, Judged):
            self._judge(t, event)
        elif isinstance(event, Unreadable):
            self._reason("unreadable", event.reason, t)
        elif isinstance(event, Tick):
            self._order("clock jump", "", t, event.t_ns)

    def edges(self, end: float) -> list[tuple[float, float]]:
        """Silence before the first message and after the last that is too long, from and to, s.

        Args:
            end: of the bag, s from its start.
        """
        figures = self.figures
        if not (self._edged and figures.messages):
            return []
        spoke = math.isfinite(figures.first)
        first, last = (figures.first, figures.last) if spoke else (end, end)
        least = max(self._limit or 0.0, EDGE_S)
        return [(a, b) for a, b in ((0.0, first), (last, end)) if b - a > least]

    def _find(self, kind: str, start: float, end: float, size: float = 0.0) -> None:
        self.found.setdefault(kind, Intervals()).add(start, end, size)

    def _rate(self, t: float) -> None:
        figures = self.figures
        if not math.isfinite(figures.first):
            figures.first = t
        else:
            gap = t - figures.last
            figures.longest_gap = max(figures.longest_gap, gap)
            if self._limit is not None and gap > self._limit:
                self._find("gap", figures.last, t, gap)
        figures.last = t

    def _stamp(self, t: float, before: float, event: Event) -> None:
        if event.t_ns <= 0:
            self._find("unstamped", t, t)
            return
        if self._ordered:
            self._order("backward", "repeated", t, event.t_ns)
        if event.log_ns <= 0:
            return
        usual = self._clocks.behind(event) * 1e-9
        if abs(usual) > OTHER_CLOCK_S and self.figures.messages > LOOKED_AT // 2:
            # An interval goes on while messages come, however seldom.
            start = before if t - before > JOIN_S else t
            self._find("clock", start, t, usual)
        later = (event.log_ns - event.t_ns) * 1e-9 - usual
        if self._limit is not None and later > self._limit:
            self._find("late", t, t, later)
        elif self._limit is not None and later < -FUTURE_S:
            self._find("ahead", t, t, -later)

    def _order(self, back: str, again: str, t: float, stamp_ns: int) -> None:
        before, self._stamp_ns = self._stamp_ns, stamp_ns
        if before is None:
            return
        if stamp_ns < before:
            self._find(back, t, t, (before - stamp_ns) * 1e-9)
        elif stamp_ns == before and again:
            self._find(again, t, t)

    def _repeats(self, kind: str, t: float, event: Event, data: object, pose: Pose | None) -> None:
        since = self._frozen.see(t, event.t_ns, data, pose)
        if since is not None:
            self._find(kind, since, t)

    def _judge(self, t: float, event: Judged) -> None:
        """Take an estimate; one holds until the next, but no longer than it may be old."""
        verdict, reason = event.estimate.verdict, event.estimate.reason
        if self._verdict is not None and self._limit is not None:
            since, name, held = self._verdict
            seconds = min(max(t - since, 0.0), self._limit)
            verdicts = self.figures.verdicts
            verdicts[name] = verdicts.get(name, 0.0) + seconds
            if held is not None:
                held.seconds += seconds
                held.end = max(held.end, since + seconds)
        kept = None
        if verdict is not Verdict.GOOD:
            kept = self._reason(verdict.name.lower(), reason, t)
        self._verdict = (t, verdict.name, kept)

    def _reason(self, kind: str, text: str, t: float) -> Reason:
        """Count a message by its reason; those that differ in numbers only are one."""
        key = (kind, re.sub(r"\d+(\.\d+)?", "#", text))
        if key not in self.reasons and len(self.reasons) >= MOST_REASONS:
            key, text = (kind, OTHERS), OTHERS
        reason = self.reasons.setdefault(key, Reason(text, t, t))
        reason.count += 1
        reason.end = max(reason.end, t)
        return reason
