"""A bag -> raw messages and events, in the order of their log times, as a stream.

A damaged bag never raises: what is whole is read, what is not is named in ``Bag.notes``. Memory
does not grow with the bag: one chunk is unpacked at a time, ``SORTED_NS`` are held to be sorted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Generator, Iterator
from dataclasses import replace
from heapq import heappop, heappush
from pathlib import Path
from typing import Any

from cfnav_ros.bags.files.decode import TILT_JOINT, WITH_EVENTS, decode
from cfnav_ros.bags.files.events import Event, Unreadable
from cfnav_ros.bags.files.finding import BagError, all_parts, natural, packed_once
from cfnav_ros.bags.files.mcap_file import McapFile
from cfnav_ros.bags.files.message_types import MessageTypes
from cfnav_ros.bags.files.metadata import METADATA, Metadata, read_metadata
from cfnav_ros.bags.files.roles import Roles, assign
from cfnav_ros.bags.files.sqlite_file import SqliteFile
from cfnav_ros.bags.files.storage import (
    DAMAGE,
    MAX_MESSAGE,
    BagTopic,
    Key,
    Notes,
    Raw,
    Storage,
    unzip,
)

SORTED_NS = 500_000_000
"""Messages are written a little out of order, as several threads hand them over. Log times that go
back further are another clock's, or a simulation that was started again: sorting would mix what
happened at different times."""

HELD_BYTES = 32 * 2**20
"""Sorting holds no more than this, whatever was recorded."""

_ZSTD = b"\x28\xb5\x2f\xfd"
"""How a compressed message begins; CDR begins with a zero."""


class Bag:
    """A recorded drive; its storage files are opened one after the other, and only to be read.

    Attributes:
        path: folder or file.
        topics: as the bag's index or its metadata has them.
        custom: what the recorder added to the metadata.
        notes: sentences about what could not be read; more come while it is read.
        read: messages that were read so far.
    """

    def __init__(self, path: Path | str) -> None:
        """Find out what a bag holds.

        Args:
            path: a bag's folder or file, as ``find_bags`` gives them.

        Raises:
            BagError: there is nothing.
        """
        self.path = path = Path(path)
        self.notes = Notes()
        self.read = 0
        self._reading: list[Generator[Any, None, None]] = []
        self._split = "*" in path.name and not path.exists()
        if not (self._split or path.exists()):
            raise BagError(f"{path} does not exist, expected a bag.")
        folder = path.parent if self._split else path
        metadata = read_metadata(folder, self.notes) if folder.is_dir() else Metadata()
        self.custom = metadata.custom
        self._files = self._storages(metadata)
        self.topics = self._topics(metadata)
        if not self._files:
            self.notes.add(f"{path} holds no file that could be read.")
        elif not self.topics:
            self.notes.add(f"{path} holds no topic.")

    def __repr__(self) -> str:
        return f"<Bag {self.path}: {len(self.topics)} topics>"

    def __iter__(self) -> Iterator[Event]:
        """``events`` of the topics that are found by their usual names and types."""
        return self.events(assign(self.topics))

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        for generator in self._reading:
            generator.close()

    @property
    def begin_ns(self) -> int:
        """Log time of the first message, whatever its topic, nanoseconds; 0 of an empty bag."""
        reading = self._in_order(self._read(None))
        first = next((raw.log_ns for raw in reading), 0)
        reading.close()
        return first

    @property
    def unchecked(self) -> int:
        """Messages read that no checksum protects: damage within them goes unnoticed."""
        return sum(file.unchecked for file in self._files)

    def messages(self, wanted: Collection[Key] | None = None) -> Iterator[Raw]:
        """Read the messages in the order of their log times.

        Args:
            wanted: names and types of the topics, None for all.

        Yields:
            Messages as they were published, unpacked if they were packed one by one. Where log
            times go back by more than ``SORTED_NS`` the order is that of recording.
        """
        reading = self._in_order(self._read(wanted))
        self._reading.append(reading)
        return reading

    def events(self, roles: Roles, tilt_joint: str = TILT_JOINT) -> Iterator[Event]:
        """Read the events in the order of their log times.

        Args:
            roles: which topic is what.
            tilt_joint: name of the camera's tilt in joint_states.

        Yields:
            Events; ``Unreadable`` for every message that makes no sense.
        """
        types = MessageTypes(self.notes)
        role_of = {t.key: role for role, t in roles.topics.items() if role in WITH_EVENTS}
        senseless: Counter[str] = Counter()
        first: dict[str, str] = {}
        for topic, log_ns, data in self.messages(role_of):
            read = types.reader(topic)
            if read is None:
                continue
            event = decode(role_of[topic.key], topic, log_ns, data, read, tilt_joint)
            if isinstance(event, Unreadable):
                senseless[topic.name] += 1
                first.setdefault(topic.name, event.reason)
            if event is not None:
                yield event
        for name, count in senseless.items():
            self.notes.add(f"{count} messages of {name} make no sense, the first: {first[name]}")

    def _storages(self, metadata: Metadata) -> list[Storage]:
        """The files of the bag in the order of recording."""
        folder = self.path.parent if self._split else self.path
        if not folder.is_dir():
            return [_storage(self.path, self.notes)]
        try:
            here = packed_once(p.name for p in folder.iterdir() if p.is_file())
        except OSError as error:
            self.notes.add(f"{folder} cannot be read: {error}.")
            return []
        if self._split:
            here = {name for name in here if all_parts(name) == self.path.name}
        listed = []
        for name in metadata.files:
            if found := {name, name.removesuffix(".zstd")} & here:
                listed.append(found.pop())
            else:
                self.notes.add(f"{self.path} lacks {name}, which its {METADATA} lists.")
        others = sorted((name for name in here if name not in listed), key=natural)
        parts = {all_parts(name) for name in listed}
        more = [name for name in others if "*" in all_parts(name) and all_parts(name) in parts]
        if more:  # of a recording that broke off after its metadata was written
            listed, others = [*listed, *more], [name for name in others if name not in more]
        if listed and others:
            left = ", ".join(others)
            self.notes.add(
                f"{self.path} holds {left}, which its {METADATA} does not list: left out."
            )
        files = [_storage(folder / name, self.notes) for name in listed or others]
        if listed or len(files) == 1:
            return files
        return sorted(files, key=_first_ns)

    def _topics(self, metadata: Metadata) -> tuple[BagTopic, ...]:
        """The topics of all files, each with the number of its messages where it is known.

        What the files say themselves counts; the metadata stands in for what they do not say.
        """
        listed = {topic.key: topic for topic in metadata.topics if metadata.counted}
        found: dict[Key, BagTopic] = {}
        counts: Counter[Key] = Counter()
        for file in self._files:
            topics = file.topics()
            if topics is None and listed:  # the metadata counts the whole bag
                topics = [replace(topic, count=None) for topic in metadata.topics]
            elif topics is None:
                topics = _read_through(file)
            for topic in topics:
                counts[topic.key] += topic.count or 0
                before = found.get(topic.key, topic)
                unknown = None in (topic.count, before.count)
                found[topic.key] = replace(topic, count=None if unknown else counts[topic.key])
        # Where more is listed than the files know of, some of it is lost.
        least = {key: max(counts[key], topic.count or 0) for key, topic in listed.items()}
        return tuple(
            replace(topic, count=least[key]) if key in least else topic
            for key, topic in found.items()
        )

    def _read(self, wanted: Collection[Key] | None) -> Iterator[Raw]:
        """Read the files one after the other, and unpack messages that were packed one by one."""
        read, damaged = Counter[Key](), Counter[str]()
        self.read = 0
        for file in self._files:
            for raw in file.messages(wanted):
                read[raw.topic.key] += 1
                self.read += 1
                if not raw.data.startswith(_ZSTD):
                    yield raw
                    continue
                try:
                    yield raw._replace(data=unzip(raw.data, MAX_MESSAGE))
                except DAMAGE:
                    damaged[raw.topic.name] += 1
        for name, count in damaged.items():
            self.notes.add(f"{count} messages of {name} cannot be unpacked: they are left out.")
        self._compare(read, wanted)

    def _compare(self, read: Counter[Key], wanted: Collection[Key] | None) -> None:
        """Name what the bag says that it holds and what was not found, and the other way round."""
        for topic in self.topics:
            if topic.count is None or not (wanted is None or topic.key in wanted):
                continue
            count = read[topic.key]
            if count < topic.count:
                self.notes.add(f"{count} of {topic.count} messages of {topic.name} could be read.")
            elif count and not topic.count:
                self.notes.add(f"{topic.name} holds {count} messages, none by {METADATA}.")
        known = {topic.key for topic in self.topics}
        for file in self._files:
            for name, kind in sorted(file.declared.keys() - known):
                self.notes.add(f"{file.path.name} holds {name} ({kind}), which no index lists.")

    def _in_order(self, raws: Iterator[Raw]) -> Generator[Raw, None, None]:
        """Sort by log time as far as ``SORTED_NS`` and ``HELD_BYTES`` reach."""
        held: list[tuple[int, int, Raw]] = []
        size, newest_ns = 0, -(2**63)
        for number, raw in enumerate(raws):
            if raw.log_ns < newest_ns - SORTED_NS:
                self.notes.add(
                    f"Log times of {self.path} leap back: another clock or another run. Messages "
                    "come in the order of recording there."
                )
                yield from _emptied(held)
                size, newest_ns = 0, raw.log_ns
            newest_ns = max(newest_ns, raw.log_ns)
            heappush(held, (raw.log_ns, number, raw))
            size += len(raw.data)
            while held and (size > HELD_BYTES or held[0][0] < newest_ns - SORTED_NS):
                oldest = heappop(held)[2]
                size -= len(oldest.data)
                yield oldest
        yield from _emptied(held)


def _emptied(held: list[tuple[int, int, Raw]]) -> Iterator[Raw]:
    """What a heap of messages holds, the oldest first."""
    while held:
        yield heappop(held)[2]


def _storage(path: Path, notes: Notes) -> Storage:
    """A storage file by the end of its name."""
    kind = McapFile if path.name.removesuffix(".zstd").endswith(".mcap") else SqliteFile
    return kind(path, notes)


def _first_ns(file: Storage) -> int:
    """Log time of the first message that can be read; a file without any comes last."""
    messages = file.messages(None)
    return next((raw.log_ns for raw in messages), 2**64)


def _read_through(file: Storage) -> list[BagTopic]:
    """The topics of a file that has no index."""
    counts = Counter(raw.topic.key for raw in file.messages(None))
    return [replace(topic, count=counts[key]) for key, topic in file.declared.items()]
