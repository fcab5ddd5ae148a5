"""An MCAP file with checksums, as storage of the bags that ``rosbags`` writes.

The storage of ``rosbags`` itself leaves the checksums out, so that a byte that changes on the disk
becomes a wrong number that nobody can notice.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer

ENCODINGS = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}


class McapStorage:
    """One file, written in chunks of about 1 MiB; what ``rosbags`` asks of a storage."""

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
