"""Drives found in event streams made by hand."""

import dataclasses
import math
import random
from itertools import pairwise
from pathlib import Path

import pytest
from cfnav_ros.bags.files.events import Frames, Pose, Truth
from cfnav_ros.bags.judge.clocks import Clocks
from cfnav_ros.bags.judge.contacts import BUMP, CLEARANCE, STALL, TRUTH
from cfnav_ros.bags.judge.drive_log import BAG, FILE, POLICY
from cfnav_ros.bags.judge.drives import RECENT, DriveFinder
from cfnav_ros.bags.judge.episodes_file import EpisodeRow, EpisodesError, read_episodes, rows_by_bag
from cfnav_ros.bags.judge.outcomes import live_outcome
from cfnav_ros.drive import outcome

from cfnav_core.task.actions import Action
from tests.bags.made import (
    at,
    bumps,
    decided,
    drive,
    end,
    judged,
    ns,
    pose,
    start,
    told,
    truth,
    velocity,
)

MOVE = (1.0, 0.2, 0.0, 0.2, 0.0)


def drives_of(events, rows=(), sort=True):
    finder = DriveFinder(rows)
    found = []
    for event in sorted(events, key=lambda e: e.log_ns) if sort else events:
        found += finder.see(event)
    return [*found, *finder.finish()], finder.notes


def test_an_episode_of_the_policy_is_a_drive_with_what_happened_in_it_alone():
    events = [pose(100), *drive(101, MOVE, MOVE, MOVE), start(102), end(103), judged(102.5, 0.4)]
    events += [judged(101.5, 0.1), bumps(101), decided(102.1), decided(102.9, 2, Action.Done)]
    (drive_,), notes = drives_of(events)
    assert (drive_.found, drive_.goal, drive_.bundle, drive_.outcome) == (
        POLICY, "Mug", "shipped", "done",
    )  # fmt: skip
    assert drive_.seconds == pytest.approx(1.0)
    assert drive_.path_length_m == pytest.approx(0.2, abs=0.011)
    assert drive_.clearance_m == 0.4
    assert [d.step for d in drive_.decisions] == [1, 2]
    assert set(drive_.contacts) == {BUMP, STALL, CLEARANCE}
    assert (drive_.notes, notes) == ((), [])


def test_drives_are_finished_while_the_bag_goes_on():
    finder = DriveFinder()
    events = [start(101), pose(102), end(103), pose(103.5), pose(104.5)]
    assert [len(finder.see(event)) for event in events] == [0, 0, 0, 0, 1]
    assert finder.finish() == []


def test_what_is_recorded_late_belongs_to_the_drive_by_its_stamp():
    # Logged before the start and after the end, but stamped within, and the other way round.
    events = [
        truth(101.0, 9.0, log=101.0), truth(102.0, 1.0, log=101.9), start(102.0, log=101.95),
        truth(102.5, 2.0), end(103.0), truth(103.0, 3.0, log=103.4), truth(103.1, 9.0),
        truth(110.0, 9.0),
    ]  # fmt: skip
    (drive_,), _ = drives_of(events, sort=False)
    assert [t.x for t in drive_.truths] == [1.0, 2.0, 3.0]
    assert drive_.truth_length_m == pytest.approx(2.0)


def test_a_bag_without_episodes_is_one_drive_without_a_goal():
    (drive_,), _ = drives_of(drive(100, MOVE, (1.0, 0.2, 0.0, 0.0, 0.0)))
    assert (drive_.found, drive_.goal) == (BAG, "")
    assert len(drive_.contacts[STALL]) == 1
    assert set(drive_.contacts) == {STALL}


def test_a_bag_with_nothing_to_judge_has_no_drive():
    assert drives_of([]) == ([], [])


def test_a_bag_that_ends_amid_an_episode():
    (drive_,), _ = drives_of([pose(100), start(101), pose(102), pose(104)])
    assert (drive_.outcome, drive_.end_ns) == ("unfinished", ns(104))
    assert any("bag ends" in note for note in drive_.notes)


def test_a_start_while_another_episode_runs():
    events = [start(101), pose(102), start(103, "Book"), pose(104), end(105, "Book")]
    (first, second), _ = drives_of(events)
    assert (first.outcome, first.end_ns) == ("unfinished", ns(103))
    assert any("Another episode began" in note for note in first.notes)
    assert (second.goal, second.outcome) == ("Book", "done")


def test_an_end_without_its_start_keeps_what_the_bag_holds():
    (drive_,), _ = drives_of([pose(100), decided(101), pose(102, 0.3), end(103)])
    assert (drive_.start_ns, drive_.end_ns, drive_.outcome) == (ns(100), ns(103), "done")
    assert any("start was not recorded" in note for note in drive_.notes)
    assert len(drive_.decisions) == 1


def test_starts_and_ends_that_were_recorded_twice_count_once():
    events = [pose(100), start(101), start(101), pose(102), end(103), end(103), pose(104)]
    (drive_,), notes = drives_of(events)
    assert (drive_.seconds, drive_.notes) == (pytest.approx(2.0), ())
    assert ["all that was recorded" in note for note in notes] == [True]


def test_an_end_stamped_before_its_start_ends_with_the_last_message():
    back = dataclasses.replace(end(104, outcome="aborted"), t_ns=ns(100.5))
    (drive_,), _ = drives_of([start(101), *drive(101, MOVE), back, pose(108)])
    assert drive_.seconds == pytest.approx(0.95)
    assert any("clock went back" in note for note in drive_.notes)


def test_goals_that_never_began_are_no_drives_but_said():
    events = [start(101), end(102, "Book", "preempted"), end(103), end(104, "Pen", "canceled")]
    (drive_,), notes = drives_of(events)
    assert (drive_.goal, drive_.end_ns) == ("Mug", ns(103))
    assert [word in note for word, note in zip(("Book", "Pen"), notes, strict=True)] == [True, True]


def test_an_episode_told_of_by_latched_messages_alone_was_before_the_bag():
    old = [start(10, log=100.1), end(60, log=100.1), start(70, "Book", log=100.2)]
    events = [pose(100), *old, pose(101), end(102, "Book")]
    (drive_,), notes = drives_of(events, sort=False)
    assert (drive_.goal, drive_.end_ns) == ("Book", ns(102))
    assert any("before the recording" in note for note in drive_.notes)
    assert ["Mug" in note for note in notes] == [True]


def test_a_bag_of_latched_messages_and_a_drive_is_judged_as_a_whole():
    events = [pose(100), start(10, log=100.1), end(60, log=100.1), *drive(101, MOVE)]
    (drive_,), _ = drives_of(events, sort=False)
    assert (drive_.found, drive_.goal) == (BAG, "")


def test_rows_of_a_file_are_drives_whatever_the_policy_tells():
    rows = [
        EpisodeRow("b", 1.0, 2.0, "Mug", (1.0, 2.0), True),
        EpisodeRow("b", 4.0, 9.0, "Book"),
        EpisodeRow("b", 20.0, 30.0, "Pen"),
    ]
    events = [*drive(100, *[MOVE] * 6), start(100.5), end(101.5, outcome="step_limit")]
    (first, second), notes = drives_of(events, rows)
    assert (first.found, first.goal, first.goal_at, first.reached) == (
        FILE,
        "Mug",
        (1.0, 2.0),
        True,
    )
    assert (first.start_ns, first.end_ns) == (ns(101), ns(102))
    assert (first.outcome, first.bundle) == ("step_limit", "shipped")
    assert first.path_length_m == pytest.approx(0.2, abs=0.011)
    assert second.end_ns == ns(105.95)
    assert any("3.1 s before" in note for note in second.notes)
    assert ["beyond the bag" in note for note in notes] == [True]


def test_contacts_of_a_drive_are_those_of_its_time():
    hit = [bumps(t, "front") for t in (100.6, 102.5, 104.5)]
    free = [bumps(t) for t in (100, 101.5, 103.5)]
    events = [*hit, *free, start(102), end(103), *drive(100, *[MOVE] * 5)]
    (drive_,), _ = drives_of(events)
    assert [c.t_ns for c in drive_.contacts[BUMP]] == [ns(102.5)]


def test_sources_that_fall_silent_are_named():
    events = [start(101), *drive(101, MOVE), truth(101.5), bumps(105), end(106)]
    (drive_,), _ = drives_of(events)
    assert sum("hold no" in note for note in drive_.notes) == 2
    assert TRUTH in drive_.contacts


def test_stamps_of_another_clock_give_way_to_log_times():
    clocks = Clocks()
    late = [pose(t, log=t + 30.0) for t in range(1, 11)]
    assert [clocks.time(e) for e in late] == [e.log_ns for e in late]
    one = [pose(t, log=t + (5.0 if t == 5 else 0.01)) for t in range(1, 11)]
    clocks = Clocks()
    assert [clocks.time(e) for e in one] == [e.t_ns for e in one]
    assert clocks.time(dataclasses.replace(pose(7), t_ns=0)) == ns(7)
    assert clocks.time(dataclasses.replace(pose(7), log_ns=0)) == ns(7)


def test_a_robot_with_another_clock_is_judged_in_log_times():
    events = [start(101), end(103)]
    events += [dataclasses.replace(e, t_ns=e.t_ns - ns(40)) for e in drive(100, *[MOVE] * 5)]
    (drive_,), _ = drives_of(events)
    assert drive_.path_length_m == pytest.approx(0.4, abs=0.011)


def test_numbers_that_are_not_finite_are_left_out_and_said():
    events = [*drive(101, MOVE), pose(101.5, x=math.nan), judged(101.6, math.inf), judged(101.7)]
    events += [velocity(101.8, math.nan), start(101), end(102.5)]
    (drive_,), notes = drives_of(events)
    assert drive_.path_length_m == pytest.approx(0.2, abs=0.011)
    assert drive_.clearance_m == 1.0
    assert sorted(note.split(" hold")[0] for note in notes) == [
        "1 messages of collision/estimate", "1 messages of odom",
    ]  # fmt: skip


def test_the_odometry_frame_is_placed_by_tf():
    quarter = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    bad, good = (("map", "odom", (1.0, 2.0, 0.0), q) for q in ((0.0, 0.0, 0.0, 0.0), quarter))
    other = ("odom", "base_link", (5.0, 5.0, 0.0), quarter)
    frames = [Frames(**at(101 + i), transforms=(t,)) for i, t in enumerate((good, bad, other))]
    (drive_,), _ = drives_of([start(100), *frames, pose(105), end(106)])
    assert drive_.odom_in_map == pytest.approx((1.0, 2.0, math.pi / 2))


def test_a_log_whose_time_stands_does_not_fill_the_memory():
    finder = DriveFinder()
    for i in range(3 * RECENT):
        finder.see(dataclasses.replace(pose(1 + i / 20), log_ns=0))
    assert len(finder._recent) == RECENT
    (drive_,) = finder.finish()
    assert drive_.seconds == pytest.approx((3 * RECENT - 1) / 20)


def scene(seed):
    """An episode with random hits, sights and pauses: events for both ways of judging it."""
    draw = random.Random(seed)
    truths, x, hits, t = [], 0.0, 0, 101.0
    while t < 131.0:
        x += draw.choice((0.0, 0.0, 0.004, 0.01))
        hits += draw.random() < 0.004
        truths.append(truth(round(t, 3), x, 0.1, hits, seen=draw.random() < 0.5))
        t += 0.05
    ending = draw.choice(("done", "step_limit"))
    decisions = [decided(102.0 + i * 0.9, i + 1) for i in range(20)]
    decisions.append(decided(draw.uniform(121, 129.5), 21, Action.Done))
    return [*truths, *decisions, start(101.2), end(130.0, outcome=ending)], ending


@pytest.mark.parametrize("seed", range(10))
def test_truth_is_judged_as_the_live_account_is(seed):
    events, ending = scene(seed)
    (drive_,), _ = drives_of(events)
    truths = [e for e in events if isinstance(e, Truth) and ns(101.2) <= e.t_ns <= ns(130)]
    done = next(e.t_ns for e in events if getattr(e, "action", None) is Action.Done)
    seen = min(truths, key=lambda sample: abs(sample.t_ns - done)).goal_visible
    hits = truths[-1].collisions - truths[0].collisions
    live = live_outcome(drive_)
    assert live is not None
    assert len(drive_.truths) < len(truths)
    assert live.path_length_m == pytest.approx(truths[-1].x - truths[0].x)
    success = ending == "done" and seen
    assert dataclasses.replace(live, path_length_m=0.0) == outcome.Outcome(
        "Mug", "kitchen:25", ending, success, hits, success and not hits, 21, 0.0, 2.0
    )
    rises = [b.t_ns for a, b in pairwise(truths) if b.collisions > a.collisions]
    assert [c.t_ns for c in drive_.contacts[TRUTH]] == rises


def test_the_path_is_thinned_but_its_length_is_not():
    events = [start(101), end(161)]
    events += [Pose(**at(101 + i / 100), x=i * 1e-3, y=0.0, yaw=0.0, v=0.1, w=0.0)
               for i in range(6000)]  # fmt: skip
    (drive_,), _ = drives_of(events)
    assert drive_.path_length_m == pytest.approx(5.999)
    assert 290 <= len(drive_.path) <= 310
    assert drive_.path[-1, 1] == pytest.approx(5.999)


def test_an_episodes_file_is_read_as_yaml_and_csv(tmp_path):
    yaml = tmp_path / "e.yaml"
    yaml.write_text(
        "- {bag: run2, start: 1, end: 9.5, goal: Mug, goal_x: 1, goal_y: -2, reached: true}\n"
        "- {bag: run1, start: 0, end: 2, goal: Book}\n"
    )
    csv = tmp_path / "e.csv"
    csv.write_text(
        "bag,start,end,goal,goal_x,goal_y,reached\nrun2,1,9.5,Mug,1,-2,yes\nrun1,0,2,Book,,,\n"
    )
    rows = read_episodes(yaml)
    assert rows == read_episodes(csv)
    assert rows[1] == EpisodeRow("run2", 1.0, 9.5, "Mug", (1.0, -2.0), True)
    bags = [tmp_path / name for name in ("run1.mcap", "run2", "run22")]
    assert list(rows_by_bag(rows, bags).values()) == [rows[:1], rows[1:], ()]


def test_a_row_fits_one_bag_by_as_much_of_its_path_as_is_needed(tmp_path):
    first, second = tmp_path / "first/bag", tmp_path / "second/bag"
    split, plain = tmp_path / "tour_*.mcap", tmp_path / "tour.db3"

    def found(name, *bags):
        rows = (EpisodeRow(name, 0.0, 1.0, "Mug"),)
        return [bag for bag, mine in rows_by_bag(rows, bags).items() if mine]

    for name in ("first/bag", "./first/bag", str(first)):
        assert found(name, second, first) == [first]
    assert found("bag", Path("bag"), Path("x/bag")) == [Path("bag")]
    assert found("tour", split, first) == found("tour_*.mcap", split, plain) == [split]
    assert found("tour.db3", split, plain) == [plain]
    with pytest.raises(EpisodesError, match=r"'bag', which fits .*first/bag and .*second/bag;"):
        found("bag", first, second)
    with pytest.raises(EpisodesError, match="'tour', which fits"):
        found("tour", split, plain)
    with pytest.raises(EpisodesError, match="'tuor', which fits none of the bags; expected one"):
        found("tuor", first, plain)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("- {bag: a, start: 0, end: 2}", "row 1: goal is missing"),
        ("- {bag: a, start: 3, end: 2, goal: Mug}", "expected 0 <= start < end"),
        ("- {bag: a, start: x, end: 2, goal: Mug}", "start is 'x'; expected a number"),
        ("- {bag: a, start: .nan, end: 2, goal: Mug}", "expected a number"),
        ("- {bag: a, start: 0, end: 2, goal: Mug, goal_x: 1}", "goal_x alone"),
        ("- {bag: a, start: 0, end: 2, goal: Mug, reached: perhaps}", "true or false"),
        ("- {bag: a, start: 0, end: 2, goal: Mug, found: true}", "'found' is unknown"),
        ("- {bag: '', start: 0, end: 2, goal: Mug}", "bag is empty"),
        ("- 3", "row 1: it is 3"),
        ("bag: a", "expected a list"),
        ("", "expected a list"),
        ("- [", "neither YAML nor CSV"),
        ("[" * 5000, "neither YAML nor CSV"),
        ("- {bag: a, start: 2001-99-99, end: 2, goal: Mug}", "neither YAML nor CSV"),
        (
            "- {bag: a, start: 0, end: 2, goal: Mug}\n- {bag: a, start: 1, end: 3, goal: Mug}",
            "overlap",
        ),
    ],
)
def test_mistakes_in_an_episodes_file_are_told_in_one_sentence(tmp_path, text, sentence):
    path = tmp_path / "e.yaml"
    path.write_text(text)
    with pytest.raises(EpisodesError, match=r"^[^\n]*$") as caught:
        read_episodes(path)
    assert sentence in str(caught.value)


def test_files_that_are_no_episodes_file(tmp_path):
    (tmp_path / "wide.csv").write_text("bag,start,end,goal\na,0,1,Mug,7\n")
    (tmp_path / "raw.csv").write_bytes(b"\xff\xfe\x00")
    for name, word in (("wide.csv", "more cells"), ("raw.csv", "no text"), ("no.csv", "read")):
        with pytest.raises(EpisodesError, match=word):
            read_episodes(tmp_path / name)


def test_a_status_in_another_namespace_is_heard_too():
    event = dataclasses.replace(told(101, True), topic="/robot1/policy/episode")
    (drive_,), _ = drives_of([event, velocity(102), end(103)])
    assert drive_.outcome == "done"


@pytest.mark.parametrize("answer", ["refused", "canceled", "preempted"])
def test_a_goal_that_was_answered_before_any_decision_is_no_drive(answer):
    tries = [start(101, "Fridge"), end(101.1, "Fridge", answer)]
    last = [start(103), decided(103.2), decided(103.4, 2, Action.Done, 0.9), end(103.5)]
    (drive_,), notes = drives_of([pose(100), *tries, pose(102), *last, pose(105)])
    assert (drive_.goal, drive_.outcome) == ("Mug", "done")
    assert notes == [f"The goal Fridge was answered with {answer!r} and never began."]
    began = [start(101), decided(101.05), end(101.1, "Mug", answer)]
    (drive_,), notes = drives_of([pose(100), *began, pose(105)])
    assert (drive_.outcome, notes) == (answer, [])


def test_rows_of_a_file_count_from_the_first_message_of_all():
    rows = [EpisodeRow("bag", 21.0, 23.0, "Mug")]
    events = [pose(120 + i / 10) for i in range(60)]
    finder = DriveFinder(rows, begin_ns=ns(100))
    found = [d for event in events for d in finder.see(event)] + finder.finish()
    (drive_,) = found
    assert (drive_.start_ns, drive_.end_ns) == (ns(121), ns(123))


def test_the_map_of_another_robot_is_not_taken():
    def frames(t, child, x):
        put = ("map", child, (x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        return Frames(**at(t), transforms=(put,))

    def of(frame):
        poses = [
            dataclasses.replace(pose(100 + i), frames=f"{frame} to base_link") for i in range(8)
        ]
        told_of = [frames(101.5, "robot1/odom", 1.0), frames(102.5, "robot2/odom", 7.0)]
        (drive_,), _ = drives_of([*poses, *told_of, start(101), end(106)])
        return drive_.odom_in_map[0]

    assert of("robot1/odom") == 1.0
    assert of("robot2/odom") == 7.0
    assert of("odom") == 7.0  # whichever came last
