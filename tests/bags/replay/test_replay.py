"""A bundle over the recording of its own drive decides the same; what is missing is named."""

import dataclasses
import math

import numpy as np
import pytest
from cfnav_ros.bags.files.events import (
    Calibrated,
    Decided,
    LaserTurn,
    Picture,
    Tick,
    Told,
)
from cfnav_ros.bags.judge.clocks import Clocks
from cfnav_ros.bags.replay.step import PROBABILITY_TOLERANCE, labelled, reproduction
from cfnav_ros.drive.limits import EpisodeLimits

from cfnav_core.policy.policy import Policy
from cfnav_core.task.actions import Action
from cfnav_core.task.pinhole import Pinhole
from tests.bags.live_drives import RecordedRobot, later, without
from tests.bags.replay.replays import S, decisions, replay
from tests.bags.steps import step_of


def test_a_bundle_reproduces_every_decision_of_its_own_drives(recorded, policy):
    events, episodes = recorded
    made = decisions(events)
    assert len(made) == sum(episode.steps for episode in episodes) > 20
    assert sum(d.vetoed for d in made) > 3, "the recording should hold vetoed decisions"
    assert len({d.action for d in made}) > 3
    run = replay(events, policy)
    assert run.left_out == []
    result = reproduction(run.steps)
    assert (result.decisions, result.equal, result.not_compared) == (len(made), len(made), 0)
    assert (result.probability_difference, result.p_hat_difference) == (0.0, 0.0)
    assert [s.driven_vetoed for s in run.steps] == [d.vetoed for d in made]
    assert [s.would_veto for s in run.steps] == [d.vetoed for d in made]
    assert [s.estimate_ns for s in run.steps] == [d.estimate_ns for d in made]


def test_without_its_vetoed_decisions_it_is_not_the_same_policy(recorded, policy):
    """The live policy takes a vetoed MoveAhead for its previous action: so must the replay."""
    events, _ = recorded
    again = [
        dataclasses.replace(e, action=Action.RotateLeft)
        if isinstance(e, Decided) and e.vetoed
        else e
        for e in events
    ]
    run, other = replay(events, policy), replay(again, policy)
    differ = [
        not np.array_equal(a.probabilities, b.probabilities)
        for a, b in zip(run.steps, other.steps, strict=True)
    ]
    first = next(i for i, s in enumerate(run.steps) if s.driven_vetoed)
    assert not any(differ[: first + 1])
    assert differ[first + 1]


def test_a_drive_without_lidar_takes_the_bundles_own_predictor(bundle, policy):
    robot = RecordedRobot(seed=2)
    robot.drive(Policy.load(bundle), "Mug", max_steps=15, p_hat="own", veto=False)
    steps = replay(robot.events, policy).steps
    assert reproduction(steps).equal == len(decisions(robot.events)) > 5
    assert [s.p_hat_rgb for s in steps] == [s.p_hat for s in steps]
    assert {(s.estimate_ns, s.would_veto) for s in steps} == {(0, False)}


def test_a_drive_by_the_larger_of_lidar_and_own_is_reproduced(bundle, policy):
    robot = RecordedRobot(seed=2)
    robot.drive(Policy.load(bundle), "Mug", max_steps=15, p_hat="both")
    steps = replay(robot.events, policy, limits=EpisodeLimits(p_hat="both")).steps
    assert reproduction(steps).equal == len(decisions(robot.events)) > 5
    assert all(s.p_hat >= s.p_hat_rgb for s in steps)
    assert any(s.p_hat == s.p_hat_rgb for s in steps)


def test_what_the_wheels_met_is_known_again(bundle, policy):
    """Neither scans nor pictures tell it: the decision does."""
    robot = RecordedRobot(seed=4)
    obey = robot.move

    def move(command):
        robot.slips = command.v > 0 and math.hypot(robot.x, robot.y) > 0.1
        obey(command)

    robot.move = move
    limits = {"veto_probability": 0.99, "max_stalls": 100, "max_failed_motions": 100}
    robot.drive(Policy.load(bundle), "Mug", max_steps=40, **limits)
    made = decisions(robot.events)
    assert sum(d.met_before for d in made) > 3
    assert sum(d.met_before and d.vetoed for d in made) > 1
    run = replay(robot.events, policy, limits=EpisodeLimits(**limits))
    assert reproduction(run.steps).equal == len(made)
    assert [s.would_veto for s in run.steps] == [d.vetoed for d in made]
    forgot = [
        dataclasses.replace(e, met_before=False) if isinstance(e, Decided) else e
        for e in robot.events
    ]
    assert reproduction(replay(forgot, policy).steps).equal < len(made)


def test_the_predictor_beside_the_lidar_is_the_one_that_would_supply(recorded, policy):
    steps = replay(recorded[0], policy).steps
    assert len({s.p_hat_rgb for s in steps if s.p_hat_rgb != s.p_hat}) == len(steps)


def test_decisions_of_a_blind_robot_are_reproduced(bundle, policy):
    robot, live = RecordedRobot(seed=3), Policy.load(bundle)
    tick = robot.tick

    def tick_and_fall_silent(episode):
        robot.silent = episode.steps >= 3
        return tick(episode)

    robot.tick = tick_and_fall_silent
    robot.drive(live, "Mug", max_steps=25, blind_timeout=60.0)
    made = decisions(robot.events)
    assert sum(d.collision_probability == 1.0 for d in made) > 3
    scans = {e.t_ns for e in robot.events if isinstance(e, LaserTurn)}
    assert any(d.estimate_ns not in scans for d in made)
    run = replay(robot.events, policy)
    assert run.left_out == []
    assert reproduction(run.steps).equal == len(made)


def test_two_bundles_on_one_pass_do_not_disturb_each_other(recorded, bundle, policy):
    events, _ = recorded
    shipped = Policy.load()
    alone = replay(events, policy).steps
    both = replay(events, {"restless": policy, "ours": shipped}).steps
    mine = [s for s in both if s.bundle == "restless"]
    assert [s.probabilities.tolist() for s in mine] == [s.probabilities.tolist() for s in alone]
    theirs = [s for s in both if s.bundle == "ours"]
    assert len(theirs) == len(mine)
    assert {s.driver for s in theirs} == {"restless"}
    assert reproduction(theirs).equal < len(theirs)


def test_a_picture_that_is_recorded_after_its_decision_is_waited_for(recorded, policy):
    events, _ = recorded
    run = replay(later(events, lambda e: isinstance(e, Picture), 0.4), policy)
    assert run.left_out == []
    assert reproduction(run.steps).equal == len(decisions(events))


def test_a_missing_picture_is_named_and_the_rest_of_the_drive_not_compared(recorded, policy):
    events, episodes = recorded
    third = decisions(events)[2]
    run = replay(
        without(events, lambda e: isinstance(e, Picture) and e.t_ns == third.image_ns), policy
    )
    (left_out,) = run.left_out
    stamp = f"{third.image_ns // S}.{third.image_ns % S:09d} s"
    assert left_out.reason == f"The bag holds no picture stamped {stamp}."
    assert (left_out.step, left_out.t_ns, left_out.bundle) == (3, third.t_ns, "")
    result = reproduction(run.steps)
    assert result.not_compared == episodes[0].steps - 3
    assert result.equal == result.decisions == len(decisions(events)) - episodes[0].steps + 2
    assert [s.intact for s in run.steps[: episodes[0].steps - 1]] == (
        [True] * 2 + [False] * (episodes[0].steps - 3)
    )


def test_a_missing_scan_is_named(recorded, policy):
    events, _ = recorded
    made = next(d for d in decisions(events) if d.collision_probability < 1)
    run = replay(
        without(events, lambda e: isinstance(e, LaserTurn) and e.t_ns == made.estimate_ns), policy
    )
    assert [o.reason.split(" stamped")[0] for o in run.left_out] == ["No scan"]
    assert reproduction(run.steps).not_compared > 0


def test_a_bag_that_begins_amid_a_drive_says_so(recorded, policy):
    events, episodes = recorded
    fifth = decisions(events)[4]
    run = replay([e for e in events if e.log_ns >= fifth.image_ns], policy)
    result = reproduction(run.steps)
    assert result.not_compared + len(run.left_out) == episodes[0].steps - 4
    assert result.equal == result.decisions == episodes[1].steps + episodes[2].steps
    assert run.steps[0].driver == ""


def test_a_lost_decision_is_noticed(recorded, policy):
    events, episodes = recorded
    fourth = decisions(events)[3]
    run = replay(without(events, lambda e: e is fourth), policy)
    assert reproduction(run.steps).not_compared == episodes[0].steps - 4


def test_without_starts_a_first_step_begins_a_drive(recorded, policy):
    events, episodes = recorded
    run = replay(without(events, lambda e: isinstance(e, Told)), policy)
    result = reproduction(run.steps)
    assert result.equal == len(decisions(events))
    assert len({s.drive_ns for s in run.steps}) == len(episodes)


def test_a_decision_lasts_until_the_next_or_the_end(recorded, policy):
    events, episodes = recorded
    run, made = replay(events, policy), decisions(events)
    ends = [e.t_ns for e in events if isinstance(e, Told) and not e.started]
    last = episodes[0].steps - 1
    assert [s.until_ns for s in run.steps[:last]] == [d.t_ns for d in made[1 : last + 1]]
    assert run.steps[last].until_ns == ends[0]


def test_a_goal_that_a_bundle_does_not_take_is_named(recorded, policy):
    events = [
        dataclasses.replace(e, goal="Unicorn") if isinstance(e, Told | Decided) else e
        for e in recorded[0]
    ]
    run = replay(events, policy)
    assert run.steps == []
    assert [o.t_ns for o in run.left_out] == [d.t_ns for d in decisions(events)]
    assert {o.bundle for o in run.left_out} == {"restless"}
    assert "does not take this goal" in run.left_out[0].reason


def test_pictures_that_cannot_be_used_are_named(recorded, policy):
    def refuse():
        raise ValueError("The picture is torn.")

    def spoiled(event, decode):
        return dataclasses.replace(event, decode=decode) if isinstance(event, Picture) else event

    torn = replay([spoiled(e, refuse) for e in recorded[0]], policy)
    assert torn.steps == []
    assert {o.reason for o in torn.left_out} == {"The picture is torn."}
    oblong = np.zeros((150, 300, 3), np.uint8)
    wide = replay([spoiled(e, lambda: oblong) for e in recorded[0]], policy)
    assert wide.steps == []
    assert "expected a square one" in wide.left_out[0].reason


def test_wide_pictures_are_cut_by_their_camera_info_as_they_were_live(recorded, policy):
    def widened(event):
        """The same picture in the middle of one that is 106 degrees wide."""
        if not isinstance(event, Picture):
            return event
        middle, beside = event.decode(), np.full((150, 25, 3), 200, np.uint8)
        picture = np.concatenate([beside, middle, beside], axis=1)
        return dataclasses.replace(event, data=picture, decode=lambda: picture)

    events = [widened(event) for event in recorded[0]]
    lens = Pinhole(75.0, 75.0, 99.5, 74.5, 200, 150)
    told = Calibrated(t_ns=events[0].t_ns, log_ns=events[0].log_ns, found=lens)
    run, whole = replay([told, *events], policy), replay(recorded[0], policy)
    assert run.left_out == []
    assert len(run.steps) == len(whole.steps) > 20
    for wide, square in zip(run.steps, whole.steps, strict=True):
        assert np.array_equal(wide.probabilities, square.probabilities)
    untold = replay(events, policy)
    assert untold.steps == []


def test_damaged_probabilities_are_no_reproduction(recorded, policy):
    events = [
        dataclasses.replace(e, probabilities=np.full(6, np.nan, np.float32))
        if isinstance(e, Decided)
        else e
        for e in recorded[0]
    ]
    result = reproduction(replay(events, policy).steps)
    assert (result.equal, result.probability_difference) == (0, np.inf)
    assert result.decisions > 0


def test_the_tolerance_is_kept(recorded, policy):
    steps = replay(recorded[0], policy).steps
    for off, equal in ((0.9, True), (1.1, False)):
        p = steps[0].probabilities.copy()
        p[5] += off * PROBABILITY_TOLERANCE
        result = reproduction([dataclasses.replace(steps[0], driven_probabilities=p)])
        assert (result.equal == 1) is equal
    assert reproduction([]).probability_difference is None


def test_labels_of_executed_moves():
    steps = [
        step_of(t_ns=10, until_ns=20),
        step_of(t_ns=20, until_ns=30),
        step_of(t_ns=30, until_ns=40, driven=Action.RotateLeft),
        step_of(t_ns=40, until_ns=50, driven_vetoed=True),
        step_of(t_ns=50, until_ns=60),
        step_of(t_ns=70, until_ns=80),
    ]
    found = labelled(steps, [65, 20, 35, 45, 52, 58])
    assert [s.collided for s in found] == [True, False, None, None, True, False]
    assert [s.collided for s in labelled(steps, [])] == [False, False, None, None, False, False]


# Time


@pytest.mark.parametrize("infer", [False, True])
def test_recordings_in_disorder_end_in_named_steps(recorded, policy, infer):
    """Lost events, leaping log times, other orders: no exception, and every decision is named."""
    events = recorded[0][: len(recorded[0]) // 3]
    rng = np.random.default_rng(5)
    for leap in (0, S // 2, 10**19):
        mixed = [
            dataclasses.replace(e, log_ns=e.log_ns + int(rng.integers(0, 3)) * leap)
            for e in events
            if rng.random() > 0.1
        ]
        near = np.arange(len(mixed)) + rng.integers(0, 10, len(mixed))
        mixed = [mixed[k] for k in np.argsort(near, kind="stable")]
        run = replay(mixed, policy, infer=infer)
        steps = labelled(run.steps, [e.t_ns for e in events[::50]])
        assert all(s.t_ns <= s.until_ns for s in steps)
        if not infer:
            named = {s.t_ns for s in steps} | {o.t_ns for o in run.left_out}
            clocks = Clocks()
            times = [(clocks.time(e), e) for e in mixed]
            assert named == {t_ns for t_ns, e in times if isinstance(e, Decided)}


def test_simulated_time_under_system_log_times(recorded, policy):
    """Recorded by another recorder, in system time, with /clock."""
    events = []
    for e in recorded[0]:
        events.append(Tick(t_ns=e.log_ns, log_ns=e.log_ns + 10**18))
        events.append(dataclasses.replace(e, log_ns=e.log_ns + 10**18))
    run = replay(events, policy)
    assert reproduction(run.steps).equal == len(decisions(recorded[0]))
