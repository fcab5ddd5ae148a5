"""Estimates made again from recorded scans: what the live node would have said, and when."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from cfnav_ros.bags.files.events import Event, Frames, LaserTurn, Pose, Tick
from cfnav_ros.bags.replay.estimates import (
    AHEAD_NS,
    KEEP_NS,
    LEAP_NS,
    MOST_KEPT,
    Estimates,
    as_published,
)
from cfnav_ros.lidar.estimate import SweptDisc, Verdict, estimate_collision
from cfnav_ros.lidar.scan_watch import LidarParameters

from tests.ros.lidar_scans import behind_posts, noisy, room, scan_of, wall_ahead

SCAN = behind_posts(scan_of(room))
PERIOD_NS, MS, S = 130_000_000, 1_000_000, 1_000_000_000
START = 100 * S


def turns(count, start_ns=START, base=SCAN, late_ns=0, seed=0):
    """Scans that are recorded when their turn is over; the stamp is its beginning."""
    rng = np.random.default_rng(seed)
    stamps = [start_ns + k * PERIOD_NS for k in range(count)]
    return [
        LaserTurn(t_ns=t, log_ns=t + PERIOD_NS + late_ns, scan=noisy(base, rng)) for t in stamps
    ]


def beat(first_ns, last_ns, step_ns=50 * MS):
    """Other messages, such as odometry's."""
    return [Event(t_ns=t, log_ns=t) for t in range(first_ns, last_ns, step_ns)]


def judged(events, estimates=None):
    estimates = estimates or Estimates()
    return [found for event in events for found in estimates.see(event)]


def test_a_scan_gives_the_nodes_estimate_under_its_stamp():
    (found,) = judged(turns(1))
    expected = as_published(estimate_collision(turns(1)[0].scan))
    assert (found.t_ns, found.log_ns) == (START, START + PERIOD_NS)
    assert found.estimate == expected
    assert np.float32(found.estimate.probability) == found.estimate.probability


def test_a_stream_of_scans_is_one_estimate_each():
    found = judged(sorted(turns(50) + beat(START, START + 7 * S), key=lambda e: e.log_ns))
    first = [f for f in found if f.t_ns < START + PERIOD_NS and f.estimate.verdict is Verdict.BLIND]
    assert {f.estimate.reason for f in first} == {"No scan has arrived."}
    rest = [f for f in found if f.t_ns >= START and f not in first and f.log_ns < START + 6 * S]
    assert [f.t_ns for f in rest] == [t.t_ns for t in turns(50) if t.log_ns < START + 6 * S]


def test_a_silent_scanner_is_blind_at_the_live_rules_times():
    events = turns(3) + beat(START + 4 * PERIOD_NS, START + 3 * S)
    blind = [f for f in judged(events) if f.estimate.verdict is Verdict.BLIND]
    ended = (START + 2 * PERIOD_NS + PERIOD_NS) / S
    # older than 0.4 s from its end, then ten times a second, stamped when it was said
    assert 0.4 < blind[0].t_ns / S - ended <= 0.5
    assert {b.t_ns - a.t_ns for a, b in pairwise(blind)} == {100 * MS}
    assert blind[0].estimate.reason.startswith("The newest scan is 0.4")
    assert START + 3 * S - blind[-1].t_ns <= 150 * MS


def test_a_late_scan_is_blind_and_stamped_when_it_came():
    (found,) = judged(turns(1, late_ns=600 * MS))
    assert found.estimate.verdict is Verdict.BLIND
    assert found.t_ns == START + PERIOD_NS + 600 * MS


def test_the_nodes_time_is_that_of_clock_where_the_bag_has_it():
    """Recorded in system time, driven in simulated time: nothing is late."""
    scans = [dataclasses.replace(s, log_ns=s.log_ns + 10**18) for s in turns(20)]
    ticks = [
        Tick(t_ns=s.t_ns + PERIOD_NS, log_ns=s.log_ns - 1) for s in scans
    ]  # fmt: skip
    both = [e for pair in zip(ticks, scans, strict=True) for e in pair]
    assert {f.estimate.verdict for f in judged(both)} == {Verdict.GOOD}
    assert Verdict.GOOD not in {f.estimate.verdict for f in judged(scans)}


def test_a_leap_in_time_is_not_filled():
    far = Event(t_ns=0, log_ns=10**18)
    found = judged([*turns(2), far])
    assert len(found) < 2 + LEAP_NS // (100 * MS) + 2
    assert (found[-1].t_ns, found[-1].estimate.verdict) == (10**18, Verdict.BLIND)


def test_time_that_goes_back_is_followed():
    again = turns(3, start_ns=START - 50 * S, seed=1)
    found = judged(turns(3) + again)
    assert found[-1].estimate.verdict is Verdict.GOOD
    assert found[-1].t_ns == again[-1].t_ns


def tf(x, yaw, topic="/tf_static", child="rplidar_link"):
    q = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return Frames(
        t_ns=START, log_ns=START, topic=topic,
        transforms=(("base_link", child, (x, 0.0, 0.19), q),),
    )  # fmt: skip


def test_the_mounting_comes_from_the_bags_frames():
    near = behind_posts(scan_of(wall_ahead(0.4)))
    turn = LaserTurn(t_ns=START, log_ns=START + PERIOD_NS, scan=near)
    probability = [
        judged([*frames, turn])[-1].estimate.probability
        for frames in ([], [tf(-0.04, math.pi / 2)], [tf(0.2, math.pi / 2)])
    ]
    assert probability[0] == probability[1]
    assert probability[2] < probability[0] - 0.1  # mounted further ahead, the wall is further off


def test_two_places_of_which_one_is_said_for_good_are_as_blind_as_the_node():
    turn = turns(1)[0]
    both = [tf(-0.04, math.pi / 2), tf(-0.03, math.pi / 2)]
    estimate = judged([*both, turn])[-1].estimate
    assert estimate.verdict is Verdict.BLIND
    assert "TF has two places for rplidar_link" in estimate.reason


def test_parameters_that_contradict_the_frames_are_told():
    turn = turns(1)[0]
    given = Estimates(mount_given=True)
    estimate = judged([tf(0.3, math.pi / 2), turn], given)[-1].estimate
    assert estimate.verdict is Verdict.BLIND
    assert "TF puts the LiDAR at" in estimate.reason
    only = Estimates(LidarParameters(mount="parameters"))
    assert judged([tf(0.3, 0.0), turn], only)[-1].estimate.verdict is Verdict.GOOD


def test_what_moves_on_tf_no_longer_matters_once_the_way_is_known():
    events = [tf(-0.04, math.pi / 2), turns(2)[0], tf(0.3, 0.0, "/tf"), turns(2)[1]]
    found = judged(events)
    assert found[-1].t_ns == events[-1].t_ns
    assert found[-1].estimate.clearance == pytest.approx(found[-2].estimate.clearance, abs=0.1)


def test_a_scanner_in_another_frame_is_blind_as_live():
    other = dataclasses.replace(turns(1)[0], scan=dataclasses.replace(SCAN, frame="laser"))
    assert "expected 'rplidar_link'" in judged([other])[0].estimate.reason
    any_frame = LidarParameters(frame="")
    nobody = judged([other], Estimates(any_frame))[0].estimate
    assert nobody.reason.startswith("Nobody says where the LiDAR of frame 'laser' sits")
    given = judged([other], Estimates(any_frame, mount_given=True))[0].estimate
    assert given.verdict is Verdict.GOOD


def test_the_disc_of_the_parameters_judges():
    near = behind_posts(scan_of(wall_ahead(0.6)))
    turn = LaserTurn(t_ns=START, log_ns=START + PERIOD_NS, scan=near)
    wide = LidarParameters(disc=SweptDisc(radius=0.4))
    assert judged([turn])[0].estimate.probability < 0.2
    assert judged([turn], Estimates(wide))[0].estimate.probability > 0.9


def test_estimates_are_found_by_the_stamp_of_their_scan_or_when_blind():
    estimates = Estimates()
    found = judged(turns(3) + beat(START + 4 * PERIOD_NS, START + 2 * S), estimates)
    assert estimates.made_from(START + PERIOD_NS) == found[1]
    assert estimates.made_from(START + 1) is None
    assert estimates.blind_at(START + 3 * PERIOD_NS) is None
    first = next(f for f in found if f.estimate.verdict is Verdict.BLIND)
    assert estimates.blind_at(first.t_ns - 30 * MS) == first  # the live timer fired a little before
    assert estimates.made_from(first.t_ns) is None
    assert estimates.newest[1] == found[-1]


def test_memory_is_bounded():
    estimates = Estimates()
    judged(turns(300), estimates)
    assert estimates.made_from(START) is None
    assert estimates.made_from(START + 299 * PERIOD_NS) is not None
    assert len(estimates._kept) <= min(MOST_KEPT, KEEP_NS // PERIOD_NS + 1)


def pose(t_ns):
    return Pose(t_ns=t_ns, log_ns=t_ns, x=0.0, y=0.0, yaw=0.0, v=0.0, w=0.0)


@pytest.mark.parametrize(("late_ns", "sees"), [(0, True), (900 * MS, True), (AHEAD_NS + S, False)])
def test_where_the_clock_was_recorded_late_odometry_tells_the_time(late_ns, sees):
    """A scan is from the future only for who believes a clock that lags."""
    events = []
    for turn in turns(5):
        now = turn.t_ns + PERIOD_NS
        events += [Tick(t_ns=now - late_ns, log_ns=now - late_ns), pose(now), turn]
    estimates = Estimates()
    judged(events, estimates)
    made = [estimates.made_from(turn.t_ns) for turn in turns(5)]
    assert [m is not None and m.estimate.verdict is Verdict.GOOD for m in made] == [sees] * 5
