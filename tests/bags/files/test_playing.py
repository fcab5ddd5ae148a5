"""What of a bag is played, under which names and QoS, and when."""

from __future__ import annotations

import random
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from cfnav_ros.bags.files.playing import BACK_NS, LAST_NS, LEAP_NS, Cue, Pace, Play
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.roles import ROLES, assign
from cfnav_ros.bags.files.sources import SENSORS, Offer, choose, recorded_offer
from cfnav_ros.bags.files.storage import BagTopic
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.metadata import dump_qos_v8, dump_qos_v9

from cfnav_core.robot.robot import Robot
from cfnav_core.robot.topics import COMPRESSED, TOPICS, Topic
from studies.bags import bag_files as files
from studies.bags.bag_files import STORE, ZERO_NS, Message, S

MS = 1_000_000
SCAN, ODOM, JOINTS = (
    "sensor_msgs/msg/LaserScan",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/JointState",
)
TOLD = {role for role in ROLES if role not in SENSORS}
ALL = [BagTopic(f"/{role.names[0]}", role.types[0], 9) for role in (ROLES | SENSORS).values()]


def names(*topics: BagTopic, **options) -> dict[str, str]:
    return {s.role: s.name for s in choose(topics, **options).sources}


# What


def test_only_what_sensors_said_is_played():
    assert {"cmd_vel", "decision", "episode", "estimate", "truth", "map", "clock"} == TOLD
    played = choose(ALL).sources
    assert {source.role for source in played} == set(SENSORS)
    told = {kind for role in TOLD for kind in ROLES[role].types}
    assert not told & {source.topic.type for source in played}


def test_topics_have_the_names_of_the_live_robot_in_any_namespace():
    there = [BagTopic(f"/r7{t.name}", t.type, 9) for t in ALL] + [BagTopic("/r7/laser", SCAN, 1)]
    assert names(*there) == {role: f"/{TOPICS[role].name}" for role in SENSORS}
    assert names(*there, namespace="/r1/")["tf_static"] == "/r1/tf_static"
    assert names(*there, recorded=True)["scan"] == "/r7/scan"
    assert names(*there, recorded=True, namespace="old")["scan"] == "/old/r7/scan"
    assert names(*there, words=["scan:=r7/laser"], recorded=True)["scan"] == "/r7/laser"


def test_a_compressed_picture_is_told_apart():
    packed = BagTopic("/front/jpeg", "sensor_msgs/msg/CompressedImage", 3)
    assert names(packed) == {"image": "/oakd/rgb/preview/image_raw/compressed"}
    there = Topic("front/image_raw/compressed", COMPRESSED)
    live = replace(Robot(), topics={**TOPICS, "image": there})
    assert names(packed, robot=live) == {"image": "/front/image_raw/compressed"}


def test_a_command_is_no_sensor_whatever_its_type():
    arm, real = BagTopic("/arm/joint_command", JOINTS, 90), BagTopic("/states", JOINTS, 3)
    assert names(arm, real, recorded=True) == {"joint_states": "/states"}
    with pytest.raises(ValueError, match="no topic of a sensor"):
        choose([arm, BagTopic("/cmd_vel", "geometry_msgs/msg/Twist", 4)])
    with pytest.raises(ValueError, match=r"/arm/joint_command .* is a command"):
        choose([arm, real], ["joint_states:=/arm/joint_command"])


@pytest.mark.parametrize(
    ("words", "space", "said"),
    [
        (["cmd_vel:=/cmd_vel"], "", "expected ROLE:=NAME with ROLE one of image"),
        (["scan:=/none"], "", "/none that was given for scan is not in the bag"),
        (["scan:=/odom"], "", "holds nav_msgs/msg/Odometry, expected sensor_msgs/msg/LaserScan"),
        ([], "a b", "The namespace is 'a b'"),
    ],
)
def test_what_cannot_be_chosen_is_one_sentence(words, space, said):
    with pytest.raises(ValueError, match=said):
        choose(ALL, words, space)


def test_a_name_that_nobody_can_publish_is_left_out():
    chosen = choose([BagTopic("/a b", SCAN, 1), BagTopic("/odom", ODOM, 1)], recorded=True)
    assert [s.role for s in chosen.sources] == ["odom"]
    assert any("'a b'" in note or "'/a b'" in note for note in chosen.notes)


# Quality of service


def profile(reliable: bool | None, latched: bool | None, depth: int) -> Qos:
    never = QosTime(0, 0)
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        {True: QosReliability.RELIABLE, False: QosReliability.BEST_EFFORT}.get(
            reliable, QosReliability.UNKNOWN
        ),
        {True: QosDurability.TRANSIENT_LOCAL, False: QosDurability.VOLATILE}.get(
            latched, QosDurability.UNKNOWN
        ),
        never,
        never,
        QosLiveliness.AUTOMATIC,
        never,
        False,
    )


@pytest.mark.parametrize("dump", [dump_qos_v8, dump_qos_v9])
@pytest.mark.parametrize(
    ("profiles", "offer"),
    [
        ([(True, True, 7)], Offer(7, True, True)),
        ([(False, False, 5)], Offer(5, False, False)),
        ([(False, False, 1), (True, False, 3)], Offer(3, True, False)),
        ([(None, None, 0)], Offer(42, False, True)),  # as discovery tells it
        ([(True, False, 10**9)], Offer(1000, True, False)),
        ([], Offer(42, False, True)),
    ],
)
def test_the_recorded_offer_is_kept_where_the_bag_tells_it(dump, profiles, offer):
    said = dump([profile(*p) for p in profiles])
    assert recorded_offer(said, Offer(42, False, True)) == offer


@pytest.mark.parametrize("said", ["", "[", "7", "- a", "- {depth: x}", 7, [None], "{a: {b"])
def test_an_offer_that_makes_no_sense_is_the_usual_one(said):
    assert recorded_offer(said, Offer(42)) == Offer(42)


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("metadata", [True, False])
def test_every_kind_of_bag_tells_the_offer(tmp_path, storage, metadata):
    path = tmp_path / "bag"
    with Writer(path, version=9, storage_plugin=storage) as writer:
        offered = [profile(False, True, 6)]
        made = writer.add_connection("/scan", SCAN, typestore=STORE, offered_qos_profiles=offered)
        said = files.scan(ZERO_NS)
        writer.write(made, ZERO_NS, bytes(STORE.serialize_cdr(said, SCAN)))
    if not metadata:
        (path / "metadata.yaml").unlink()
    with Bag(path) as bag:
        (source,) = choose(bag.topics).sources
    assert source.offer == Offer(6, False, True)


# When


def paced(times: list[int], stamps: list[int] | None = None) -> list[tuple[int, int]]:
    """(time of the play, node time) of messages of one topic."""
    pace, found = Pace(), []
    stamps = stamps or [0] * len(times)
    for time_ns, next_ns, stamp_ns in zip(times, [*times[1:], 0], stamps, strict=True):
        pace.move(time_ns, next_ns, "/odom", stamp_ns)
        found.append((pace.at_ns, pace.node_ns))
    return found


def test_messages_come_at_the_pace_of_their_node_times():
    times = [ZERO_NS + k * 50 * MS for k in (0, 1, 2, 5, 190)]
    assert paced(times) == [(t - ZERO_NS, t) for t in times]


def test_a_step_ahead_that_no_drive_takes_costs_no_time():
    later = ZERO_NS + 3600 * S
    assert paced([ZERO_NS, ZERO_NS + S, later, later + S]) == [
        (0, ZERO_NS), (S, ZERO_NS + S), (S, later), (2 * S, later + S),
    ]  # fmt: skip


def test_time_that_goes_back_is_another_run():
    again = ZERO_NS - 3600 * S
    assert paced([ZERO_NS, again, again + S]) == [(0, ZERO_NS), (0, again), (S, again + S)]


@pytest.mark.parametrize("stray", [ZERO_NS + 10**17, 1, ZERO_NS - BACK_NS - 1])
def test_one_message_with_a_stray_time_moves_nothing(stray):
    times = [ZERO_NS, ZERO_NS + S, stray, ZERO_NS + 2 * S]
    assert [at for at, _ in paced(times)] == [0, S, S, 2 * S]
    assert [node for _, node in paced(times)] == [ZERO_NS, ZERO_NS + S, ZERO_NS + S, times[-1]]
    assert paced(times[:3])[-1] == (S, ZERO_NS + S)


def test_a_little_disorder_does_not_turn_time_back():
    times = [ZERO_NS, ZERO_NS + S, ZERO_NS + S - BACK_NS, ZERO_NS + 2 * S]
    assert paced(times)[2:] == [(S, ZERO_NS + S), (2 * S, ZERO_NS + 2 * S)]


def test_stamps_pace_what_node_time_does_not():
    stamps = [ZERO_NS + k * 50 * MS for k in range(100)]
    found = paced([S] * 100, stamps)
    assert found == [(stamp - ZERO_NS, S) for stamp in stamps]
    # and the time that they took is not taken again when node time goes on
    went_on = paced([*[S] * 100, 7 * S], [*stamps, 0])
    assert went_on[-1] == (6 * S, 7 * S)


def test_nothing_to_tell_the_time_is_played_at_once():
    assert set(paced([0] * 100)) == {(0, 0)}


def test_no_times_hang_the_play_or_turn_it_back():
    rng = random.Random(5)
    for _ in range(200):
        pick = [lambda: rng.randrange(LAST_NS), lambda: ZERO_NS + rng.randrange(20 * S), lambda: 0]
        times = [rng.choice(pick)() for _ in range(60)]
        stamps = [rng.choice(pick)() for _ in range(60)]
        found = paced(times, stamps)
        steps = [after[0] - before[0] for before, after in pairwise(found)]
        assert all(0 <= step <= LEAP_NS for step in steps)
        assert all(node == 0 or node in times for _, node in found)


# A bag


def play_of(path: Path, tick_ns: int = 10 * MS, **options) -> tuple[list[Cue], list[str]]:
    with Bag(path) as bag:
        chosen = choose(bag.topics)
        play = Play(bag, chosen.sources, assign(bag.topics).topics.get("clock"), **options)
        cues = list(play.cues(tick_ns))
        remarks = play.finish()
        assert play.count is None or play.count >= sum(cue.source is not None for cue in cues)
        return cues, remarks + list(bag.notes)


def said(cues: list[Cue]) -> list[tuple[str, bytes]]:
    return [(cue.source.topic.name, cue.data) for cue in cues if cue.source]


def of_sensors(messages: list[Message]) -> list[Message]:
    kinds = {kind for role in SENSORS.values() for kind in role.types}
    return [m for m in messages if m.type in kinds]


def without_clock(messages: list[Message], shift_ns: int = 0) -> list[Message]:
    return [m._replace(log_ns=m.log_ns + shift_ns) for m in messages if m.topic != "/clock"]


def test_a_bag_is_played_byte_for_byte_in_order(tmp_path):
    messages = files.drive()
    cues, notes = play_of(files.write(tmp_path / "bag", messages))
    expected = sorted(of_sensors(messages), key=lambda m: m.log_ns)
    assert said(cues) == [(m.topic, m.cdr) for m in expected]
    assert notes == []


def test_node_time_is_the_log_time_and_is_told_often(tmp_path):
    messages = without_clock(files.drive(), 3 * S)
    cues, _ = play_of(files.write(tmp_path / "bag", messages))
    first = min(m.log_ns for m in of_sensors(messages))
    logged = sorted(m.log_ns for m in of_sensors(messages))
    assert [b.clock_ns for b in cues if b.source] == logged
    assert all(b.at_ns == b.clock_ns - first for b in cues)
    assert all(0 <= b.at_ns - a.at_ns <= 10 * MS for a, b in pairwise(cues))
    slow, _ = play_of(tmp_path / "bag", 50 * MS)
    assert said(slow) == said(cues)
    assert len(slow) < len(cues)


def test_node_time_is_that_of_the_recorded_clock(tmp_path):
    """Recorded in system time, driven in simulated time."""
    messages = [m._replace(log_ns=m.log_ns + 10**17) for m in files.drive()]
    cues, _ = play_of(files.write(tmp_path / "bag", messages))
    ticks = {ZERO_NS + n * S // 10 for n in range(20)}
    # what was logged before the first tick has only its log time
    assert [b for b in cues if b.source][-1].clock_ns == max(ticks)
    assert {b.clock_ns for b in cues if b.source} - {cues[0].clock_ns} == ticks
    assert 1.8 * S < cues[-1].at_ns < 2.1 * S


def test_log_times_that_stand_at_zero_are_paced_by_stamps(tmp_path):
    messages = [m._replace(log_ns=0) for m in without_clock(files.drive())]
    cues, notes = play_of(files.write(tmp_path / "bag", messages))
    assert said(cues) == [(m.topic, m.cdr) for m in of_sensors(messages)]
    assert cues[-1].at_ns == pytest.approx(1.9 * S, abs=0.01 * S)
    assert cues[-1].clock_ns == pytest.approx(ZERO_NS + 1.9 * S, abs=0.01 * S)
    assert notes == []


def test_zeros_before_the_first_time_do_not_delay_the_drive(tmp_path):
    messages = without_clock(files.drive())
    early = [m._replace(log_ns=0) if k < 9 else m for k, m in enumerate(messages)]
    cues, _ = play_of(files.write(tmp_path / "bag", early))
    assert cues[-1].at_ns < 2.1 * S


def test_leaps_and_strays_are_named(tmp_path):
    messages = of_sensors(files.drive())
    half = len(messages) // 2
    leapt = [m._replace(log_ns=m.log_ns + 10**13 * (k > half)) for k, m in enumerate(messages)]
    leapt[9] = leapt[9]._replace(log_ns=ZERO_NS + 10**15)
    cues, notes = play_of(files.write(tmp_path / "bag", leapt))
    assert len(said(cues)) == len(messages)
    assert cues[-1].at_ns < 2.1 * S
    assert any("Time leaps in 1 places" in note for note in notes)
    assert any("1 messages had a stray time" in note for note in notes)


def test_what_can_be_read_of_a_damaged_bag_is_played(tmp_path):
    path = files.write_mcap(tmp_path / "bag.mcap", files.drive())
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    cues, notes = play_of(path)
    expected = [(m.topic, m.cdr) for m in of_sensors(files.drive())]
    assert 0 < len(said(cues)) < len(expected)
    assert set(said(cues)) <= set(expected)
    assert any("broke off" in note or "cut short" in note for note in notes)


@pytest.mark.parametrize("kind", ["mcap", "sqlite"])
def test_no_damage_hangs_the_play(tmp_path, kind):
    if kind == "mcap":
        path = files.write_mcap(tmp_path / "bag.mcap", files.drive(0.6))
    else:
        folder = files.write(tmp_path / "bag", files.drive(0.6), StoragePlugin.SQLITE3)
        (path,) = folder.glob("*.db3")
    whole, rng = path.read_bytes(), random.Random(3)
    for _ in range(40):
        hurt = bytearray(whole)
        for _ in range(rng.randint(1, 12)):
            hurt[rng.randrange(len(hurt))] = rng.randrange(256)
        path.write_bytes(hurt[: rng.choice([len(hurt), rng.randrange(len(hurt))])])
        with Bag(path) as bag:
            try:
                sources = choose(bag.topics).sources
            except ValueError:
                assert len(bag.notes) > 0
                continue
            cues = list(Play(bag, sources).cues(50 * MS))
        assert len(said(cues)) <= len(files.drive(0.6))
        assert all(0 <= b.at_ns - a.at_ns <= 50 * MS for a, b in pairwise(cues))


def test_bytes_that_are_no_message_reach_nobody(tmp_path):
    """A listener's node would end on them."""
    messages = files.drive()
    store, odd = files.STORE, next(m for m in messages if m.topic == "/scan")
    path = tmp_path / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection("/scan", SCAN, typestore=store)
        for k, data in enumerate([odd.cdr, odd.cdr[:40], b"", odd.cdr]):
            writer.write(topic, ZERO_NS + k, data)
    cues, notes = play_of(path)
    assert said(cues) == [("/scan", odd.cdr)] * 2
    assert any("2 messages of /scan make no sense" in note for note in notes)


def test_a_type_with_other_fields_than_here_is_left_out(tmp_path):
    path = files.write(tmp_path / "bag", files.drive())
    cues, notes = play_of(path, installed={SCAN: "RIHS01_00", ODOM: STORE.hash_rihs01(ODOM)})
    topics = {name for name, _ in said(cues)}
    assert "/odom" in topics
    assert "/scan" not in topics
    assert any("/scan is left out: its messages have other fields" in note for note in notes)
