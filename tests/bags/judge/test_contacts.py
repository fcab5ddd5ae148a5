"""Each source of contacts against drives made by hand."""

import math

import numpy as np
import pytest
from cfnav_ros.bags.files.events import Pose, Velocity
from cfnav_ros.bags.judge.contacts import (
    BUMP,
    STALL,
    BumpContacts,
    ClearanceContacts,
    Contact,
    TruthContacts,
    Whereabouts,
    observable,
)
from cfnav_ros.bags.judge.stalls import NO_START, StallContacts
from cfnav_ros.lidar.estimate import Verdict

from tests.bags.made import S, bumps, drive, judged, ns, pose, truth, velocity

MOVE = (1.0, 0.2, 0.0, 0.2, 0.0)
REST = (1.0, 0.0, 0.0, 0.0, 0.0)
ROLLS_BACK = (0.25, 0.2, 0.0, -0.2, 0.0)


def stalls(events):
    """The contacts and refusals to start in commands and odometry."""
    detector, where, found = StallContacts(), Whereabouts(), []
    for event in events:
        if isinstance(event, Velocity):
            detector.told(event.t_ns, event)
        elif isinstance(event, Pose):
            where.see(event.t_ns, event)
            found.append(detector.moved(event.t_ns, event, where))
    return [contact for contact in found if contact]


def test_truth_counts_each_rise_of_the_counter_but_not_what_was_there_before():
    detector = TruthContacts()
    samples = [truth(1, hits=2), truth(2, hits=2), truth(3, x=0.5, hits=4, speed=0.19), truth(4)]
    found = [contact for sample in samples if (contact := detector.see(sample))]
    assert [(c.t_ns, c.x, c.count, c.contact_with, c.speed) for c in found] == [
        (3 * S, 0.5, 2, "Chair", 0.19)
    ]


def test_a_bumper_that_is_held_counts_once_and_again_after_it_was_free():
    reports = [bumps(0)]
    reports += [bumps(1 + i / 20, "front_left", *["front"] * (i > 5)) for i in range(40)]
    reports += [bumps(3 + i / 20) for i in range(20)]
    reports += [bumps(4, "front")]
    detector, where = BumpContacts(), Whereabouts()
    where.see(ns(0.9), pose(0.9, x=0.4, v=0.2))
    found = [c for r in reports if (c := detector.see(r.t_ns, r, where))]
    assert [(c.t_ns, c.contact_with, c.speed) for c in found] == [
        (1 * S, "front_left", 0.2),
        (4 * S, "front", None),
    ]
    assert (found[0].x, found[0].source) == (0.4, BUMP)


def test_a_bumper_that_tells_of_changes_alone_is_held_between_them():
    """As bases do: one touch that moves along the bumper is one, however long it takes."""
    reports = [
        bumps(0), bumps(10, "left"), bumps(12, "left", "front"), bumps(14, "front"), bumps(16),
        bumps(16.2, "front"), bumps(16.3), bumps(18, "left"), bumps(19),
    ]  # fmt: skip
    detector, where = BumpContacts(), Whereabouts()
    found = [c for r in reports if (c := detector.see(r.t_ns, r, where))]
    assert [c.t_ns for c in found] == [10 * S, 18 * S]
    # one that never tells of being free is pressed anew each time
    detector = BumpContacts()
    found = [c for t in (10, 12, 14) if (c := detector.see(ns(t), bumps(t, "left"), where))]
    assert len(found) == 3


def test_a_bumper_pressed_when_the_bag_begins_was_pressed_before():
    detector = BumpContacts()
    reports = [bumps(i / 20, "front") for i in range(40)]
    assert not any(detector.see(r.t_ns, r, Whereabouts()) for r in reports)


@pytest.mark.parametrize(("t", "counts"), [(100.9, False), (101.1, True), (140.0, True)])
def test_a_first_report_of_a_bumper_is_of_before_only_when_the_bag_has_just_begun(t, counts):
    contact = BumpContacts().see(ns(t), bumps(t, "front"), Whereabouts(), ns(100))
    assert (contact is not None) is counts


def test_a_contact_without_odometry_has_no_place_and_no_speed():
    detector = BumpContacts()
    detector.see(0, bumps(0), Whereabouts())
    contact = detector.see(S, bumps(1, "front"), Whereabouts())
    assert contact is not None
    assert math.isnan(contact.x)
    assert contact.speed is None


@pytest.mark.parametrize(
    ("clearances", "count"),
    [
        ([1.0, 0.3, 0.0, 0.0, 0.0], 1),
        ([1.0, 0.0, 0.01, 0.0], 1),  # noise around 0 is one touch
        ([1.0, 0.0, 0.1, 0.0], 2),
        ([0.0, 0.0, 0.0], 0),  # stood there before
        ([1.0, 0.005, 0.001], 0),
    ],
)
def test_clearance_that_falls_to_nothing_is_a_contact(clearances, count):
    detector = ClearanceContacts()
    events = [judged(i, clearance) for i, clearance in enumerate(clearances)]
    assert sum(detector.see(e.t_ns, e, Whereabouts()) is not None for e in events) == count


def test_a_blind_estimate_is_no_contact():
    detector = ClearanceContacts()
    events = [judged(0, 1.0), judged(1, 0.0, Verdict.BLIND, 1.0), judged(2, 0.5)]
    assert not any(detector.see(e.t_ns, e, Whereabouts()) for e in events)


def test_a_base_that_stops_although_it_is_told_to_go_on_has_touched_something():
    (contact,) = stalls(drive(100, MOVE, (1.0, 0.2, 0.0, 0.0, 0.0), REST))
    assert contact.source == STALL
    assert contact.t_ns * 1e-9 == pytest.approx(101.0, abs=0.06)
    assert (contact.x, contact.speed) == (pytest.approx(0.2, abs=0.011), 0.2)


def test_the_executor_gives_up_late_enough_for_the_stall_to_be_seen_at_creeping_speed():
    creep = (1.0, 0.05, 0.0, 0.05, 0.0)
    assert len(stalls(drive(100, creep, (0.6, 0.05, 0.0, 0.0, 0.0), REST))) == 1


@pytest.mark.parametrize(
    "parts",
    [
        [MOVE, REST, MOVE, REST],
        [MOVE, (1.0, 0.0, 0.8, 0.0, 0.8), (1.0, 0.0, -0.8, 0.0, -0.8), MOVE],
        [(3.0, 0.05, 0.0, 0.05, 0.0)],  # creeping
        [MOVE, (0.3, 0.2, 0.0, 0.0, 0.0), REST],  # a late odometry sample or two
        [(0.4, 0.3, 0.0, 0.0, 0.0), (1.0, 0.3, 0.0, 0.25, 0.0)],  # slow to start
        [MOVE, (0.2, -0.2, 0.0, 0.1, 0.0), (1.0, -0.2, 0.0, -0.2, 0.0), ROLLS_BACK, MOVE],
        [(4.0, 0.2, 0.8, 0.2, 0.8)],  # a circle
        [REST, (1.0, 0.0, 0.0, -0.2, 0.0), REST],  # pulled by somebody, never told to drive
    ],
)  # fmt: skip
def test_a_base_that_obeys_touches_nothing(parts):
    assert stalls(drive(100, *parts)) == []


def test_a_base_that_never_starts_is_no_contact_but_is_told():
    (refusal,) = stalls(drive(100, REST, (3.0, 0.2, 0.0, 0.0, 0.0), REST))
    assert refusal.source == NO_START


def test_wheels_that_turn_while_the_pose_stands_are_a_contact_before_the_stall():
    parts = [MOVE, (0.45, 0.2, 0.0, 0.0, 0.0, 0.2), REST]
    events = drive(100, *parts)
    jitter = [
        Pose(**{**vars(e), "x": e.x + 1e-6 * (i % 3)}) if isinstance(e, Pose) else e
        for i, e in enumerate(events)
    ]
    assert [c.source for c in stalls(jitter)] == [STALL]
    # To the last bit the same while it says that it drives: the driver is frozen.
    assert stalls(events) == []


def test_backing_off_by_itself_after_driving_is_a_contact():
    parts = [MOVE, (0.2, 0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, -0.14, 0.0), REST]
    (contact,) = stalls(drive(100, *parts))
    assert (contact.source, contact.x) == (STALL, pytest.approx(0.13, abs=0.05))


def test_pushing_on_against_the_same_thing_is_one_contact():
    again = [(1.0, 0.2, 0.0, 0.0, 0.0), REST, REST, REST]
    found = stalls(drive(100, MOVE, *again, *again, *again))
    assert [c.source for c in found] == [STALL]


@pytest.mark.parametrize("stands", [0.1, 0.8])
def test_each_touch_of_a_base_that_backs_off_by_itself_counts_once(stands):
    touch = [(1.0, 0.2, 0.0, 0.2, 0.0), (stands, 0.2, 0.0, 0.0, 0.0)]
    touch += [(0.5, 0.2, 0.0, -0.14, 0.0)]  # still told to drive ahead
    found = stalls(drive(100, *touch, *touch, *touch, REST))
    assert [c.source for c in found] == [STALL] * 3
    assert np.diff([c.t_ns * 1e-9 for c in found]) == pytest.approx(1.5 + stands, abs=0.11)


def test_a_base_that_creeps_along_what_it_touches_has_one_contact():
    slow = (3.0, 0.2, 0.0, 0.01, 0.0)
    assert len(stalls(drive(100, MOVE, (0.6, 0.2, 0.0, 0.0, 0.0), slow, slow))) == 1


def test_two_things_touched_are_two_contacts():
    hit = (1.0, 0.2, 0.0, 0.0, 0.0)
    back = (1.0, -0.1, 0.0, -0.1, 0.0)
    assert len(stalls(drive(100, MOVE, hit, REST, back, REST, MOVE, hit, REST))) == 2


def test_odometry_that_jumps_or_pauses_is_no_contact():
    before, after = drive(100, MOVE), drive(101, MOVE, x=5.0)
    assert stalls(before + after) == []
    paused = [velocity(101 + i / 20, 0.2) for i in range(60)]
    assert stalls(before + paused + drive(104, MOVE, x=0.2)) == []


def contacts(source, *times):
    return [Contact(ns(t), 0.0, 0.0, source=source) for t in times]


def test_one_touch_is_felt_and_inferred_but_counts_once():
    found = observable(contacts(BUMP, 10, 10.7, 30), contacts(STALL, 8.5, 11.9, 20, 32.5))
    assert [(c.t_ns // S, c.source) for c in found] == [
        (10, BUMP), (10, BUMP), (20, STALL), (30, BUMP), (32, STALL),
    ]  # fmt: skip
