"""Paths -> bags -> raw messages and events, in the order of their log times, as a stream.

A damaged bag never raises: what is whole is read, what is not is named in ``Bag.notes``. Memory
does not grow with the bag: one chunk is unpacked at a time, ``SORTED_NS`` are held to be sorted.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from pathlib import Path
from types import TracebackType
from typing import Any

from cfnav_ros.bags.decode import TILT_JOINT, WITH_EVENTS, decode
from cfnav_ros.bags.events import Event, Unreadable
from cfnav_ros.bags.mcap_file import McapFile
from cfnav_ros.bags.message_types import MessageTypes
from cfnav_ros.bags.metadata import METADATA, Metadata, read_metadata
from cfnav_ros.bags.roles import Roles
from cfnav_ros.bags.sqlite_file import SqliteFile
from cfnav_ros.bags.storage import DAMAGE, MAX_MESSAGE, Key, Notes, Raw, Storage, Topic, unzip

SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")

SORTED_NS = 500_000_000
"""Messages are written a little out of order, as several threads hand them over. Log times that go
back further are another clock's, or a simulation that was started again: sorting would mix what
happened at different times."""

HELD_BYTES = 32 * 2**20
"""Sorting holds no more than this, whatever was recorded."""

_ZSTD = b"\x28\xb5\x2f\xfd"
"""How a compressed message begins; CDR begins with a zero."""


class BagError(Exception):
    """There is no bag; the text is one sentence."""


def find_bags(paths: Iterable[Path]) -> list[Path]:
    """Find the bags in files and folders.

    Args:
        paths: bags (a folder with ``metadata.yaml`` or storage files, or one such file), or
            folders to be searched.

    Returns:
        The bags in the order of the paths, those within one sorted by name, each once: a folder,
        a file, or for one of several bags of a folder that is split ``NAME_*.mcap``.

    Raises:
        BagError: a path does not exist, or holds no bag.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if not path.exists():
            raise BagError(f"{path} does not exist, expected a bag or a folder with bags.")
        single = path.is_file() and path.name.endswith(SUFFIXES)
        bags = _bags_in(path) if path.is_dir() else [path] * single
        if not bags:
            raise BagError(
                f"{path} is no bag and holds none: expected {METADATA}, {' or '.join(SUFFIXES)}."
            )
        found.update(dict.fromkeys(bags))
    return list(found)


def unique_names(bags: Sequence[Path]) -> list[str]:
    """Name each bag by as much of the end of its path as tells it from the others.

    Args:
        bags: different ones.
    """
    parts = [path.absolute().parts for path in bags]
    names = []
    for mine in parts:
        others = [other for other in parts if other != mine]
        ends = range(1, len(mine) + 1)
        size = next(n for n in ends if all(other[-n:] != mine[-n:] for other in others))
        names.append(str(Path(*mine[-size:])))
    return names


def _bags_in(folder: Path) -> list[Path]:
    """The bags in a folder; one with metadata is a bag itself and is not searched further."""
    bags = []
    for here, folders, files in os.walk(folder):
        folders.sort(key=_natural)
        if METADATA in files:
            bags.append(Path(here))
            folders.clear()
            continue
        groups: dict[str, list[str]] = {}
        for name in sorted(_packed_once(files), key=_natural):
            groups.setdefault(_all_parts(name), []).append(name)
        if len(groups) == 1 and not folders:  # the folder of a bag that lacks its metadata
            bags.append(Path(here))
            continue
        for pattern, names in groups.items():
            bags.append(Path(here, names[0] if len(names) == 1 else pattern))
    return bags


def _packed_once(names: Iterable[str]) -> set[str]:
    """The storage files among names, without those that somebody has unpacked beside them."""
    here = {name for name in names if name.endswith(SUFFIXES)}
    return here - {f"{name}.zstd" for name in here}


def _all_parts(name: str) -> str:
    """``NAME_*.mcap`` for a file that is named as a part of a split bag, else its own name."""
    whole = name.removesuffix(".zstd")
    return re.sub(r"_\d+(?=\.(mcap|db3)$)", "_*", whole)


def _natural(name: str) -> list[tuple[int, str]]:
    """A sorting key that puts part 10 behind part 9."""
    return [(int(digits or 0), text) for text, digits in re.findall(r"(\D*)(\d*)", name)]


class Bag:
    """A recorded drive; its storage files are opened one after the other, and only to be read.

    Attributes:
        path: folder or file.
        topics: as the bag's index or its metadata has them.
        notes: sentences about what could not be read; more come while it is read.
        read: messages that were read so far.
    """

    def __init__(self, path: Path) -> None:
        """Find out what a bag holds.

        Args:
            path: one of those that ``find_bags`` gives.
        """
        self.path = path
        self.notes = Notes()
        self.read = 0
        self._reading: list[Generator[Any, None, None]] = []
        self._split = "*" in path.name and not path.exists()
        folder = path.parent if self._split else path
        metadata = read_metadata(folder, self.notes) if folder.is_dir() else Metadata()
        self._files = self._storages(metadata)
        self.topics = self._topics(metadata)
        if not self._files:
            self.notes.add(f"{path} holds no file that could be read.")
        elif not self.topics:
            self.notes.add(f"{path} holds no topic.")

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for generator in self._reading:
            generator.close()

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
            here = _packed_once(p.name for p in folder.iterdir() if p.is_file())
        except OSError as error:
            self.notes.add(f"{folder} cannot be read: {error}.")
            return []
        if self._split:
            here = {name for name in here if _all_parts(name) == self.path.name}
        listed = []
        for name in metadata.files:
            if found := {name, name.removesuffix(".zstd")} & here:
                listed.append(found.pop())
            else:
                self.notes.add(f"{self.path} lacks {name}, which its {METADATA} lists.")
        others = sorted((name for name in here if name not in listed), key=_natural)
        if listed and others:
            left = ", ".join(others)
            self.notes.add(
                f"{self.path} holds {left}, which its {METADATA} does not list: left out."
            )
        files = [_storage(folder / name, self.notes) for name in listed or others]
        if listed or len(files) == 1:
            return files
        return sorted(files, key=_first_ns)

    def _topics(self, metadata: Metadata) -> tuple[Topic, ...]:
        """The topics of all files, each with the number of its messages where it is known."""
        known = {topic.key: topic for topic in metadata.topics}
        found: dict[Key, Topic] = {}
        for file in self._files:
            topics = file.topics(counted=not known)
            if topics is None and known:  # the metadata counts the whole bag, so only once
                topics = [topic for key, topic in known.items() if key not in found]
            elif topics is None:
                topics = _read_through(file)
            for topic in topics:
                before = found.get(topic.key)
                if before and before.count is not None and topic.count is not None:
                    topic = replace(topic, count=before.count + topic.count)
                found[topic.key] = topic
        return tuple(
            replace(topic, count=known[key].count) if key in known else topic
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
            listed = topic.count is not None and (wanted is None or topic.key in wanted)
            if listed and read[topic.key] != topic.count:
                self.notes.add(
                    f"{read[topic.key]} of {topic.count} messages of {topic.name} could be read."
                )
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


def _read_through(file: Storage) -> list[Topic]:
    """The topics of a file that has no index."""
    counts = Counter(raw.topic.key for raw in file.messages(None))
    return [replace(topic, count=counts[key]) for key, topic in file.declared.items()]
