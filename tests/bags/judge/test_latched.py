"""A recorder that comes late is handed old episode messages: they are no drives."""

import dataclasses

import pytest
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.files.events import Tick
from cfnav_ros.bags.judge.drive_log import BAG
from cfnav_ros.bags.judge.latched import MOST_HELD

from tests.bags.event_bag import bag_of
from tests.bags.judge.test_drives import MOVE, drives_of
from tests.bags.made import at, drive, end, ns, pose, start

BEGIN = 1200.0
"""When the recorder comes, in simulated time."""

SYSTEM = 1_764_000_000.0
"""The system's time then."""

OLD = [
    start(100), end(140, outcome="canceled"), start(150, "Book"),
    end(190, "Book", outcome="canceled"),
]  # fmt: skip


def tick(t):
    return Tick(**at(t, topic="clock"))


def logged(events, log):
    """Events with log times that a function makes of their stamps (s)."""
    return [dataclasses.replace(event, log_ns=ns(log(event.t_ns * 1e-9))) for event in events]


def live():
    """A drive to the mug from 1202 s to 1204 s, of 0.4 m."""
    ticks = [tick(BEGIN + i / 10) for i in range(80)]
    parts = [*ticks, *drive(BEGIN + 0.02, *[MOVE] * 6), start(1202), end(1204)]
    return sorted(parts, key=lambda event: event.t_ns)


def at_once(log):
    """The old messages, all at one log time (s)."""
    return logged(OLD, lambda _: log)


RECORDED = {
    "0 until the clock is heard": lambda: [*at_once(0.0), *live()],
    "in simulated time": lambda: [*at_once(BEGIN + 0.005), *live()],
    "in simulated time ten times as fast, where they come late": lambda: sorted(
        [*at_once(BEGIN + 1.8), *live()], key=lambda event: event.log_ns
    ),
    "in the system's time": lambda: [
        *at_once(SYSTEM), *logged(live(), lambda t: SYSTEM + 0.1 + t - BEGIN)
    ],
    "in the system's time, without the clock": lambda: [
        *at_once(SYSTEM),
        *logged([e for e in live() if not isinstance(e, Tick)], lambda t: SYSTEM + t - BEGIN),
    ],
}  # fmt: skip


@pytest.mark.parametrize("how", RECORDED)
def test_episodes_from_before_the_recording_are_no_drives(how):
    (only,), notes = drives_of(RECORDED[how](), sort=False)
    assert (only.goal, only.outcome, only.notes) == ("Mug", "done", ())
    assert only.seconds == pytest.approx(2.0)
    assert only.path_length_m == pytest.approx(0.4, abs=0.011)
    assert notes == [
        "The episode of Mug was over before the recording began.",
        "The episode of Book was over before the recording began.",
    ]


@pytest.mark.parametrize("how", RECORDED)
def test_a_bag_without_an_episode_of_its_own_is_judged_from_where_it_begins(how):
    own = {ns(1202), ns(1204)}
    events = [e for e in RECORDED[how]() if e.topic != "policy/episode" or e.t_ns not in own]
    (only,), notes = drives_of(events, sort=False)
    assert (only.found, only.goal) == (BAG, "")
    assert only.seconds == pytest.approx(6.0, abs=0.15)
    assert len(notes) == 2


def test_an_episode_that_runs_when_the_clock_is_heard_counts_from_there():
    events = [*logged([*OLD, start(1190, "Pen")], lambda _: 0.0), *live()[:30], end(1201, "Pen")]
    (only,), notes = drives_of(events, sort=False)
    assert (only.goal, only.outcome, only.start_ns) == ("Pen", "done", ns(BEGIN))
    assert only.notes == ("The episode began before the recording did.",)
    assert len(notes) == 2


def test_an_old_start_without_its_end_is_no_drive_either():
    starts = [start(100), start(150, "Book"), start(1190, "Pen")]
    events = [*logged(starts, lambda _: 0.0), *live()[:30], end(1201, "Pen")]
    (only,), notes = drives_of(events, sort=False)
    assert (only.goal, only.outcome) == ("Pen", "done")
    assert ["Mug" in notes[0], "Book" in notes[1], len(notes)] == [True, True, 2]


def test_a_drive_before_the_clock_was_heard_is_a_drive():
    parts = logged([pose(99), start(100), *drive(100, *[MOVE] * 3), end(103)], lambda _: 0.0)
    (only,), notes = drives_of([*parts, tick(110), pose(111)], sort=False)
    assert (only.goal, only.seconds, notes) == ("Mug", pytest.approx(3.0), [])
    assert only.path_length_m == pytest.approx(0.6, abs=0.011)


def test_a_simulation_that_begins_again_is_no_reason_to_call_its_episodes_old():
    again = [tick(1), pose(1), start(2), *drive(2, *[MOVE] * 3), end(5), pose(7)]
    found, notes = drives_of([*live(), *again], sort=False)
    assert [drive_.seconds for drive_ in found] == [pytest.approx(2.0), pytest.approx(3.0)]
    assert notes == []


def test_a_log_that_stands_at_zero_keeps_its_drives():
    poses = [pose(100 + i / 1000) for i in range(MOST_HELD + 100)]
    events = [pose(99), start(100), *poses, end(105), pose(107)]
    (only,), _ = drives_of(logged(events, lambda _: 0.0), sort=False)
    assert (only.goal, only.seconds) == ("Mug", pytest.approx(5.0))


def test_a_bag_of_such_a_recorder_has_one_drive(tmp_path):
    bag = bag_of(tmp_path / "bag", RECORDED["0 until the clock is heard"]())
    found = evaluate(bag, JudgeOptions())
    assert [(d.drive.goal, d.outcome.outcome) for d in found.drives] == [("Mug", "done")]
    assert sum("over before the recording began" in note for note in found.notes) == 2
    assert not found.damaged
