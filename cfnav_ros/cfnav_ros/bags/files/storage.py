"""What MCAP and sqlite3 files have in common: topics, raw messages, limits, and notes of damage."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from backports import zstd

MAX_MESSAGE = 64 * 2**20
"""Bytes of a message; a larger one is damaged, and would fill the memory."""

MAX_NOTES = 200
"""A bag that is damaged all over is not described place by place."""

DAMAGE = (OSError, EOFError, ValueError, RuntimeError, zstd.ZstdError)
"""What reading and unpacking a damaged file raises."""

Key = tuple[str, str]
"""Name and message type of a topic: two publishers may disagree on the type."""


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag.

    Attributes:
        name: such as ``/scan``.
        type: such as ``sensor_msgs/msg/LaserScan``, see ``ros_type``.
        count: messages, None when only reading tells.
        definition: the type's definition as the bag holds it, "" when it holds none.
        language: of the definition, ``ros2msg``, ``ros2idl`` or ``omgidl``.
        qos: the profiles that its publishers offered, as YAML or what YAML gave; not checked.
    """

    name: str
    type: str
    count: int | None = None
    definition: str = field(default="", repr=False)
    language: str = ""
    qos: Any = field(default="", repr=False, compare=False)

    @cached_property
    def key(self) -> Key:
        """Name and type."""
        return self.name, self.type


def ros_type(name: str) -> str:
    """A message type as ROS 2 names it.

    Recorders and converters also write ``sensor_msgs/LaserScan``, ``sensor_msgs::msg::LaserScan``
    or, as DDS has it, ``sensor_msgs::msg::dds_::LaserScan_``.
    """
    parts = [part for part in name.replace("::", "/").split("/") if part]
    if parts[-2:-1] == ["dds_"]:
        parts = [*parts[:-2], parts[-1].removesuffix("_")]
    if len(parts) == 2:
        parts.insert(1, "msg")
    return "/".join(parts)


class Raw(NamedTuple):
    """A message as it was recorded: log time in nanoseconds, CDR bytes."""

    topic: BagTopic
    log_ns: int
    data: bytes


class Notes:
    """Sentences about what could not be read, each once, in the order in which it was found."""

    def __init__(self) -> None:
        self._sentences: dict[str, None] = {}

    def add(self, sentence: str) -> None:
        """Take a sentence."""
        if len(self._sentences) < MAX_NOTES:
            self._sentences[sentence] = None
        else:
            self._sentences["More is damaged than is named here."] = None

    def __iter__(self) -> Iterator[str]:
        return iter(self._sentences)

    def __len__(self) -> int:
        return len(self._sentences)


class Storage(ABC):
    """One file of a bag.

    Attributes:
        path: of the file.
        declared: topics that ``messages`` has come across.
        unchecked: messages given in this pass that no checksum protects: damage within them goes
            unnoticed.
    """

    def __init__(self, path: Path, notes: Notes) -> None:
        """Name the file; nothing is read yet.

        Args:
            path: of the file; one that ends in ``.zstd`` is packed as a whole.
            notes: take a sentence for everything that cannot be read.
        """
        self.path = path
        self.declared: dict[Key, BagTopic] = {}
        self.unchecked = 0
        self._zipped = path.suffix == ".zstd"
        self._notes = notes

    def _note(self, what: str) -> None:
        self._notes.add(f"{self.path.name} {what}.")

    @abstractmethod
    def topics(self) -> list[BagTopic] | None:
        """The topics as the file's own index has them.

        Messages are counted if that needs no reading of their content.

        Returns:
            None when only reading the whole file tells.
        """

    @abstractmethod
    def messages(self, wanted: Collection[Key] | None) -> Iterator[Raw]:
        """What can be read, in the order of recording; None wants all topics."""


def is_cdr(encoding: str, topic: str, notes: Notes) -> bool:
    """Whether a topic is serialized as ROS 2 does it; a note says which is not."""
    if encoding != "cdr":
        notes.add(f"Topic {topic} is serialized as {encoding!r}, expected 'cdr': it is left out.")
    return encoding == "cdr"


def unzip(data: bytes, most: int) -> bytes:
    """Unpack one zstd frame into at most ``most`` bytes.

    Raises:
        ValueError: it is cut short or holds more.
        zstd.ZstdError: it is damaged.
    """
    unpacker = zstd.ZstdDecompressor()
    out = unpacker.decompress(data, max_length=most + 1)
    if len(out) > most:
        raise ValueError(f"it holds more than {most} bytes")
    if not unpacker.eof:
        raise ValueError("it ends too early")
    return out
