"""Sensor health of a bag, topic by topic, while its events go by. Pure.

Each finding says what was found, and how the evaluation treats it. Estimates (``Judged``) may be
those that were recorded or replayed ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from cfnav_ros.bags.files.events import Event, Pose
from cfnav_ros.bags.health.topic_watch import Interval, TopicHealth, TopicWatch
from cfnav_ros.bags.replay.estimates import TOPIC as MADE_AGAIN
from cfnav_ros.robot.stamps import FUTURE_S, OTHER_TIME_S

TREATED = {
    "gap": "Nothing is made up for it.",
    "gap of Picture": "Nothing is decided meanwhile, as on the robot.",
    "gap of LaserTurn": "No clearance is taken from it; by default the LiDAR node is BLIND then.",
    "gap of Judged": "No clearance and no contact is taken from it.",
    "gap of Pose": "The way across it counts as straight; stalls are not looked for in it.",
    "silent": "The drives are judged without it.",
    "silent of Judged": "The estimates are made again, as far as there are scans.",
    "silent of Picture": "Nothing can be replayed.",
    "backward": "The messages are used in the order in which they were recorded.",
    "repeated": "The messages are used in the order in which they were recorded.",
    "unstamped": "Their log times are used instead.",
    "late": "Their stamps are used; by default the robot would not have acted on them.",
    "ahead": "Their stamps are used; by default the robot would not have acted on them.",
    "clock": "Log times are used instead of these stamps.",
    "frozen pictures": "They are used as they are; the policy node would stand meanwhile.",
    "frozen scans": "They are used as they are; the LiDAR node calls them BLIND.",
    "blind": "The collision probability is 1 and no clearance is taken.",
    "degraded": "The estimates are used.",
    "unreadable": "The messages are left out.",
    "clock jump": "Log times are used as they are.",
}
"""How the evaluation treats each kind of finding; of gaps by what is missing."""


@dataclass(frozen=True)
class Finding:
    """One thing that is not as it should be.

    Attributes:
        kind: of ``TREATED``; a gap of anything is a ``gap``.
        topic: its name in the bag.
        start: s from the start of the bag; ``end`` likewise.
        text: one sentence.
        treated: one sentence: how the evaluation treats the interval.
        count: messages, or occasions, that it speaks of.
    """

    kind: str
    topic: str
    start: float
    end: float
    text: str
    treated: str
    count: int = 1


class Health:
    """Watches every topic; feed it all events in the order of log times."""

    def __init__(self, silent: Mapping[str, type[Event]] | None = None) -> None:
        """Begin a bag.

        Args:
            silent: kinds of the topics that should speak all the time and hold no message, by name.
        """
        self._begin_ns: int | None = None
        self._end = 0.0
        self._watches = {key: TopicWatch(*key) for key in (silent or {}).items()}
        self._pose: Pose | None = None

    def see(self, event: Event) -> None:
        """Take the next event."""
        if self._begin_ns is None and event.log_ns > 0:
            self._begin_ns = event.log_ns
        if isinstance(event, Pose):
            self._pose = event
        key = (event.topic, type(event))
        watch = self._watches.get(key)
        if watch is None:
            watch = self._watches[key] = TopicWatch(*key)
        t = max(event.log_ns - (self._begin_ns or 0), 0) * 1e-9
        if event.log_ns > 0 and event.topic != MADE_AGAIN:
            self._end = t
        watch.see(t, event, self._pose)

    def topics(self) -> tuple[TopicHealth, ...]:
        """Figures of all topics by name."""
        figures = []
        for watch in self._watches.values():
            quiet = [b - a for a, b in watch.edges(self._end)]
            longest = max(watch.figures.longest_gap, *quiet, 0.0)
            figures.append(replace(watch.figures, longest_gap=longest))
        return tuple(sorted(figures, key=lambda f: f.topic))

    def findings(self) -> tuple[Finding, ...]:
        """All findings so far, in the order of their beginnings."""
        watches = self._watches.values()
        found = [f for watch in watches for f in _of_topic(watch, self._end) if f.kind != "clock"]
        return tuple(sorted([*found, *_clocks(watches)], key=lambda f: (f.start, f.topic, f.kind)))


def _of_topic(watch: TopicWatch, end: float) -> Iterator[Finding]:
    """What one topic shows; ``end`` of the bag, s."""
    figures = watch.figures

    def finding(kind: str, start: float, end: float, text: str, count: int = 1) -> Finding:
        treated = TREATED.get(f"{kind} of {figures.kind}", TREATED[kind])
        return Finding(kind, figures.topic, start, end, text, treated, count)

    for kind, intervals in watch.found.items():
        for i in intervals.kept:
            yield finding(kind, i.start, i.end, _text(kind, i), i.count)
        if intervals.more:
            text = f"{intervals.more} more of these followed."
            yield finding(kind, intervals.kept[-1].end, figures.last, text, intervals.more)
    total = sum(figures.verdicts.values())
    for (kind, _), reason in watch.reasons.items():
        share = f" ({reason.seconds / total:.1%} of the time)" if total > 0 else ""
        text = f"{kind.upper()} for {reason.seconds:.1f} s{share}: {reason.text}"
        if kind == "unreadable":
            text = f"{reason.count} messages cannot be read: {reason.text}"
        yield finding(kind, reason.start, reason.end, text, reason.count)
    if not figures.messages:
        yield finding("silent", 0.0, end, "The topic holds no message.")
    for since, until in watch.edges(end):
        where = "until the bag ends" if until == end else "after the bag begins"
        text = f"No message that could be read for {until - since:.2f} s, {where}."
        yield finding("gap", since, until, text)


def _text(kind: str, i: Interval) -> str:
    """One sentence about an interval."""
    return {
        "gap": f"{i.count} gaps without a message, the longest of {i.high:.2f} s.",
        "backward": f"{i.count} stamps go back, by up to {i.high:.3f} s.",
        "repeated": f"{i.count} messages have the stamp of the one before.",
        "unstamped": f"{i.count} messages have no stamp.",
        "late": f"{i.count} messages came up to {i.high:.2f} s later than usual.",
        "ahead": f"{i.count} stamps are up to {i.high:.2f} s further ahead of the log than usual.",
        "clock": _offset(i),
        "frozen pictures": f"One picture was repeated under new stamps for {i.seconds:.1f} s.",
        "frozen scans": f"One scan was repeated under new stamps for {i.seconds:.1f} s.",
        "clock jump": f"The clock of the topic goes back, by up to {i.high:.2f} s.",
    }[kind]


def _offset(i: Interval) -> str:
    """How the stamps differ from the log times."""
    if i.high - i.low > FUTURE_S:
        return (
            f"The stamps come from another clock than the log times, {i.low:.1f} to {i.high:.1f} s "
            "behind: one of both runs faster, or was set."
        )
    behind = "behind" if i.low > 0 else "ahead of"
    what = " (one is simulated time)" if abs(i.low) > OTHER_TIME_S else ""
    return (
        f"The stamps come from another clock, constantly {abs(i.low):.1f} s {behind} the log "
        f"times{what}."
    )


def _clocks(watches: Iterable[TopicWatch]) -> list[Finding]:
    """Clocks that differ from the log's, topics of the same offset together."""
    groups: list[tuple[Interval, list[str]]] = []
    for watch in watches:
        intervals = watch.found.get("clock")
        for i in intervals.kept if intervals else ():
            for other, topics in groups:
                if abs(other.low - i.low) <= FUTURE_S and abs(other.high - i.high) <= FUTURE_S:
                    other.start, other.end = min(other.start, i.start), max(other.end, i.end)
                    other.count += i.count
                    topics.append(watch.figures.topic)
                    break
            else:
                groups.append((replace(i), [watch.figures.topic]))
    return [
        Finding(
            "clock", ", ".join(dict.fromkeys(topics)), i.start, i.end, _offset(i), TREATED["clock"],
            i.count,
        )
        for i, topics in groups
    ]  # fmt: skip
