"""Whole episodes with a scripted policy on a small robot model, without ROS: how they go."""

import dataclasses
import math

import pytest
from cfnav_ros.drive.inputs import SensorInputs, StampedEstimate, Tilt
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import STOP, MotionLimits
from cfnav_ros.lidar.estimate import Estimate, Verdict

from cfnav_core.task.actions import Action
from cfnav_core.task.camera import MAST
from tests.ros.scripted_robot import BLOCKED, DT, FREE, OWN, Robot, driving, episode_of


def test_an_episode_from_goal_to_done():
    robot = Robot()
    episode, policy = episode_of(
        Action.MoveAhead, Action.RotateLeft, Action.LookDown, Action.MoveAhead, Action.Done
    )
    robot.run(episode)
    assert (episode.outcome, episode.steps, episode.vetoes) == ("done", 5, 0)
    assert policy.calls[0] == ("reset", "Laptop")
    assert [record.step for _, record in robot.records] == [1, 2, 3, 4, 5]
    assert episode.track.path_length == pytest.approx(0.5, abs=0.02)
    assert (robot.x, robot.y) == pytest.approx((0.427, 0.177), abs=0.015)
    assert math.degrees(robot.yaw) == pytest.approx(45, abs=1)
    assert robot.tilt == pytest.approx(MAST.horizons[1], abs=0.02)
    assert policy.given == [0.01] * 5
    assert robot.commands[-1][1] == STOP


@pytest.mark.parametrize("lead", [0.0, 0.4])
def test_decisions_are_made_on_pictures_taken_after_the_robot_stood(lead):
    """Whatever their stamps say."""
    robot = Robot()
    robot.lead = lead
    episode, _ = episode_of(*[Action.MoveAhead, Action.RotateRight] * 4, Action.Done)
    robot.run(episode)
    moving = [t for t, command in robot.commands if command != STOP]
    for t, record in robot.records:
        last = max((m for m in moving if m < t), default=0.0)
        assert record.image_stamp_ns * 1e-9 - lead >= last + DT + 0.15
        assert record.estimate_stamp_ns * 1e-9 - lead >= last
    stamps = [record.image_stamp_ns for _, record in robot.records]
    assert len(set(stamps)) == len(stamps)


def test_velocity_is_zero_outside_of_motions():
    robot = Robot()
    episode, _ = episode_of(Action.LookDown, Action.LookUp, Action.Done)
    robot.run(episode)
    assert all(command == STOP for _, command in robot.commands)


def test_headings_stay_on_the_episodes_set():
    robot = Robot()
    robot.yaw = 0.7
    turns = [Action.RotateLeft] * 11 + [Action.RotateRight] * 5
    episode, _ = episode_of(*turns, Action.Done)
    robot.run(episode)
    assert math.degrees(robot.yaw - 0.7) == pytest.approx(6 * 45, abs=1)


def test_look_up_at_level_and_look_down_at_the_bottom_change_nothing():
    robot = Robot()
    episode, _ = episode_of(Action.LookUp, Action.LookDown, Action.LookDown, Action.Done)
    robot.run(episode)
    assert episode.outcome == "done"
    assert robot.tilt == pytest.approx(MAST.horizons[1], abs=0.02)
    assert set(robot.tilts) == set(MAST.horizons)


def test_an_episode_starts_with_a_level_camera():
    robot = Robot()
    robot.tilt = -0.5
    episode, _ = episode_of(Action.Done)
    robot.run(episode)
    assert robot.tilt == pytest.approx(0.0, abs=0.02)


def test_a_vetoed_move_counts_as_a_decision_and_does_not_move():
    robot = Robot()
    robot.estimate = BLOCKED
    episode, policy = episode_of(Action.MoveAhead, Action.MoveAhead, Action.RotateLeft, Action.Done)
    robot.run(episode)
    assert (episode.outcome, episode.steps, episode.vetoes) == ("done", 4, 2)
    assert [record.vetoed for _, record in robot.records] == [True, True, False, False]
    assert (robot.x, robot.y) == (0.0, 0.0)
    assert policy.given == [0.97] * 4


def test_without_veto_the_policy_is_obeyed():
    robot = Robot()
    robot.estimate = BLOCKED
    episode, policy = episode_of(Action.MoveAhead, Action.Done, veto=False)
    robot.run(episode)
    assert episode.vetoes == 0
    assert robot.x == pytest.approx(0.25, abs=0.01)
    assert policy.given == [0.97] * 2


def test_live_limits_hold_at_once_and_others_from_the_next_episode_on():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 3, Action.Done, max_steps=4)
    robot.run(episode, until=driving)
    slow = MotionLimits(v_max=0.1, w_max=0.5, a_lin=0.1)
    episode.adopt(EpisodeLimits(max_steps=2, motion=slow))
    assert robot.tick(episode).command.v == pytest.approx(0.1)
    robot.run(episode)
    assert (episode.outcome, episode.steps, episode.vetoes) == ("done", 4, 0)
    begun = next(t for t, _ in robot.records if t > 104)
    speeds = [command.v for t, command in robot.commands if t > begun]
    assert max(speeds) == pytest.approx(0.1)
    assert any(speed == pytest.approx(0.05 + 0.5 * DT) for speed in speeds)  # a_lin is not live


def test_nobody_takes_the_veto_away_while_the_robot_drives():
    robot = Robot()
    episode, policy = episode_of(*[Action.MoveAhead] * 3, Action.Done)
    robot.run(episode, until=driving)
    for weaker in (EpisodeLimits(veto=False), EpisodeLimits(veto_probability=1.0)):
        episode.adopt(weaker)
    robot.estimate = BLOCKED
    robot.run(episode)
    assert (episode.outcome, episode.steps, episode.vetoes) == ("done", 4, 2)
    assert policy.given == [0.01, 0.97, 0.97, 0.97]


def test_without_lidar_the_policy_is_given_its_own_probability():
    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, estimate=SensorInputs().estimate)
    robot.frozen = {"estimate"}
    episode, policy = episode_of(Action.MoveAhead, Action.Done, p_hat="own", veto=False)
    robot.run(episode)
    assert episode.outcome == "done"
    assert policy.given == [OWN, OWN]


def test_the_policy_can_be_told_nothing_while_the_lidar_guards_the_way():
    robot = Robot()
    robot.estimate = BLOCKED
    episode, policy = episode_of(Action.MoveAhead, Action.Done, p_hat="zero")
    robot.run(episode)
    assert policy.given == [0.0, 0.0]
    assert [record.vetoed for _, record in robot.records] == [True, False]


def test_an_earlier_probability_is_one_of_those_of_the_decisions_so_far():
    robot = Robot()
    episode, policy = episode_of(*[Action.RotateLeft] * 12, Action.Done, p_hat="earlier")
    said = [n / 100 for n in range(13)]
    for n, probability in enumerate(said):
        robot.estimate = dataclasses.replace(robot.estimate, probability=probability)
        robot.run(episode, until=lambda _, n=n: len(policy.given) > n)
    assert policy.given != said
    assert all(given in said[: n + 1] for n, given in enumerate(policy.given))


@pytest.mark.parametrize(("p_hat", "given"), [("lidar", FREE.probability), ("both", OWN)])
def test_the_bundles_own_probability_counts_beside_the_lidars_when_told_so(p_hat, given):
    robot = Robot()
    episode, policy = episode_of(Action.MoveAhead, Action.Done, p_hat=p_hat)
    robot.run(episode)
    assert episode.outcome == "done"
    assert policy.given == [given, given]


def test_a_way_that_closes_stops_the_move():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=driving)
    robot.estimate = BLOCKED
    before = robot.x
    robot.run(episode)
    assert episode.outcome == "done"
    assert robot.x - before < 0.03


@pytest.mark.parametrize("age", [0, 2, 4])
@pytest.mark.parametrize(("spare", "arrives"), [(-0.01, True), (-0.03, False)])
def test_clearance_that_shrinks_with_the_way_does_not_stop_it_one_too_short_does(
    age, spare, arrives
):
    """Scans are ``age`` periods old: the way that was left at their stamps counts."""
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    stamped = []
    while not episode.ended:
        stamped.append((robot.t, 0.25 + spare - robot.x))
        t, room = stamped[-1 - min(age, len(stamped) - 1)]
        seen = Estimate(0.4, room, Verdict.GOOD, "", 1.0)
        robot.fields = {"estimate": StampedEstimate(round(t * 1e9), seen)}
        robot.tick(episode)
    if arrives:
        assert robot.x == pytest.approx(0.25, abs=0.01)
    else:
        assert robot.x < 0.1


def test_what_steps_close_while_driving_is_stopped_for_at_once():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=driving)
    left = 0.25 - robot.x
    robot.estimate = Estimate(0.97, left - 0.03, Verdict.GOOD, "", 1.0)
    assert robot.tick(episode).command == STOP


def test_step_and_time_limits():
    robot = Robot()
    episode, _ = episode_of(*[Action.RotateLeft] * 5, max_steps=3)
    robot.run(episode)
    assert (episode.outcome, episode.steps) == ("step_limit", 3)
    assert math.degrees(robot.yaw) == pytest.approx(135, abs=1)  # the last one is executed
    robot = Robot()
    episode, _ = episode_of(*[Action.RotateLeft] * 99, time_limit=5.0)
    robot.run(episode)
    assert episode.outcome == "time_limit"
    assert robot.t - 100.0 < 6.5


@pytest.mark.parametrize("outcome", ["canceled", "preempted"])
def test_ending_from_outside_stops_first(outcome):
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    episode.finish(outcome, "A test says so.")
    end = robot.t
    robot.run(episode)
    assert (episode.outcome, episode.message) == (outcome, "A test says so.")
    assert robot.t - end >= 0.5
    assert all(command == STOP for t, command in robot.commands if t >= end)
    episode.finish("done", "Too late.")
    assert episode.outcome == outcome


@pytest.mark.parametrize("limit", [math.nan, math.inf, -1.0])
def test_a_time_limit_that_is_none_is_refused(limit):
    episode, policy = episode_of(Action.Done, time_limit=limit)
    robot = Robot()
    robot.run(episode)
    assert (episode.outcome, policy.calls) == ("refused", [])
    assert episode.message == f"time_limit is {limit:g} s, expected 0 (none) or more."


def test_a_bump_ends_the_move_is_counted_once_and_the_episode_goes_on():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.Done)
    robot.run(episode, until=driving)
    x = robot.x
    robot.bumped, robot.bumper = robot.t, True  # from now on, at a side
    robot.run(episode)
    assert (episode.outcome, episode.track.bumps) == ("done", 1)
    assert robot.x - x < 0.02
    assert math.degrees(robot.yaw) == pytest.approx(45, abs=1)


def test_a_bump_before_the_episode_is_not_counted():
    robot = Robot()
    robot.bumped = 99.0
    episode, _ = episode_of(Action.RotateLeft, Action.Done)
    robot.run(episode)
    assert episode.track.bumps == 0


def test_a_blocked_move_goes_on_with_the_next_decision():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.Done, veto=False)
    robot.run(episode, until=driving)
    robot.stuck = True
    robot.run(episode, until=lambda e: e.steps == 2)
    robot.stuck = False
    assert robot.run(episode).outcome == "done"


def test_a_camera_without_tilt_needs_none():
    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, tilt=Tilt())
    robot.frozen = {"tilt"}
    episode, _ = episode_of(Action.LookDown, Action.Done, has_tilt=False)
    assert robot.run(episode).outcome == "done"
    assert robot.tilts == []
