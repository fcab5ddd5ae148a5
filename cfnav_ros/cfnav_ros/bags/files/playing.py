"""What is played when: recorded messages and node time against the time of the play. Pure.

The rule, so that no log time can hang or hurry the play:

- A message is played at its node time: that of the recorded /clock once there is one, else its log
  time, else (0, as before a recorder has heard of any time) its stamp, else at once.
- Where node time stands, stamps pace the play, and node time stands in the play too.
- A step ahead of more than ``LEAP_NS``, or back of more than ``BACK_NS``, takes no time: node time
  is set, as it was for who listened. If the next message takes the step back again, the one that
  strayed is played at once instead, and node time goes on.
- A smaller step back is disorder: that message is played at once.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import tyro

from cfnav_ros.bags.files.message_types import MessageTypes
from cfnav_ros.bags.files.reading import SORTED_NS, Bag
from cfnav_ros.bags.files.sources import PlayedTopic
from cfnav_ros.bags.files.storage import BagTopic, Key
from cfnav_ros.drive.fields import stamp_to_ns

LEAP_NS = 10_000_000_000
"""No robot whose sensors are recorded is silent for so long."""

BACK_NS = SORTED_NS
"""Bags are read in order within this."""

LAST_NS = 2**31 * 1_000_000_000
"""The first time that a ROS message cannot hold."""


@dataclass(frozen=True)
class PlayOptions:
    """Play what the sensors of a recorded drive said into a graph on this machine."""

    bag: Annotated[Path, tyro.conf.Positional]
    """Folder of the bag, or its file."""
    topic: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """ROLE:=NAME for a topic that is not found by its usual name or type; may be repeated."""
    names: Literal["usual", "recorded"] = "usual"
    """Names of the live robot, or those in the bag."""
    robot: str = ""
    """The live robot: the name of one that is shipped, or its file; when not given that which the
    bag says has driven, else turtlebot4_mast."""
    namespace: str = ""
    """Put before every name but /clock."""
    rate: float = 1.0
    """Recorded seconds per second; 0 is as fast as it goes, faster than listeners may take."""
    start: float = 0.0
    """Begin so many seconds into the drive."""
    duration: float = math.inf
    """Play so many seconds of it."""
    wait: float = 30.0
    """Wait so long until somebody listens, s; 0 begins at once."""
    wait_for: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Role that somebody must listen to first; may be repeated. Any one when not given."""
    domain: str = "99"
    """ROS domain, never that of the shell."""

    def check(self) -> None:
        """Raise ValueError, one sentence, for an option that makes no sense."""
        for name in ("rate", "start", "wait"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(f"--{name} is {value}, expected a number of at least 0.")
        if not self.duration > 0.0:
            raise ValueError(f"--duration is {self.duration}, expected more than 0.")


class Cue(NamedTuple):
    """What is published at one time of the play.

    Attributes:
        at_ns: since the beginning, at rate 1.
        clock_ns: node time, 0 when unknown.
        source: of the message, None for node time alone.
        data: CDR.
    """

    at_ns: int
    clock_ns: int
    source: PlayedTopic | None = None
    data: bytes = b""


class Pace:
    """Follows the node times of messages by the rule above.

    Attributes:
        at_ns: time of the play.
        node_ns: node time, 0 before the first.
        leaps: steps that took no time.
        strays: messages whose time was not believed.
    """

    def __init__(self) -> None:
        self.at_ns = self.node_ns = 0
        self.leaps = self.strays = 0
        self._stood_ns = 0
        self._since: dict[str, int] = {}

    def move(self, time_ns: int, next_ns: int, name: str, stamp_ns: int) -> None:
        """Go on to the next message.

        Args:
            time_ns: its node time, 0 for none.
            next_ns: that of the message behind it, 0 for none.
            name: of its topic.
            stamp_ns: its stamp, 0 for none.
        """
        ahead = time_ns - self.node_ns
        if not time_ns:
            return
        if not self.node_ns:
            self.node_ns = time_ns
        elif far(ahead) and not (next_ns and far(next_ns - self.node_ns)):
            self.strays += 1
        elif far(ahead):
            self.leaps += 1
            self._set(time_ns)
        elif ahead > 0:
            self.at_ns += max(0, ahead - self._stood_ns)
            self._set(time_ns)
        elif ahead == 0 and stamp_ns:
            stood_ns = stamp_ns - self._since.get(name, stamp_ns)
            if self._stood_ns < stood_ns <= self._stood_ns + LEAP_NS:
                self.at_ns += stood_ns - self._stood_ns
                self._stood_ns = stood_ns
        if stamp_ns:
            self._since.setdefault(name, stamp_ns)

    def _set(self, time_ns: int) -> None:
        self.node_ns, self._stood_ns = time_ns, 0
        self._since.clear()


def far(step_ns: int) -> bool:
    """Whether a step of node time is none that a drive takes."""
    return not -BACK_NS <= step_ns <= LEAP_NS


class _Item(NamedTuple):
    """A message to come; ``source`` is None for one of /clock."""

    time_ns: int
    stamp_ns: int
    name: str
    source: PlayedTopic | None
    data: bytes


class Play:
    """The messages of some topics of a bag, each with its time in the play.

    What cannot be played is named in the notes of the bag.
    """

    def __init__(
        self,
        bag: Bag,
        sources: Iterable[PlayedTopic],
        clock: BagTopic | None = None,
        installed: Mapping[str, str] | None = None,
    ) -> None:
        """Prepare.

        Args:
            bag: open.
            sources: what is played.
            clock: the recorded /clock.
            installed: hashes of the types with which listeners will read the messages.
        """
        self.pace = Pace()
        self._bag, self._clock, self._installed = bag, clock, installed or {}
        self._sources = {source.topic.key: source for source in sources}
        self._types = MessageTypes(bag.notes)
        self._fits: dict[Key, bool] = {}
        self._senseless: Counter[str] = Counter()

    @property
    def count(self) -> int | None:
        """Messages to be played, None when only reading tells."""
        counts = [topic.count for topic in self._bag.topics if topic.key in self._sources]
        known = [count for count in counts if count is not None]
        return sum(known) if len(known) == len(counts) else None

    def cues(self, tick_ns: int) -> Iterator[Cue]:
        """Give everything in order, with node time at least every ``tick_ns`` of the play."""
        pace, due_ns = self.pace, 0
        for item, following in pairwise(chain(self._items(), [None])):
            assert item is not None
            at_ns, node_ns = pace.at_ns, pace.node_ns
            pace.move(item.time_ns, following.time_ns if following else 0, item.name, item.stamp_ns)
            while node_ns and due_ns < pace.at_ns:
                yield Cue(due_ns, min(node_ns + due_ns - at_ns, pace.node_ns))
                due_ns += tick_ns
            yield Cue(pace.at_ns, pace.node_ns, item.source, item.data)
            due_ns = pace.at_ns + tick_ns

    def finish(self) -> list[str]:
        """Note in the bag what was left out; returns sentences about what was played otherwise."""
        for name, count in self._senseless.items():
            self._bag.notes.add(f"{count} messages of {name} make no sense: they are left out.")
        leaps, strays = self.pace.leaps, self.pace.strays
        told = [f"Time leaps in {leaps} places: the play went on at once there."] * (leaps > 0)
        return told + [f"{strays} messages had a stray time: they came at once."] * (strays > 0)

    def _items(self) -> Iterator[_Item]:
        """The messages that make sense, with the time that each has."""
        clock = self._clock.key if self._clock else None
        ticked_ns = 0
        for topic, log_ns, data in self._bag.messages(
            {*self._sources, *([clock] if clock else [])}
        ):
            read = self._types.reader(topic)
            if read is None or not self._suits(topic):
                continue
            try:
                stamp_ns = believed(_stamp(read(data)))
            except Exception:  # damaged bytes fail anywhere in the deserializer, in any way
                self._senseless[topic.name] += 1
                continue
            if topic.key == clock:
                ticked_ns = stamp_ns
            time_ns = ticked_ns or believed(log_ns) or stamp_ns
            yield _Item(time_ns, stamp_ns, topic.name, self._sources.get(topic.key), data)

    def _suits(self, topic: BagTopic) -> bool:
        """Whether listeners here read the bytes as they were meant; a note says when not."""
        if topic.key not in self._fits:
            here = self._installed.get(topic.type)
            self._fits[topic.key] = here is None or here == self._types.hash(topic)
            if not self._fits[topic.key]:
                self._bag.notes.add(
                    f"{topic.name} is left out: its messages have other fields than {topic.type} "
                    "of this machine."
                )
        return self._fits[topic.key]


def cut(cues: Iterable[Cue], start_ns: int, duration_ns: float) -> Iterator[Cue]:
    """Leave out what comes before a start and after a duration.

    What latched topics said before the start comes at the start, as a late listener would get it.
    """
    kept: dict[PlayedTopic, deque[Cue]] = {}
    for cue in cues:
        source = cue.source
        if cue.at_ns < start_ns:
            if source and source.kept:
                kept.setdefault(source, deque(maxlen=source.kept)).append(cue)
            continue
        if cue.at_ns - start_ns > duration_ns:
            return
        for earlier in chain.from_iterable(kept.values()):
            yield earlier._replace(at_ns=0, clock_ns=cue.clock_ns)
        kept.clear()
        yield cue._replace(at_ns=cue.at_ns - start_ns)


def believed(ns: int) -> int:
    """A time in nanoseconds, 0 for one that ROS cannot tell."""
    return ns if 0 < ns < LAST_NS else 0


def _stamp(message: Any) -> int:
    """The stamp of a message, nanoseconds; 0 when it has none."""
    if hasattr(message, "clock"):
        return stamp_to_ns(message.clock)
    if hasattr(message, "transforms"):
        message = message.transforms[0] if message.transforms else None
    return stamp_to_ns(message.header.stamp) if hasattr(message, "header") else 0
