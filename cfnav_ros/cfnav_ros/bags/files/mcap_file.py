"""An MCAP file as raw messages, read from front to back; what is damaged is named and left out.

Reading in the order of the file needs no index, so a recording that broke off reads like a whole
one, and no more memory than one chunk. The index at the end serves to know the topics beforehand,
to find the next chunk behind a damaged place, and to count what should be there.

Source: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import IO, cast
from zlib import crc32

import lz4.frame
from backports import zstd

from cfnav_ros.bags.files.storage import (
    DAMAGE,
    MAX_MESSAGE,
    BagTopic,
    Key,
    Notes,
    Raw,
    Storage,
    is_cdr,
    ros_type,
    unzip,
)

MAGIC = b"\x89MCAP0\r\n"
MAX_CHUNK = 4 * MAX_MESSAGE
"""Bytes of a record, and of a chunk when unpacked; recorders write about one million."""

FOOTER_BYTES = 9 + 20 + len(MAGIC)

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
CHUNK_INDEX, STATISTICS, DATA_END = 0x08, 0x0B, 0x0F
LAST, PRIVATE = 0x0F, 0x80
"""Kinds of records beyond ``LAST`` do not exist; from ``PRIVATE`` on they are a writer's own."""

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQII")


@dataclass
class Index:
    """What the end of a file says of it.

    Attributes:
        chunks: offsets of the chunks, ascending.
        topics: by number of the channel, None for one that is not CDR.
        counts: messages by number of the channel, None when the file does not say.
    """

    chunks: list[int] = field(default_factory=list)
    topics: dict[int, BagTopic | None] = field(default_factory=dict)
    counts: dict[int, int] | None = None


class Declared:
    """The schemas and channels met so far."""

    def __init__(self, notes: Notes) -> None:
        self.topics: dict[int, BagTopic | None] = {}
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._notes = notes

    def take(self, kind: int, content: bytes) -> None:
        """Take the content of a record; kinds other than SCHEMA and CHANNEL say nothing here.

        Raises:
            ValueError: its lengths do not fit.
        """
        if kind == SCHEMA:
            (number,) = _unpack("<H", content, 0)
            name, at = _text(content, 2)
            language, at = _text(content, at)
            definition, _ = _text(content, at)
            self._schemas.setdefault(number, (ros_type(name), language, definition))
        elif kind == CHANNEL:
            number, schema = _unpack("<HH", content, 0)
            name, at = _text(content, 4)
            encoding, at = _text(content, at)
            if number in self.topics:
                return
            kind_name, language, definition = self._schemas.get(schema, ("", "", ""))
            qos = _metadata(content, at).get("offered_qos_profiles", "")
            topic = BagTopic(name, kind_name, None, definition, language, qos)
            self.topics[number] = topic if is_cdr(encoding, name, self._notes) else None


class McapFile(Storage):
    """One ``.mcap`` or ``.mcap.zstd``."""

    def topics(self) -> list[BagTopic] | None:
        """The topics by the index; counts need no reading."""
        index = self._index()
        if index is None or not index.topics:
            return None
        counts = index.counts
        return [
            BagTopic(t.name, t.type, None if counts is None else counts.get(number, 0), qos=t.qos)
            for number, t in index.topics.items()
            if t is not None
        ]

    def messages(self, wanted: Collection[Key] | None) -> Iterator[Raw]:
        """What can be read, in the order of the file; None wants all topics."""
        index = self._index() or Index()
        declared, self.unchecked = Declared(self._notes), 0
        try:
            with self._open() as file:
                for at, kind, content in self._records(file, index.chunks):
                    yield from self._of_record(at, kind, content, declared, index, wanted)
        except DAMAGE as error:
            self._note(f"cannot be read: {error}")

    def _of_record(
        self,
        at: int,
        kind: int,
        content: bytes,
        declared: Declared,
        index: Index,
        wanted: Collection[Key] | None,
    ) -> Iterator[Raw]:
        """The messages in one record of the file."""
        try:
            spans: Iterable[tuple[int, int, int]] = [(kind, 0, len(content))]
            checked = False
            if kind == CHUNK:
                content, checked = _unpack_chunk(content)
                spans = _spans(content)
            for inner, start, end in spans:
                if inner != MESSAGE:
                    declared.take(inner, content[start:end])
                    self.declared.update((t.key, t) for t in declared.topics.values() if t)
                    continue
                if end - start < _MESSAGE.size:
                    raise ValueError("a message in it is too short")
                channel, _, log_ns, _ = _MESSAGE.unpack_from(content, start)
                if channel not in declared.topics:
                    if channel not in index.topics:
                        raise ValueError(f"it has a message of channel {channel}, which is unknown")
                    declared.topics[channel] = index.topics[channel]  # named in a damaged chunk
                topic = declared.topics[channel]
                if topic is not None and (wanted is None or topic.key in wanted):
                    self.unchecked += not checked
                    yield Raw(topic, log_ns, content[start + _MESSAGE.size : end])
        except DAMAGE as error:
            what = "chunk" if kind == CHUNK else "record"
            self._note(f"has a damaged {what} at byte {at}, which is left out: {error}")

    def _open(self) -> IO[bytes]:
        return cast(IO[bytes], zstd.open(self.path, "rb") if self._zipped else self.path.open("rb"))

    def _records(self, file: IO[bytes], chunks: list[int]) -> Iterator[tuple[int, int, bytes]]:
        """Offset, kind and content of the records that matter, up to the index or the damage."""
        if file.read(len(MAGIC)) != MAGIC:
            self._note("does not begin like an MCAP file")
        at, size = len(MAGIC), None if self._zipped else self.path.stat().st_size
        while True:
            head = file.read(_RECORD.size)
            if len(head) < _RECORD.size:
                self._note(f"ends at byte {at + len(head)} without an end: the recording broke off")
                return
            kind, length = _RECORD.unpack(head)
            if kind in (FOOTER, DATA_END):
                return
            body = at + _RECORD.size
            fits = length <= MAX_CHUNK and (size is None or body + length <= size)
            if fits and (0 < kind <= LAST or kind >= PRIVATE):
                content = file.read(length)
                if len(content) == length:
                    if kind in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
                        yield at, kind, content
                    at = body + length
                    continue
            found = "cut short" if 0 < kind <= LAST else "damaged"
            later = bisect_right(chunks, at)
            if later == len(chunks):
                self._note(f"is {found} at byte {at}: what follows is lost")
                return
            self._note(f"is damaged at byte {at}: it is read again from byte {chunks[later]}")
            at = chunks[later]
            file.seek(at)

    def _index(self) -> Index | None:
        """What the end of the file says, None when it says nothing or the recording broke off."""
        if self._zipped:
            return None
        try:
            with self.path.open("rb") as file:
                summary = _summary(file)
            return _read_index(summary, self._notes) if summary else None
        except DAMAGE as error:
            self._note(f"has no whole index at its end ({error}): it is read without")
            return None


def _unpack(layout: str, content: bytes, at: int) -> tuple[int, ...]:
    """Numbers at a place of a record."""
    try:
        return struct.unpack_from(layout, content, at)
    except struct.error:
        raise ValueError("a record is shorter than its kind needs") from None


def _text(content: bytes, at: int) -> tuple[str, int]:
    """A string at a place of a record, and the place behind it."""
    (length,) = _unpack("<I", content, at)
    start = at + 4
    if start + length > len(content):
        raise ValueError("a record is shorter than the string in it")
    return content[start : start + length].decode(), start + length


def _metadata(content: bytes, at: int) -> dict[str, str]:
    """A map of strings at a place of a record; empty when it makes no sense."""
    found = {}
    try:
        (length,) = _unpack("<I", content, at)
        at, end = at + 4, at + 4 + length
        while at < end:
            name, at = _text(content, at)
            found[name], at = _text(content, at)
    except ValueError:
        return {}
    return found


def _spans(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Kind, start and end of the records that lie one behind the other.

    Raises:
        ValueError: the length of one does not fit; those before it have been given.
    """
    at, end = 0, len(data)
    while at < end:
        start = at + _RECORD.size
        if start > end:
            raise ValueError("a record in it is cut short")
        kind, length = _RECORD.unpack_from(data, at)
        at = start + length
        if at > end:
            raise ValueError("a record in it is longer than the rest of it")
        yield kind, start, at


def _unpack_chunk(content: bytes) -> tuple[bytes, bool]:
    """The records of a chunk, and whether it has a checksum.

    Raises:
        DAMAGE: it cannot be unpacked, or is not what its checksum says.
    """
    _, _, size, checksum, _ = _unpack("<QQQII", content, 0)
    compression, at = _text(content, _CHUNK.size - 4)
    (length,) = _unpack("<Q", content, at)
    packed = content[at + 8 :]
    if length != len(packed):
        raise ValueError(f"it says that it holds {length} bytes and holds {len(packed)}")
    if size > MAX_CHUNK:
        raise ValueError(f"it says that it unpacks to {size} bytes, expected at most {MAX_CHUNK}")
    if compression == "zstd":
        data = unzip(packed, size)
    elif compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    elif compression == "":
        data = packed
    else:
        raise ValueError(f"it is compressed as {compression!r}, expected zstd or lz4")
    if len(data) != size:
        raise ValueError(f"it unpacks to {len(data)} bytes, expected {size}")
    if checksum and crc32(data) != checksum:
        raise ValueError("its checksum is wrong")
    return data, checksum != 0


def _summary(file: IO[bytes]) -> bytes:
    """The records between data and footer; empty when their writer left them out.

    Raises:
        ValueError: the footer is not whole, or the records are not what its checksum says.
    """
    end = file.seek(0, 2) - FOOTER_BYTES
    if end < len(MAGIC):
        raise ValueError("it is too short for one")
    file.seek(end)
    footer = file.read()
    kind, length = _RECORD.unpack_from(footer)
    start, _, checksum = struct.unpack_from("<QQI", footer, _RECORD.size)
    if (kind, length) != (FOOTER, 20) or not footer.endswith(MAGIC):
        raise ValueError("it does not end like an MCAP file")
    if start == 0:
        return b""
    if not len(MAGIC) < start <= end or end - start > MAX_CHUNK:
        raise ValueError(f"it would begin at byte {start}")
    file.seek(start)
    summary = file.read(end - start)
    if checksum and crc32(footer[: _RECORD.size + 16], crc32(summary)) != checksum:
        raise ValueError("its checksum is wrong")
    return summary


def _read_index(summary: bytes, notes: Notes) -> Index:
    """Read the index from the records before the footer."""
    index, declared = Index(), Declared(notes)
    for kind, start, end in _spans(summary):
        content = summary[start:end]
        declared.take(kind, content)
        if kind == CHUNK_INDEX:
            index.chunks.append(_unpack("<QQQ", content, 0)[2])
        elif kind == STATISTICS:
            (length,) = _unpack("<I", content, 42)
            pairs = content[46 : 46 + length]
            index.counts = dict(struct.iter_unpack("<HQ", pairs[: length // 10 * 10]))
    index.chunks.sort()
    index.topics = declared.topics
    return index
