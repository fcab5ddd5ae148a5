"""Figures of drives and over drives, against numbers worked out by hand."""

import dataclasses
import math

import numpy as np
import pytest
from cfnav_ros.bags.files.events import OccupancyMap
from cfnav_ros.bags.judge.contacts import BUMP, OBSERVABLE, STALL, TRUTH, Contact
from cfnav_ros.bags.judge.drive_log import FILE, POLICY, Drive
from cfnav_ros.bags.judge.figures import over_drives
from cfnav_ros.bags.judge.outcomes import SEEN_SCORE, judge, live_outcome
from cfnav_ros.bags.judge.shortest import shortest_path

from cfnav_core.task import metrics
from cfnav_core.task.actions import Action
from cfnav_core.task.intervals import FEW, share_interval
from tests.bags.made import decided, ns, truth

SEEN, UNSEEN = SEEN_SCORE + 0.1, SEEN_SCORE - 0.1


def contact(source, t=102.0, speed=0.2):
    return Contact(ns(t), 0.0, 0.0, source=source, speed=speed)


def straight(length=4.0):
    t = np.linspace(0.0, 20.0, 201)
    return np.column_stack([t, t / 20.0 * length, 0 * t, 0 * t])


def made(outcome="done", score=SEEN, contacts=None, **fields):
    """A drive of 4 m without ground truth that ended with Done."""
    plain = {
        "found": POLICY,
        "start_ns": ns(101),
        "end_ns": ns(121),
        "goal": "Mug",
        "outcome": outcome,
        "path": straight(),
        "path_length_m": 4.0,
        "decisions": (decided(102, vetoed=True), decided(120, 2, Action.Done, score)),
        "contacts": {BUMP: (), STALL: ()} if contacts is None else contacts,
        "clearance_m": 0.12,
    }
    return Drive(**{**plain, **fields})


def with_truth(seen=True, hits=0, **fields):
    truths = (truth(101.5), truth(110, hits=hits, speed=0.17), truth(120, hits=hits, seen=seen))
    found = (Contact(ns(110), 0, 0, "Chair", hits, 0.0, TRUTH, 0.17),) if hits else ()
    contacts = {TRUTH: found, BUMP: (contact(BUMP),), STALL: ()}
    return made(contacts=contacts, truths=truths, truth_length_m=5.0, **fields)


def test_what_a_real_robot_can_know_of_a_drive():
    result = judge(made())
    assert (result.success.value, result.success.source) == (True, OBSERVABLE)
    assert (result.collisions.value, result.collisions.source) == (0, OBSERVABLE)
    assert (result.cf_success.value, result.cf_success.source) == (True, OBSERVABLE)
    assert (result.steps, result.vetoes, result.seconds) == (2, 1, 20.0)
    assert (result.path_length_m.value, result.path_length_m.source) == (4.0, "odometry")
    assert result.clearance_m.value == 0.12
    assert result.collisions_per_m.value == 0.0
    assert not result.truth_length_m.known
    assert (result.impact_speed.value, result.impact_speed.why) == (None, "it touched nothing")


def test_done_without_seeing_the_goal_is_no_success():
    assert judge(made(score=UNSEEN)).success.value is False


@pytest.mark.parametrize("score", [SEEN, UNSEEN])
def test_a_detectors_boxes_do_not_tell_whether_a_goal_was_reached(score):
    told = decided(120, 2, Action.Done, score)
    decisions = (decided(102), dataclasses.replace(told, by_detections=True))
    result = judge(made(decisions=decisions))
    assert (result.success.value, result.cf_success.value) == (None, None)
    assert "a detector's boxes do not tell" in result.success.why
    assert judge(made(decisions=decisions, reached=True)).success.value is True
    assert judge(with_truth(decisions=decisions)).success.value is True
    assert judge(made("step_limit", decisions=decisions[:1])).success.value is False


@pytest.mark.parametrize("outcome", ["step_limit", "aborted", "refused"])
def test_no_other_end_is_a_success_although_the_goal_is_seen(outcome):
    for drive in (made(outcome), with_truth(outcome=outcome)):
        result = judge(drive)
        assert result.success.value is False
        assert result.cf_success.value is False
        assert result.success_by[OBSERVABLE] is False


def test_truth_comes_first_and_the_observable_stands_beside_it():
    result = judge(with_truth(seen=False, hits=2))
    assert (result.success.value, result.success.source) == (False, TRUTH)
    assert result.success_by == {TRUTH: False, OBSERVABLE: True}
    assert (result.collisions.value, result.collisions.source) == (2, TRUTH)
    assert result.collisions_by == {TRUTH: 2, BUMP: 1, STALL: 0, OBSERVABLE: 1}
    assert (result.impact_speed.value, result.impact_speed.source) == (0.17, TRUTH)
    assert result.collisions_per_m.value == pytest.approx(2 / 5)
    assert (result.shortest_path_m.value, result.shortest_path_m.source) == (2.0, TRUTH)
    assert result.driven_m.value == 5.0


def test_success_with_a_touch_is_no_collision_free_success():
    result = judge(with_truth(hits=1))
    assert (result.success.value, result.cf_success.value) == (True, False)


def test_a_file_comes_before_the_observable_and_after_truth():
    result = judge(made(reached=False, found=FILE))
    assert (result.success.value, result.success.source) == (False, "file")
    assert judge(with_truth(reached=False)).success.source == TRUTH


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"goal": ""}, "no goal"),
        ({"decisions": ()}, "does not hold the decision Done"),
        ({"outcome": "unfinished", "decisions": ()}, "does not hold its end"),
        ({"found": FILE, "outcome": "", "decisions": ()}, "neither the policy nor a file"),
    ],
)
def test_success_that_nobody_knows_is_missing(fields, why):
    result = judge(made(**fields))
    assert result.success.value is None
    assert why in result.success.why
    assert result.cf_success.value is None


def test_collisions_that_nobody_could_notice_are_missing_not_zero():
    result = judge(made(contacts={}))
    assert result.collisions.value is None
    assert result.cf_success.value is None
    assert result.collisions_per_m.value is None
    assert "neither ground truth nor bumps" in result.cf_success.why
    # A failure is none the less no collision-free success.
    assert judge(made("aborted", contacts={})).cf_success.value is False


def test_a_drive_on_the_spot_has_no_collisions_per_metre():
    assert judge(made(path_length_m=0.02)).collisions_per_m.value is None


def test_the_live_account_needs_truth():
    assert live_outcome(made()) is None
    live = live_outcome(with_truth(hits=1))
    assert live is not None
    assert (live.success, live.cf_success, live.collisions, live.steps) == (True, False, 1, 2)


def room(width=8.0, height=4.0, resolution=0.05):
    """An empty room with a wall across it that leaves a gap at its upper end."""
    occupied = np.zeros((round(height / resolution), round(width / resolution)), bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    middle = round(width / 2 / resolution)
    occupied[: round((height - 1.0) / resolution), middle] = True
    return OccupancyMap(t_ns=0, occupied=occupied, resolution=resolution, origin=(0.0, 0.0))


@pytest.mark.parametrize("resolution", [0.02, 0.05, 0.1])
def test_the_shortest_way_goes_around_what_is_in_the_way(resolution):
    found = shortest_path(room(resolution=resolution), (1.0, 1.0), (7.0, 1.0), 0.175)
    # Past the wall's end (4, 3) at the radius, then on until the goal is 1.5 m away.
    past = (4.0, 3.0 + 0.175)
    least = math.dist((1.0, 1.0), past) + math.dist(past, (7.0, 1.0)) - 1.5
    assert least - 0.15 < found < least * 1.04 + 0.15


def test_a_free_way_is_straight():
    empty = dataclasses.replace(room(), occupied=np.zeros((200, 200), bool))
    for goal in ((9.0, 1.0), (9.0, 9.0), (9.0, 4.0), (4.0, 9.0)):
        straight_way = math.dist((1.0, 1.0), goal) - 1.5
        found = shortest_path(empty, (1.0, 1.0), goal)
        assert straight_way - 0.1 < found < straight_way * 1.03 + 0.1


@pytest.mark.parametrize(
    ("start", "goal", "change", "why"),
    [
        ((40.0, 1.0), (7.0, 1.0), {}, "no free place"),
        ((1.0, 1.0), (70.0, 1.0), {}, "within 1.5 m of the goal"),
        ((1.0, 1.0), (7.0, 1.0), {"resolution": 0.0}, "cells of 0 m"),
        ((1.0, 1.0), (7.0, 1.0), {"occupied": np.zeros((0, 5), bool)}, "shape"),
        ((1.0, 1.0), (7.0, 1.0), {"occupied": np.ones((80, 160), bool)}, "no free place"),
        ((1.0, 1.0), (7.0, 1.0), {"occupied": np.zeros((1100, 1100), bool)}, "too large"),
    ],
)
def test_a_way_that_cannot_be_found_is_told(start, goal, change, why):
    with pytest.raises(ValueError, match=why):
        shortest_path(dataclasses.replace(room(), **change), start, goal)


def test_a_closed_wall_has_no_way():
    occupied = room().occupied.copy()
    occupied[:, 80] = True
    with pytest.raises(ValueError, match="no way"):
        shortest_path(dataclasses.replace(room(), occupied=occupied), (1.0, 1.0), (7.0, 1.0))


def test_the_map_gives_the_shortest_path_where_truth_does_not():
    # The odometry frame stands at (1, 1) in the map, turned by a quarter: its x is the map's y.
    drive = made(map=room(), odom_in_map=(1.0, 1.0, math.pi / 2), goal_at=(0.0, -6.0))
    result = judge(drive).shortest_path_m
    assert result.source == "map"
    assert result.value == pytest.approx(shortest_path(room(), (1.0, 1.0), (7.0, 1.0)))


@pytest.mark.parametrize(
    ("lacks", "why"),
    [("map", "no map"), ("odom_in_map", "no transform"), ("goal_at", "no place of the goal")],
)
def test_a_shortest_path_that_is_missing_says_why(lacks, why):
    whole = {"map": room(), "odom_in_map": (1.0, 1.0, 0.0), "goal_at": (6.0, 0.0)}
    result = judge(made(**{**whole, lacks: None})).shortest_path_m
    assert result.value is None
    assert why in result.why


def test_figures_over_drives_are_those_of_the_metrics():
    drives = [
        with_truth(),  # 2 m shortest of 5 m
        with_truth(hits=1),
        with_truth(seen=False),
        with_truth(outcome="aborted", hits=3),
    ]
    outcomes = [judge(drive) for drive in drives]
    found = over_drives(outcomes)
    results = [metrics.EpisodeResult(o.success.value, o.collisions.value, 5.0, 2.0)
               for o in outcomes]  # fmt: skip
    for name in ("sr", "spl", "cf_sr", "cf_spl"):
        assert found[name].value == getattr(metrics, name)(results)
        assert found[name].drives == 4
    assert found["sr"].value == 0.5
    assert found["cf_spl"].value == pytest.approx(0.25 * 0.4)
    assert found["collisions"].value == 1.0
    assert found["collisions_per_m"].value == pytest.approx(4 / 20)
    assert (found["sr"].low, found["sr"].high) == share_interval(0.5, 4)
    assert (found["cf_sr"].low, found["cf_sr"].high) == share_interval(0.25, 4)
    for name in ("spl", "cf_spl", "collisions_per_m", "seconds"):
        assert (found[name].low, found[name].high) == (None, None)
        assert found[name].why == f"too few drives for an interval: 4, it takes {FEW}"
    many = over_drives(outcomes * 5)
    for name in ("sr", "spl", "cf_sr", "cf_spl", "collisions_per_m"):
        assert many[name].low < many[name].value == found[name].value < many[name].high
        assert many[name].why == ""
    assert many["seconds"].why == "no interval, as all drives are alike"
    assert found["sr"].sources == {TRUTH: 4}
    assert found["impact_speed"].drives == 2
    assert found["impact_speed"].left_out == {"it touched nothing": 2}


def test_what_lacks_a_fact_is_left_out_failures_too():
    outcomes = [judge(d) for d in (with_truth(), made(), made("aborted"), made(goal=""))]
    found = over_drives(outcomes)
    assert (found["sr"].value, found["sr"].drives) == (pytest.approx(2 / 3), 3)
    assert found["sr"].sources == {TRUTH: 1, OBSERVABLE: 2}
    assert found["sr"].left_out == {"the drive has no goal": 1}
    # Neither the success nor the failure without a shortest path counts.
    assert (found["spl"].value, found["spl"].drives) == (pytest.approx(0.4), 1)
    assert found["spl"].low is None
    assert sum(found["spl"].left_out.values()) == 3


def test_no_drives_give_no_figures():
    assert {mean.value for mean in over_drives([]).values()} == {None}
    assert over_drives([judge(made(goal=""))])["sr"].value is None
