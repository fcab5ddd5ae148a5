"""Bags of every kind give the same events; damaged ones what is whole, and say what is not."""

from __future__ import annotations

import gc
import os
import shutil
import sqlite3
import struct
import tempfile
import tracemalloc
from pathlib import Path

import pytest
from cfnav_ros.bags.files.events import Picture, Pose
from cfnav_ros.bags.files.finding import find_bags
from cfnav_ros.bags.files.reading import SORTED_NS, Bag
from cfnav_ros.bags.files.roles import ROLES, assign
from cfnav_ros.bags.files.storage import MAX_MESSAGE

from studies.bags.bag_files import (
    SQLITE,
    STORE,
    VARIANTS,
    ZERO_NS,
    Message,
    S,
    drive,
    image,
    odometry,
    write,
    write_mcap,
)
from studies.bags.fuzz import read

DRIVE = drive()
ODOM = "nav_msgs/msg/Odometry"
NOBODY = 65534
"""A user who owns no file."""


def test_every_message_becomes_its_event(expected):
    logs = [event[2] for event in expected]
    assert logs == sorted(m.log_ns for m in DRIVE)
    kinds = {event[0] for event in expected}
    assert len(kinds) == 15
    assert "Unreadable" not in kinds


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_kind_of_bag_reads_the_same(tmp_path, expected, variant):
    bag = VARIANTS[variant](tmp_path / "bag", DRIVE)
    assert find_bags([tmp_path]) == [bag if bag.is_dir() else tmp_path]
    assert read(bag) == (expected, [])


@pytest.mark.parametrize(
    "variant", ["recorded", "mcap", "sqlite", "mcap chunks", "mcap without chunks"]
)
def test_messages_without_a_checksum_are_counted(tmp_path, expected, variant):
    with Bag(VARIANTS[variant](tmp_path / "bag", DRIVE)) as bag:
        count = sum(1 for _ in bag.messages())
        assert bag.unchecked == (0 if variant in ("recorded", "mcap chunks") else count)


def test_a_robot_in_a_namespace_reads_the_same(tmp_path, expected):
    bag = write(tmp_path / "bag", drive(namespace="/robot1/base"))
    events, notes = read(bag)
    assert notes == []
    assert [event[:3] for event in events] == [event[:3] for event in expected]


@pytest.mark.parametrize("cut", [0, 1, 8, 30, 200, 0.1, 0.3, 0.5, 0.7, 0.9, -300, -40, -8, -1])
@pytest.mark.parametrize("variant", ["mcap chunks", "mcap without chunks", "mcap zstd storage"])
def test_what_is_whole_of_a_truncated_file_is_read(tmp_path, expected, variant, cut):
    made = VARIANTS[variant](tmp_path / "bag", DRIVE)
    file = made if made.is_file() else next(made.glob("*.mcap"))
    data = file.read_bytes()
    data = data[: int(cut * len(data)) if isinstance(cut, float) else cut]
    file.write_bytes(data)
    events, notes = read(file)
    assert events == expected[: len(events)]
    assert notes
    if cut == 0.5 and variant != "mcap zstd storage":  # that one has a single chunk
        assert 0.35 < len(events) / len(expected) < 0.7
    if isinstance(cut, int) and cut < 0:
        assert len(events) == len(expected)


def test_a_corrupt_chunk_costs_only_itself(tmp_path, expected):
    file = write_mcap(tmp_path / "bag.mcap", DRIVE)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0x10
    file.write_bytes(data)
    events, notes = read(file)
    assert 0.7 < len(events) / len(expected) < 1.0
    assert set(events) < set(expected)
    assert any("has a damaged chunk at byte" in note for note in notes)


def test_the_index_names_what_was_named_in_a_corrupt_chunk(tmp_path, expected):
    file = write_mcap(tmp_path / "bag.mcap", DRIVE)
    data = bytearray(file.read_bytes())
    first = next(at for at in range(len(data)) if data[at] == 6 and _chunk_length(data, at))
    data[first + 200] ^= 0x10
    file.write_bytes(data)
    events, notes = read(file)
    assert 0.7 < len(events) / len(expected) < 1.0
    assert set(events) < set(expected)
    assert any(f"has a damaged chunk at byte {first}" in note for note in notes)


def test_times_before_1970_are_times(tmp_path):
    said = [Message("/odom", ODOM, n * S, odometry(S, float(n))) for n in (-5, -4, -3)]
    with Bag(write(tmp_path / "bag", said, SQLITE)) as bag:
        assert [e.log_ns // S for e in bag.events(assign(bag.topics))] == [-5, -4, -3]
        assert list(bag.notes) == []


def test_reading_goes_on_behind_a_wrong_length(tmp_path, expected):
    file = write_mcap(tmp_path / "bag.mcap", DRIVE)
    data = bytearray(file.read_bytes())
    chunks = [at for at in range(len(data) - 9) if data[at] == 6 and _chunk_length(data, at)]
    struct.pack_into("<Q", data, chunks[2] + 1, 2**62)
    file.write_bytes(data)
    events, notes = read(file)
    assert 0.7 < len(events) / len(expected) < 1.0
    assert set(events) < set(expected)
    assert any(f"it is read again from byte {chunks[3]}" in note for note in notes)


def _chunk_length(data: bytearray, at: int) -> bool:
    """Whether the record here is a chunk: its first message is of the drive."""
    (length,) = struct.unpack_from("<Q", data, at + 1)
    return 100 < length < 20_000 and data[at + 9 + 28 : at + 9 + 36] == b"\4\0\0\0zstd"


def test_absurd_lengths_do_not_fill_the_memory(tmp_path):
    file = write_mcap(tmp_path / "bag.mcap", DRIVE)
    data = bytearray(file.read_bytes())
    chunk = next(at for at in range(len(data)) if data[at] == 6 and _chunk_length(data, at))
    struct.pack_into("<Q", data, chunk + 9 + 16, 2**40)  # its size when unpacked
    file.write_bytes(data)
    tracemalloc.start()
    _, notes = read(file)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert any("unpacks to 1099511627776 bytes, expected at most" in note for note in notes)
    assert most < 30e6


def test_a_message_that_unpacks_to_too_much_is_left_out(tmp_path):
    from backports import zstd

    bomb = zstd.compress(bytes(MAX_MESSAGE + 1))
    file = write_mcap(tmp_path / "bag.mcap", [])
    from mcap.writer import Writer

    with file.open("wb") as out:
        writer = Writer(out)
        writer.start("ros2")
        text, _ = STORE.generate_msgdef(ODOM, ros_version=2)
        schema = writer.register_schema(ODOM, "ros2msg", text.encode())
        channel = writer.register_channel("/odom", "cdr", schema)
        writer.add_message(channel, 1, bomb, 1)
        writer.finish()
    events, notes = read(file)
    assert events == []
    assert "1 messages of /odom cannot be unpacked: they are left out." in notes


def test_a_database_is_read_up_to_its_damage(tmp_path, expected):
    bag = write(tmp_path / "bag", DRIVE, SQLITE)
    file = bag / "bag.db3"
    data = bytearray(file.read_bytes())
    page = 4096
    middle = len(data) // 2 // page * page
    data[middle : middle + 3 * page] = bytes(3 * page)
    file.write_bytes(data)
    events, notes = read(bag)
    assert 0 < len(events) < len(expected)
    assert any("could be read" in note or "is damaged" in note for note in notes)


def killed(path, mode, *ends):
    """A database with twice the drive, of which a killed recorder left a part beside it."""
    bag = write(path / "whole", DRIVE, SQLITE)
    base = sqlite3.connect(bag / "whole.db3", isolation_level=None)
    base.execute(f"PRAGMA journal_mode = {mode}")
    base.execute("PRAGMA cache_size = 1")
    base.execute("BEGIN")
    base.execute(
        "INSERT INTO messages SELECT id + 1000, topic_id, timestamp + 3000000000, data "
        "FROM messages"
    )
    if mode == "WAL":
        base.execute("COMMIT")
    made = path / "killed"
    made.mkdir()
    for end in ("", *ends):
        shutil.copy(bag / f"whole.db3{end}", made / f"b & 100% #1?.db3{end}")
    base.close()
    return made


def contents(folder):
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()}


@pytest.fixture
def strangers_folder():
    """Return a folder that who reads may not write into, not even as root."""
    folder = Path(tempfile.mkdtemp(prefix="cfnav_bag_"))
    yield folder
    if os.geteuid() != os.getuid():
        os.seteuid(os.getuid())
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o755)
    shutil.rmtree(folder)


def closed(folder):
    """Take everybody's right to write into a folder, and root's from this process."""
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o555)
    if os.geteuid() == 0:
        os.seteuid(NOBODY)
    with pytest.raises(PermissionError):
        (folder / "new").touch()


@pytest.mark.parametrize("ends", [("-wal",), ("-wal", "-shm")])
def test_messages_that_a_killed_recorder_left_beside_the_database_are_read(
    strangers_folder, expected, ends
):
    made = killed(strangers_folder, "WAL", *ends)
    before = contents(made)
    closed(strangers_folder)
    events, notes = read(made)
    assert len(events) == 2 * len(expected)
    assert notes == [f"{made} has no metadata.yaml: the recording broke off or was copied in part."]
    assert contents(made) == before


def test_what_a_killed_recorder_had_not_finished_is_rolled_back(tmp_path, expected):
    made = killed(tmp_path, "DELETE", "-journal")
    before = contents(made)
    events, notes = read(next(made.glob("*.db3")))
    assert (events, notes) == (expected, [])
    assert contents(made) == before


def test_copies_of_databases_go_with_their_bag(tmp_path, monkeypatch):
    made = killed(tmp_path, "WAL", "-wal")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    read(made)
    gc.collect()
    assert list((tmp_path / "temporary").iterdir()) == []


def test_an_empty_file_and_a_bag_without_messages_say_so(tmp_path):
    (tmp_path / "empty.mcap").touch()
    events, notes = read(tmp_path / "empty.mcap")
    assert events == []
    assert any("empty.mcap ends at byte" in note for note in notes)
    bag = write(tmp_path / "bag", [])
    assert read(bag) == ([], [f"{bag} holds no topic."])
    silent = write(tmp_path / "silent", [], silent=[("/odom", ODOM)])
    with Bag(silent) as opened:
        (topic,) = opened.topics
        assert (topic.name, topic.count) == ("/odom", 0)
        assert list(opened.events(assign(opened.topics))) == []


def test_a_type_that_nobody_knows_costs_its_topic_only(tmp_path, expected):
    file = tmp_path / "bag.db3"
    shutil.copy(write(tmp_path / "bag", DRIVE, SQLITE) / "bag.db3", file)
    base = sqlite3.connect(file)
    base.execute("DELETE FROM message_definitions")
    base.commit()
    base.close()
    events, notes = read(file)
    left_out = {"Judged", "Decided", "Told", "Truth"}  # of cfnav's own types
    assert {e[0] for e in expected} - {e[0] for e in events} == left_out
    known = ("Bumps", "Detected", "Pose")
    assert [e for e in expected if e[0] in known] == [e for e in events if e[0] in known]
    assert any(
        note.startswith("/policy/decision is left out, its type") and "no definition" in note
        for note in notes
    )


def test_log_times_of_two_clocks_keep_the_order_of_recording(tmp_path):
    """Before /clock a recorder in simulated time logs 0; later the simulation begins again."""
    times = [0, 0, 5 * S, 6 * S, 7 * S - 1, 7 * S - 2, 90 * S, 1 * S, 2 * S]
    assert SORTED_NS < S
    said = [Message("/odom", ODOM, t, odometry(S + n, float(n))) for n, t in enumerate(times)]
    with Bag(write(tmp_path / "bag", said)) as bag:
        order = [event.x for event in bag.events(assign(bag.topics)) if isinstance(event, Pose)]
        assert order == [0, 1, 2, 3, 5, 4, 6, 7, 8]
        assert any("leap back" in note for note in bag.notes)


def test_a_message_larger_than_all_that_may_be_held_is_read(tmp_path, monkeypatch, expected):
    monkeypatch.setattr("cfnav_ros.bags.files.reading.HELD_BYTES", 100)
    assert len(read(write(tmp_path / "bag", DRIVE))[0]) == len(expected)


def test_memory_does_not_grow_with_the_bag(tmp_path, monkeypatch):
    monkeypatch.setattr("cfnav_ros.bags.files.reading.HELD_BYTES", 200_000)
    peaks = []
    for n in (200, 800):
        said = [
            Message(
                "/image_raw", "sensor_msgs/msg/Image", ZERO_NS + i * S // 15, image(S, i, side=60)
            )
            for i in range(n)
        ]
        file = write_mcap(tmp_path / f"{n}.mcap", said, chunk=100_000)
        del said
        with Bag(file) as bag:
            roles = assign(bag.topics)
            tracemalloc.start()
            assert sum(isinstance(event, Picture) for event in bag.events(roles)) == n
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]


def test_what_comes_twice_and_what_is_named_by_the_user(tmp_path):
    said = [
        *[Message("/a/odom", ODOM, ZERO_NS + n, odometry(S, 1.0)) for n in range(3)],
        *[Message("/b/odom", ODOM, ZERO_NS + n, odometry(S, 2.0)) for n in range(2)],
    ]
    with Bag(write(tmp_path / "bag", said)) as bag:
        roles = assign(bag.topics)
        assert {e.x for e in bag.events(roles) if isinstance(e, Pose)} == {1.0}
        assert roles.notes == (
            "For odom /a/odom (Odometry, 3 messages) was chosen, there are also /b/odom "
            "(Odometry, 2 messages).",
        )
        named = assign(bag.topics, {"odom": "b/odom"})
        assert {e.x for e in bag.events(named) if isinstance(e, Pose)} == {2.0}


def test_the_usual_roles_are_all_in_the_drive(tmp_path):
    with Bag(write(tmp_path / "bag", DRIVE)) as bag:
        roles = assign(bag.topics)
    assert set(roles.topics) == set(ROLES)
    assert roles.missing == ()
    assert roles.notes == ()
