"""A sqlite3 file of rosbag2 as raw messages, in the order of recording up to the first damage.

Such a file has no checksums: a picture whose bytes were changed cannot be told from a whole one.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

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
)

LOGS = ("-wal", "-journal")
"""Ends of the names of files in which a recorder that was killed leaves messages."""


class SqliteFile(Storage):
    """One ``.db3`` or ``.db3.zstd``; the latter is unpacked among the system's temporary files."""

    def __init__(self, path: Path, notes: Notes) -> None:
        """Name the file; nothing is read yet."""
        super().__init__(path, notes)
        self._copied: TemporaryDirectory[str] | None = None  # removed with this object

    def topics(self) -> list[BagTopic] | None:
        """The topics by their table; counting reads the table of messages without their content."""
        if self._zipped:
            return None
        try:
            with self._open() as base:
                topics = self._declared(base)
                query = "SELECT topic_id, count(*) FROM messages GROUP BY topic_id"
                counts = dict(base.execute(query).fetchall())
        except (sqlite3.Error, *DAMAGE):
            return None
        return [
            replace(t, count=counts.get(number, 0)) for number, t in topics.items() if t is not None
        ]

    def messages(self, wanted: Collection[Key] | None) -> Iterator[Raw]:
        """What can be read up to the first damage; None wants all topics."""
        seen, last, self.unchecked = 0, None, 0
        try:
            with self._open() as base:
                topics = self._declared(base)
                for row, number, log_ns, data in self._rows(base, topics, wanted):
                    if last is not None and row <= last:
                        raise ValueError("its rows go round in a circle")
                    seen, last, topic = seen + 1, row, topics.get(number)
                    if topic is not None and isinstance(data, bytes) and isinstance(log_ns, int):
                        self.unchecked += 1
                        yield Raw(topic, log_ns, data)
                    elif data is not None or number not in topics:
                        self._note(f"has a message without topic, time or content in row {row}")
                self._compare(base, seen)
        except (sqlite3.Error, *DAMAGE) as error:
            self._note(f"is damaged, what follows its first {seen} messages is lost: {error}")

    def _rows(
        self,
        base: sqlite3.Connection,
        topics: dict[int, BagTopic | None],
        wanted: Collection[Key] | None,
    ) -> sqlite3.Cursor:
        """All rows of the table of messages in the order of writing, with content if wanted."""
        numbers = [n for n, t in topics.items() if t and (wanted is None or t.key in wanted)]
        marks = ",".join("?" * len(numbers))
        # Not sorted by time: that needs an index, which is one more thing that can be damaged.
        return base.execute(
            f"SELECT id, topic_id, timestamp, CASE WHEN topic_id IN ({marks}) THEN data END "
            "FROM messages ORDER BY id",
            numbers,
        )

    def _compare(self, base: sqlite3.Connection, seen: int) -> None:
        """Compare the rows with the index by time: a damaged page can lose some without a word."""
        if not base.execute("SELECT 1 FROM sqlite_master WHERE name = 'timestamp_idx'").fetchall():
            return
        try:
            listed = base.execute("SELECT count(timestamp) FROM messages INDEXED BY timestamp_idx")
            ((count,),) = listed.fetchall()
        except sqlite3.Error as error:
            self._note(f"may have lost messages, its index by time cannot be read: {error}")
            return
        if count != seen:
            self._note(f"lists {count} messages in its index by time, {seen} were found")

    def _declared(self, base: sqlite3.Connection) -> dict[int, BagTopic | None]:
        """The topics by their number, None for those that are not CDR."""
        tables = base.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
        if not {("topics",), ("messages",)} <= set(tables):
            raise ValueError("it has no tables of topics and messages")
        definitions: dict[str, tuple[str, str]] = {}
        if ("message_definitions",) in tables:
            query = "SELECT topic_type, encoded_message_definition, encoding "
            for name, *text in base.execute(query + "FROM message_definitions"):
                definitions[str(name)] = (str(text[0]), str(text[1]))
        topics: dict[int, BagTopic | None] = {}
        columns = [column[1] for column in base.execute("PRAGMA table_info(topics)")]
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        query = f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"
        for number, name, kind, encoding, offered in base.execute(query):
            text = definitions.get(str(kind), ("", ""))
            topic = BagTopic(str(name), ros_type(str(kind)), None, *text, str(offered))
            topics[number] = topic if is_cdr(str(encoding), topic.name, self._notes) else None
        self.declared = {topic.key: topic for topic in topics.values() if topic}
        return topics

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        """The file as a database that nobody can write to."""
        uri = f"{self._whole().resolve().as_uri()}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True, check_same_thread=False)) as base:
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)
            base.text_factory = lambda text: text.decode(errors="replace")
            base.execute("PRAGMA trusted_schema = OFF")
            yield base

    def _whole(self) -> Path:
        """The database in one unpacked file: its own, or one among the temporary files."""
        logs = [self.path.with_name(self.path.name + end) for end in LOGS]
        logs = [log for log in logs if log.exists() and log.stat().st_size]
        if not (self._zipped or logs):
            return self.path
        if self._copied is None:
            self._copied = TemporaryDirectory(prefix="cfnav_bag_")
            copy = Path(self._copied.name, "bag.db3")
            if self._zipped:
                self._unpack(copy)
            else:
                _take_over(self.path, logs, copy)
        return Path(self._copied.name, "bag.db3")

    def _unpack(self, path: Path) -> None:
        """Unpack the file; of a damaged one what comes before the damage."""
        try:
            with zstd.open(self.path, "rb") as packed, path.open("wb") as out:
                shutil.copyfileobj(packed, out, 2**20)
        except DAMAGE as error:
            self._note(f"cannot be unpacked to its end: {error}")


def _take_over(path: Path, logs: Sequence[Path], copy: Path) -> None:
    """Copy a database and what a killed recorder left of it in logs into one file.

    Sqlite writes beside a database with logs, even to read it: so it is done to the copy.

    Raises:
        OSError: there is no room for it.
        sqlite3.Error: it is damaged.
    """
    shutil.copyfile(path, copy)
    for log in logs:
        shutil.copyfile(log, f"{copy}{log.name.removeprefix(path.name)}")
    with closing(sqlite3.connect(copy)) as base:
        base.execute("PRAGMA trusted_schema = OFF")
        base.execute("PRAGMA journal_mode = DELETE").fetchall()
