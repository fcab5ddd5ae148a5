"""When faults begin and end, and which messages feel it."""

import pytest
from sim_bridge.faults.faults import EVERYTHING, FAULTS
from sim_bridge.faults.outbox import Outbox
from sim_bridge.faults.robot_clock import RobotClock
from sim_bridge.faults.schedule import FaultOrder, FaultSchedule, read_schedule
from sim_bridge.robot.base import TrueMotion

from cfnav_core.robot.topics import TOPICS

REST = TrueMotion(0.0, 0.0, 0.0)


def run(schedule, seconds, motion=REST, start=0.0):
    """Changes with the times at which they happen."""
    changes = []
    for step in range(round(seconds * 100)):
        t = start + step * 0.01
        now = motion(t) if callable(motion) else motion
        changes += [(round(t, 2), *change) for change in schedule.update(t, now)]
    return changes


def test_fault_holds_from_its_time_for_its_duration():
    schedule = FaultSchedule(
        [FaultOrder("e_stop", at=0.5, duration=0.25), FaultOrder("docked", at=0.7)]
    )
    assert run(schedule, 0.6) == [(0.5, "e_stop", True)]
    assert schedule.active == {"e_stop"}
    assert run(schedule, 0.6, start=0.6) == [(0.7, "docked", True), (0.75, "e_stop", False)]
    assert schedule.active == {"docked"}


@pytest.mark.parametrize(
    ("when", "motion", "begins"),
    [
        ("now", REST, 0.0),
        ("driving", lambda t: TrueMotion(t, 0.0, None), 0.11),
        ("driving", lambda t: TrueMotion(-t, 0.0, None), 0.11),
        ("turning", lambda t: TrueMotion(0.0, -t, None), 0.31),
        ("standing", lambda t: TrueMotion(0.0, 0.0, 0.05 if t >= 0.05 else None), 0.25),
    ],
)
def test_fault_waits_for_the_motion(when, motion, begins):
    schedule = FaultSchedule([FaultOrder("base_stuck", when=when)])
    assert run(schedule, 0.5, motion) == [(begins, "base_stuck", True)]


@pytest.mark.parametrize("when", ["driving", "turning"])
def test_fault_that_waits_for_a_motion_does_not_begin_at_rest(when):
    assert run(FaultSchedule([FaultOrder("base_stuck", when=when)]), 1.0) == []


def test_table_ends_what_lasts_a_fixed_time():
    schedule = FaultSchedule()
    schedule.order(FaultOrder("network_cut_1", duration=5.0))
    schedule.order(FaultOrder("base_pushed"))
    assert run(schedule, 2.0) == [
        (0.0, "network_cut_1", True),
        (0.0, "base_pushed", True),
        (0.5, "base_pushed", False),
        (1.0, "network_cut_1", False),
    ]


def test_mending_ends_one_or_all_and_ordering_again_begins_anew():
    schedule = FaultSchedule(
        [FaultOrder("docked"), FaultOrder("e_stop"), FaultOrder("tilt_stuck", at=9.0)]
    )
    run(schedule, 0.1)
    schedule.order(FaultOrder("docked"))
    assert schedule.update(0.2, REST) == [("docked", False), ("docked", True)]
    schedule.mend("docked")
    assert schedule.update(0.3, REST) == [("docked", False)]
    schedule.mend("")
    assert schedule.update(0.4, REST) == [("e_stop", False)]
    assert run(schedule, 10.0) == []


def test_fault_that_begins_anew_by_schedule_ends_first():
    schedule = FaultSchedule(
        [FaultOrder("clock_stop"), FaultOrder("clock_stop", at=0.1, duration=0.1)]
    )
    assert run(schedule, 0.3) == [
        (0.0, "clock_stop", True),
        (0.1, "clock_stop", False),
        (0.1, "clock_stop", True),
        (0.2, "clock_stop", False),
    ]


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"fault": "gremlins"}, "'gremlins' is unknown; known are scan_silent"),
        ({"fault": "e_stop", "when": "flying"}, "expected one of now, driving"),
        ({"fault": "e_stop", "duration": -1.0}, "expected s, 0 or more"),
        ({"fault": "e_stop", "at": float("nan")}, "expected s, 0 or more"),
        ({"fault": "e_stop", "at": "soon"}, "expected s, 0 or more"),
    ],
)
def test_order_that_makes_no_sense_is_one_sentence(order, words):
    with pytest.raises(ValueError, match=words):
        FaultOrder(**order)
    if "when" not in order:
        with pytest.raises(ValueError, match="unknown"):
            FaultSchedule().mend("gremlins")


def test_schedule_file_holds_orders(tmp_path):
    path = tmp_path / "faults.yaml"
    path.write_text(
        "- {fault: scan_silent, at: 2, duration: 1.5}\n- {fault: e_stop, when: driving}"
    )
    assert read_schedule(str(path)) == [
        FaultOrder("scan_silent", at=2, duration=1.5),
        FaultOrder("e_stop", when="driving"),
    ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("fault: e_stop", "holds no list"),
        ("- e_stop", "has the row e_stop"),
        ("- {fault: e_stop, until: 3}", "expected fault, when, at, duration"),
        ("- {fault: gremlins}", "unknown"),
        ("- {fault: [e_stop]}", "unknown"),
        ("- {fault: e_stop", "is no YAML file"),
        (None, "cannot be read"),
    ],
)
def test_bad_schedule_file_is_one_sentence(tmp_path, text, words):
    path = tmp_path / "faults.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=words) as caught:
        read_schedule(str(path))
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def sent_by(faults, *, messages, latency=0.0):
    """Times at which messages made at given times are sent while faults hold from 0 on."""
    schedule = FaultSchedule([FaultOrder(name) for name in faults])
    outbox, sent = Outbox(schedule), []
    for step in range(1000):
        t = step * 0.01
        schedule.update(t, REST)
        for made in messages:
            if round(made * 100) == step:
                outbox.put("scan", made, lambda m, t=t: sent.append(m), t, latency)
        before = len(sent)
        outbox.release(t)
        sent[before:] = [(m, round(t, 2)) for m in sent[before:]]
    return sent


def test_messages_are_sent_at_once_or_after_their_latency():
    assert sent_by([], messages=[0.0, 0.5]) == [(0.0, 0.0), (0.5, 0.5)]
    assert sent_by([], messages=[0.0, 0.5], latency=0.06) == [(0.0, 0.06), (0.5, 0.56)]


def test_delays_add_up_and_lost_messages_are_never_sent():
    assert sent_by(["scan_late_0.5"], messages=[1.0], latency=0.1) == [(1.0, 1.6)]
    assert sent_by(["scan_late_0.2", "scan_late_1"], messages=[1.0]) == [(1.0, 2.2)]
    assert sent_by(["scan_silent"], messages=[1.0]) == []
    assert sent_by(["odom_silent"], messages=[1.0]) == [(1.0, 1.0)]


def test_cut_network_passes_nothing_for_a_second():
    times = [step / 10 for step in range(20)]
    assert sent_by(["network_cut_1"], messages=times) == [(t, t) for t in times if t >= 1.0]


def test_no_message_overtakes_another_when_a_delay_ends():
    schedule = FaultSchedule([FaultOrder("scan_late_1", duration=0.5)])
    outbox, sent = Outbox(schedule), []
    for step in range(300):
        t = step * 0.01
        schedule.update(t, REST)
        if step % 20 == 0:
            outbox.put("scan", step, sent.append, t)
        outbox.release(t)
    assert sent == sorted(sent)
    assert len(sent) == 15


def test_share_of_lost_commands_repeats_itself_for_a_seed():
    def kept(seed):
        schedule = FaultSchedule([FaultOrder("cmd_loss_30")], seed)
        schedule.update(0.0, REST)
        return [schedule.pass_on("cmd_vel", (0.1, 0.0), 0.0)[0] is not None for _ in range(4000)]

    assert kept(1) == kept(1) != kept(2)
    schedule = FaultSchedule([FaultOrder("cmd_loss_30")], 5)
    schedule.update(0.0, REST)
    rows = []
    for _ in range(2):
        schedule.reseed(1)
        rows.append([schedule.pass_on("cmd_vel", 1, 0.0)[0] for _ in range(50)])
    assert rows[0] == rows[1]
    assert sum(kept(1)) / 4000 == pytest.approx(0.7, abs=0.03)


def test_broken_clock_jumps_stands_and_recovers():
    clock = RobotClock()
    assert clock(20.0) == 20.0
    clock.take_faults(frozenset({"clock_ahead"}), 20.0)
    assert clock(21.0) == 31.0
    clock.take_faults(frozenset({"clock_back"}), 21.0)
    assert (clock(22.0), clock(3.0)) == (12.0, 0.0)
    clock.take_faults(frozenset({"clock_stop"}), 22.0)
    assert (clock.stopped_at, clock(25.0)) == (12.0, 12.0)
    clock.take_faults(frozenset(), 26.0)
    assert (clock(26.0), clock.true(26.0)) == (26.0, 26.0)


def test_clock_that_shows_little_jumps_back_to_zero_and_runs_on():
    clock = RobotClock()
    clock.take_faults(frozenset({"clock_back"}), 3.0)
    assert [clock(t) for t in (3.0, 3.5, 20.0)] == [0.0, 0.5, 17.0]
    clock.take_faults(frozenset({"clock_back", "e_stop"}), 20.0)
    assert clock(20.0) == 17.0
    clock.take_faults(frozenset({"e_stop"}), 21.0)
    assert clock(21.0) == 21.0
    clock.epoch = 1e6
    clock.take_faults(frozenset({"clock_back"}), 3.0)
    assert clock(3.0) == 1e6 - 7.0


def test_a_fault_names_topics_by_their_roles():
    named = {topic for fault in FAULTS.values() for topic in fault.topics}
    assert named - {EVERYTHING} <= TOPICS.keys()
