"""A crash-safe MCAP bag: CDR bytes in, one finished folder out.

Knows no ROS graph. Definitions of message types come from their ``.msg`` files and are embedded
in the bag, so that it can be read anywhere.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore


def typestore_with(packages: Iterable[Path]) -> Typestore:
    """Return the types of ROS 2 Jazzy and those of further message packages.

    Args:
        packages: folders named like their package, each with ``msg/*.msg``.

    Raises:
        FileNotFoundError: a folder holds no message definition.
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    for package in packages:
        files = sorted((package / "msg").glob("*.msg"))
        if not files:
            raise FileNotFoundError(
                f"{package} holds no msg/*.msg; build and source the workspace (ros_ws)"
            )
        types: dict = {}
        for file in files:
            types.update(get_types_from_msg(file.read_text(), f"{package.name}/msg/{file.stem}"))
        store.register(types)
    return store


ENCODINGS = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}


class McapStorage:
    """One file with checksums, in chunks of about 1 MiB; what ``rosbags`` asks of a storage.

    The storage of ``rosbags`` itself leaves the checksums out, so that a byte that changes on the
    disk becomes a wrong number that nobody can notice.
    """

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Open the file; ``CompressionMode.STORAGE`` compresses its chunks."""
        self.path = path / f"{path.name}.mcap"
        self._file = self.path.open("xb")
        zipped = compression is CompressionMode.STORAGE
        self._writer = McapWriter(
            self._file, compression=CompressionType.ZSTD if zipped else CompressionType.NONE
        )
        self._writer.start(profile="ros2")
        self._schemas: dict[str, int] = {}
        self._channels: dict[int, int] = {}

    def add_msgtype(self, connection: Connection) -> None:
        """Declare the type of a topic."""
        definition = connection.msgdef
        self._schemas[connection.msgtype] = self._writer.register_schema(
            connection.msgtype, ENCODINGS[definition.format], definition.data.encode()
        )

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        """Declare a topic."""
        assert isinstance(connection.ext, ConnectionExtRosbag2)
        self._channels[connection.id] = self._writer.register_channel(
            connection.topic,
            connection.ext.serialization_format,
            self._schemas[connection.msgtype],
            {"offered_qos_profiles": offered_qos_profiles},
        )

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Append a message; its log time is in nanoseconds."""
        self._writer.add_message(self._channels[connection.id], timestamp, bytes(data), timestamp)

    def close(self, version: int, metadata: str) -> None:
        """Write the index and end the file."""
        self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata})
        self._writer.finish()
        self._file.close()

    def abort(self) -> None:
        """End the file without an index, but with every message so far."""
        with suppress(OSError):
            self._writer.flush()
        self._file.close()


class CheckedWriter(Writer):
    """Writes bags whose MCAP files have checksums."""

    STORAGE_PLUGINS = {**Writer.STORAGE_PLUGINS, StoragePlugin.MCAP: McapStorage}  # noqa: RUF012


class BagWriter:
    """Writes one bag under a temporary name and renames it when it is closed.

    A bag at ``path`` is therefore always a whole one. A crash or a full disk leaves what was
    written as ``path`` + ``.partial``, which nobody but its owner removes.
    """

    def __init__(
        self, path: Path, typestore: Typestore, custom: Mapping[str, str] | None = None
    ) -> None:
        """Open the bag for writing.

        Args:
            path: folder of the finished bag; must not exist.
            typestore: holds every type that will be written.
            custom: what is added to the metadata, by name.

        Raises:
            FileExistsError: ``path`` exists, or what another recording left of it.
        """
        if path.exists():
            raise FileExistsError(f"{path} exists already; remove it or choose another name")
        self.partial = path.with_name(path.name + ".partial")
        """Where the bag is until it is closed."""
        if self.partial.exists():
            raise FileExistsError(
                f"{self.partial} exists already: a recording runs or broke off; keep what it "
                "holds, then remove it or choose another name"
            )
        self.path = path
        self._typestore = typestore
        self.partial.mkdir(parents=True)
        # rosbags names the file after its folder, so the folder has its final name from the start.
        self._writer = CheckedWriter(
            self.partial / path.name,
            version=CheckedWriter.VERSION_LATEST,
            storage_plugin=StoragePlugin.MCAP,
        )
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self.say(custom or {})
        self._writer.open()
        self._connections: dict[str, Connection] = {}

    def say(self, custom: Mapping[str, str]) -> None:
        """Add to the metadata, which are written when the bag is closed."""
        for name, text in custom.items():
            self._writer.set_custom_data(name, text)

    def add_topic(self, topic: str, msgtype: str, qos: Iterable = ()) -> None:
        """Declare a topic before its first message; ``msgtype`` like ``std_msgs/msg/Header``."""
        self._connections[topic] = self._writer.add_connection(
            topic, msgtype, typestore=self._typestore, offered_qos_profiles=tuple(qos)
        )

    def write(self, topic: str, t_ns: int, cdr: bytes) -> None:
        """Append one serialized message; ``t_ns`` is its log time in nanoseconds."""
        self._writer.write(self._connections[topic], t_ns, cdr)

    def close(self) -> None:
        """Finish the bag and give it its name.

        Raises:
            OSError: it could not be written; what was is left as ``partial``.
        """
        try:
            self._writer.close()
        except OSError:
            self.leave()
            raise
        (self.partial / self.path.name).rename(self.path)
        self.partial.rmdir()

    def leave(self) -> None:
        """Give the recording up, but leave what was written."""
        with suppress(OSError):
            self._writer.abort()

    def abort(self) -> None:
        """Give the recording up and leave nothing behind."""
        self.leave()
        shutil.rmtree(self.partial, ignore_errors=True)
