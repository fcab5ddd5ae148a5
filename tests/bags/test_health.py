"""What watching a bag's topics finds in streams made by hand."""

import dataclasses

import numpy as np
import pytest
from cfnav_ros.bags.files.events import LaserTurn, Picture, Tick, Told, Unreadable
from cfnav_ros.bags.health.health import TREATED, Health
from cfnav_ros.bags.health.topic_watch import MOST_INTERVALS, MOST_REASONS, Intervals
from cfnav_ros.lidar.estimate import Scan, Verdict

from tests.bags.made import at, judged, ns, pose, start

BEGIN = 100.0


def picture(t, shade, log=None, kind=bytes):
    data = np.full(30, shade % 256, np.uint8)
    data = data if kind is np.ndarray else kind(data.tobytes())
    return Picture(**at(t, log, "image"), data=data, decode=lambda: np.zeros((1, 1, 3), np.uint8))


def turn(t, ranges, log=None):
    scan = Scan(np.asarray(ranges, np.float32), 0.0, 6.28, 0.01, 0.15, 12.0, "rplidar_link")
    return LaserTurn(**at(t, log, "scan"), scan=scan)


def watched(*events):
    """Findings and topics of events, sorted by log time after one that begins the bag."""
    health = Health()
    for event in sorted([start(BEGIN), *events], key=lambda e: e.log_ns):
        health.see(event)
    for finding in health.findings():
        assert finding.text.endswith((".", "reasons"))
        assert finding.treated in TREATED.values()
        assert finding.start <= finding.end
    return health.findings(), {f.topic: f for f in health.topics()}


def poses(begin, seconds, v=0.0, hz=20):
    return [pose(begin + i / hz, v * i / hz, v=v) for i in range(round(seconds * hz))]


def test_a_sound_bag_has_figures_and_no_findings():
    pictures = [picture(100.5 + i / 10, i) for i in range(100)]
    findings, topics = watched(*poses(100, 10, 0.2), *pictures)
    assert findings == ()
    assert topics["odom"].messages == 200
    assert topics["odom"].rate == pytest.approx(20.0)
    assert topics["odom"].longest_gap == pytest.approx(0.05)
    assert (topics["image"].first, topics["image"].last) == (
        pytest.approx(0.5),
        pytest.approx(10.4),
    )


def test_gaps_are_found_by_the_robots_own_limits_and_merged():
    times = [100.0, 100.2, 100.6, 101.0, 101.2, *np.arange(101.3, 109.95, 0.1), 112.0]
    (first, last), topics = watched(*(pose(t) for t in times))
    assert (first.kind, first.count) == ("gap", 2)
    assert (first.start, first.end) == (pytest.approx(0.2), pytest.approx(1.0))
    assert (last.start, last.end) == (pytest.approx(9.9), pytest.approx(12.0))
    assert "2.10 s" in last.text
    assert "straight" in last.treated
    assert topics["odom"].longest_gap == pytest.approx(2.1)


def test_silence_of_what_speaks_on_occasion_is_no_gap():
    assert watched(start(150.0))[0] == ()


def test_a_sensor_that_dies_or_comes_late_is_found():
    pictures = [picture(100.5 + i / 10, i) for i in range(100)]
    (finding,), topics = watched(*poses(100, 100), *pictures)
    assert (finding.kind, finding.topic) == ("gap", "image")
    assert (finding.start, finding.end) == (pytest.approx(10.4), pytest.approx(99.95))
    assert finding.text == "No message that could be read for 89.55 s, until the bag ends."
    assert finding.treated == TREATED["gap of Picture"]
    assert topics["image"].longest_gap == pytest.approx(89.55)
    assert topics["image"].rate == pytest.approx(10.0)
    late = [picture(150 + i / 10, i) for i in range(500)]
    (finding,), _ = watched(*poses(100, 100), *late)
    assert (finding.start, finding.end) == (0.0, pytest.approx(50.0))
    assert "after the bag begins" in finding.text
    early = [dataclasses.replace(picture(100, 0), log_ns=0)]  # before node time was known
    (finding,), _ = watched(*poses(100, 100), *early)
    assert (finding.start, finding.end) == (0.0, pytest.approx(99.95))


def test_what_is_latched_or_made_again_has_no_beginning_and_no_end():
    again = [judged(100 + i / 10) for i in range(20)]
    assert watched(*poses(100, 100), start(101), *again)[0] == ()
    recorded = [dataclasses.replace(j, topic="/collision/estimate") for j in again]
    assert [f.topic for f in watched(*poses(100, 100), *recorded)[0]] == ["/collision/estimate"]


def test_a_bag_that_leaps_back_ends_where_its_last_run_does():
    health = Health()
    for event in [*poses(100, 90), *poses(100, 10)]:
        health.see(event)
    assert "gap" not in {f.kind for f in health.findings()}


def test_a_topic_without_a_message_is_a_finding_and_a_row():
    health = Health({"/image": Picture})
    for event in poses(100, 20):
        health.see(event)
    (finding,) = health.findings()
    assert (finding.kind, finding.topic, finding.start) == ("silent", "/image", 0.0)
    assert finding.end == pytest.approx(19.95)
    assert finding.treated == "Nothing can be replayed."
    assert [(t.topic, t.kind, t.messages) for t in health.topics()] == [
        ("/image", "Picture", 0), ("odom", "Pose", 400),
    ]  # fmt: skip


def test_stamps_that_go_back_repeat_or_are_unset():
    events = [pose(t) for t in np.arange(100, 110, 0.1)]
    events[30] = dataclasses.replace(events[30], t_ns=events[30].t_ns - ns(0.2))
    events[60] = dataclasses.replace(events[60], t_ns=events[59].t_ns)
    events[90] = dataclasses.replace(events[90], t_ns=0)
    findings, _ = watched(*events)
    assert [(f.kind, round(f.start, 2)) for f in findings] == [
        ("backward", 3.0), ("repeated", 6.0), ("unstamped", 9.0),
    ]  # fmt: skip
    assert "0.100 s" in findings[0].text


def test_messages_that_come_late_or_are_ahead_of_their_time():
    # The recorder stood for half a second.
    late = [pose(100 + i / 10, log=103.4 if 30 <= i < 34 else 100 + i / 10) for i in range(100)]
    gap, finding = watched(*late)[0]
    assert (gap.kind, gap.count) == ("gap", 1)
    assert (finding.kind, finding.count) == ("late", 2)
    assert "0.40 s later" in finding.text
    ahead = [pose(100 + i / 10 + 0.7 * (i == 50), log=100 + i / 10) for i in range(100)]
    kinds = {f.kind for f in watched(*ahead)[0]}
    assert kinds == {"ahead", "backward"}


def test_a_clock_that_is_off_by_a_constant_is_named_as_such_once_for_all_its_topics():
    events = [pose(60 + i / 10, log=100 + i / 10) for i in range(100)]
    events += [picture(60 + i / 10, i, log=100 + i / 10) for i in range(100)]
    events += [judged(100 + i / 10) for i in range(100)]
    (finding,), _ = watched(*events)
    assert finding.kind == "clock"
    assert set(finding.topic.split(", ")) == {"odom", "image"}
    assert "constantly 40.0 s behind" in finding.text
    assert "Log times are used" in finding.treated
    assert finding.end == pytest.approx(9.9)


def test_simulated_stamps_in_a_system_time_log_are_named():
    system = 1.7e9
    events = [pose(50 + i / 20, log=system + i / 10) for i in range(200)]
    health = Health()
    for event in events:
        health.see(event)
    (finding,) = (f for f in health.findings() if f.kind == "clock")
    assert "one of both runs faster" in finding.text
    health = Health()
    for i in range(100):
        health.see(pose(50 + i / 10, log=system + i / 10))
    assert "one is simulated time" in health.findings()[0].text


def test_one_latched_message_makes_no_other_clock():
    events = [pose(40, log=100.01), *poses(100.1, 5)]
    assert watched(*events)[0] == ()


def test_blind_and_degraded_estimates_by_reason_with_their_share_of_time():
    events = [judged(100 + i / 10) for i in range(60)]
    events += [judged(106 + i / 10, 0.0, Verdict.BLIND, 1.0, f"{i}% return.") for i in range(20)]
    events += [judged(108 + i / 10, 0.5, Verdict.DEGRADED, 0.2, "Ghosts.") for i in range(20)]
    events += [judged(110.0)]
    (blind, degraded), topics = watched(*events)
    assert (blind.kind, blind.count) == ("blind", 20)
    assert (blind.start, blind.end) == (pytest.approx(6.0), pytest.approx(8.0))
    assert blind.text == "BLIND for 2.0 s (20.0% of the time): 0% return."
    assert (degraded.kind, degraded.count) == ("degraded", 20)
    verdicts = topics["collision/estimate"].verdicts
    assert verdicts == {
        "GOOD": pytest.approx(6.0), "BLIND": pytest.approx(2.0), "DEGRADED": pytest.approx(2.0),
    }  # fmt: skip


def test_an_estimate_holds_no_longer_than_the_robot_would_believe_it():
    events = [judged(100, 0.0, Verdict.BLIND, 1.0, "Dark."), judged(160), judged(160.1)]
    verdicts = watched(*events)[1]["collision/estimate"].verdicts
    assert verdicts == {"BLIND": 0.5, "GOOD": pytest.approx(0.1)}


@pytest.mark.parametrize("kind", [bytes, memoryview, np.ndarray])
def test_a_picture_repeated_while_the_robot_drives_is_frozen(kind):
    pictures = [picture(100 + i / 10, min(i, 30), kind=kind) for i in range(60)]
    (finding,), _ = watched(*poses(100, 6, 0.2), *pictures)
    assert finding.kind == "frozen pictures"
    assert (finding.start, finding.end) == (pytest.approx(3.0), pytest.approx(5.9))


def test_a_camera_with_noise_is_frozen_at_rest_too_and_one_without_is_not():
    still = poses(100, 10)
    noisy = [picture(100 + i / 10, min(i, 50)) for i in range(100)]
    assert [f.kind for f in watched(*still, *noisy)[0]] == ["frozen pictures"]
    again = [picture(100 + i / 10, min(i, 50), log=100.01 + i / 10) for i in range(100)]
    assert "frozen pictures" in {f.kind for f in watched(*still, *noisy, *again)[0]}
    clean = [picture(100 + i / 10, 7) for i in range(100)]
    assert watched(*still, *clean)[0] == ()


def test_a_short_repetition_and_the_same_picture_sent_twice_are_not_frozen():
    short = [picture(100 + i / 10, i - 5 * (30 <= i < 36)) for i in range(60)]
    assert watched(*poses(100, 6, 0.2), *short)[0] == ()
    twice = [picture(100.0, 7, log=100 + i / 10) for i in range(50)]
    kinds = {f.kind for f in watched(*poses(100, 5, 0.2), *twice)[0]}
    assert "frozen pictures" not in kinds


def test_a_scan_repeated_while_the_robot_drives_is_frozen_nan_or_not():
    ranges = [1.0, np.nan, np.inf]
    turns = [turn(100 + i / 8, [*ranges, min(i, 20)]) for i in range(60)]
    (finding,), _ = watched(*poses(100, 7.5, 0.2), *turns)
    assert finding.kind == "frozen scans"
    assert finding.start == pytest.approx(2.5)


def test_messages_that_cannot_be_read_are_counted_by_reason():
    bad = [
        Unreadable(**at(101 + i, topic="image"), reason=f"It holds {i} bytes.") for i in range(9)
    ]
    bad += [Unreadable(**at(105, topic="image"), reason="It is encoded as 'yuv'.")]
    findings, _ = watched(*bad)
    assert [(f.kind, f.count) for f in findings] == [("unreadable", 9), ("unreadable", 1)]
    assert findings[0].text == "9 messages cannot be read: It holds 0 bytes."


def test_a_clock_that_jumps_back_is_found():
    ticks = [Tick(t_ns=ns(t), log_ns=ns(100 + i), topic="/clock") for i, t in enumerate((5, 6, 2))]
    (finding,), _ = watched(*ticks)
    assert (finding.kind, finding.start) == ("clock jump", 2.0)
    assert "4.00 s" in finding.text


def test_a_sick_bag_needs_no_more_memory_than_a_sound_one():
    health = Health()
    health.see(start(BEGIN))
    for i in range(3000):
        health.see(pose(100 + 0.2 * i + 2.0 * (i // 10)))
        words = chr(97 + i % 26) * (i % 60 + 1)
        health.see(Unreadable(**at(100 + 0.39 * i, topic="image"), reason=f"No {words}."))
    findings = health.findings()
    gaps = [f for f in findings if f.kind == "gap"]
    assert len(gaps) == MOST_INTERVALS + 1
    assert sum(f.count for f in gaps) == 299
    reasons = [f for f in findings if f.kind == "unreadable"]
    assert len(reasons) == MOST_REASONS + 1
    assert sum(f.count for f in reasons) == 3000


def test_events_before_the_first_clock_message_have_no_time():
    early = [Told(**{**vars(start(0)), "log_ns": 0}), dataclasses.replace(pose(100), log_ns=0)]
    health = Health()
    for event in [*early, *poses(100, 2)]:
        health.see(event)
    assert health.findings()[0].kind == "repeated"
    (topic,) = (t for t in health.topics() if t.topic == "odom")
    assert (topic.messages, topic.first, topic.last) == (41, 0.0, pytest.approx(1.95))


def test_intervals_merge_and_are_counted():
    found = Intervals(most=2, join=1.0)
    for begin, finish, size in ((0, 1, 3.0), (1.5, 2, 5.0), (4, 5, 1.0), (9, 10, 1.0)):
        found.add(begin, finish, size)
    assert [(i.start, i.end, i.low, i.high, i.count) for i in found.kept] == [
        (0, 2, 3.0, 5.0, 2), (4, 5, 1.0, 1.0, 1),
    ]  # fmt: skip
    assert found.more == 1
