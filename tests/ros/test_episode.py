"""Whole episodes with a scripted policy on a small robot model, without ROS."""

import dataclasses
import math
from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np
import pytest
from cfnav_ros.episode import Episode, EpisodeLimits, Phase
from cfnav_ros.inputs import NEVER, Frame, Inputs, StampedEstimate, Tilt
from cfnav_ros.lidar import Estimate, Verdict
from cfnav_ros.motion import STOP, Odometry
from cfnav_ros.preflight import BaseCheck

from cfnav_core.actions import HORIZONS_RAD, Action

DT = 0.05
FREE = Estimate(0.01, 2.0, Verdict.GOOD, "", 1.0)
BLOCKED = Estimate(0.97, 0.10, Verdict.GOOD, "", 1.0)
BLIND = Estimate(1.0, 0.0, Verdict.BLIND, "Nothing returns.", 0.0)
READY = BaseCheck(type="geometry_msgs/msg/TwistStamped")


class ScriptedPolicy:
    """Answers a fixed list of actions and keeps what it was shown."""

    goals = ("Laptop", "Mug")

    def __init__(self, *actions):
        self.actions = list(actions)
        self.seen, self.calls = [], []

    def reset(self, goal):
        self.calls.append(("reset", goal))

    def act(self, rgb, collision_probability=None):
        self.calls.append(("act", int(rgb[0, 0, 0])))
        self.seen.append(collision_probability)
        return SimpleNamespace(
            action=self.actions.pop(0),
            probabilities=np.full(6, 1 / 6, np.float32),
            collision_probability=collision_probability or 0.0,
            detection_score=0.5,
        )


def run_now(function, *args):
    future = Future()
    try:
        future.set_result(function(*args))
    except Exception as error:
        future.set_exception(error)
    return future


class Robot:
    """Moves as commanded after one period; reports everything every period."""

    def __init__(self):
        self.t = 100.0
        self.x = self.y = self.yaw = self.tilt = self.v = self.w = 0.0
        self.estimate, self.base, self.bumped_at = FREE, READY, NEVER
        self.stuck, self.tilt_stuck = False, False
        self.frozen = set()  # inputs that no longer arrive
        self.inputs = None
        self.commands, self.tilts, self.records = [], [], []

    def sense(self):
        ns = round(self.t * 1e9)
        picture = np.full((4, 4, 3), int(self.t * 20) % 256, np.uint8)
        new = Inputs(
            base=self.base,
            frame=Frame(ns, lambda: picture),
            estimate=StampedEstimate(ns, self.estimate),
            odometry=Odometry(self.t, self.x, self.y, self.yaw, self.v, self.w),
            tilt=Tilt(self.t, self.tilt),
            bumped_at=self.bumped_at,
        )
        if self.inputs:
            kept = {name: getattr(self.inputs, name) for name in self.frozen}
            new = dataclasses.replace(new, **kept)
        self.inputs = new
        return new

    def tick(self, episode):
        output = episode.update(self.t, self.sense())
        self.commands.append((self.t, output.command))
        if output.tilt is not None:
            self.tilts.append(output.tilt)
            if not self.tilt_stuck:
                step = max(-0.1, min(0.1, output.tilt - self.tilt))
                self.tilt += step
        if output.record:
            self.records.append((self.t, output.record))
        self.v, self.w = (0.0, 0.0) if self.stuck else (output.command.v, output.command.w)
        self.x += self.v * math.cos(self.yaw) * DT
        self.y += self.v * math.sin(self.yaw) * DT
        self.yaw += self.w * DT
        self.t += DT
        return output

    def run(self, episode, until=lambda episode: episode.ended, limit=120.0):
        end = self.t + limit
        while not until(episode):
            self.tick(episode)
            assert self.t < end, f"nothing came of it, phase {episode.phase}"
        return episode


def episode_of(*actions, goal="Laptop", submit=run_now, time_limit=0.0, **limits):
    policy = ScriptedPolicy(*actions)
    episode = Episode(goal, policy, submit, EpisodeLimits(**limits), time_limit=time_limit)
    return episode, policy


def driving(episode):
    return episode.phase is Phase.MOVE and episode.track.path_length > 0.05


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
    assert robot.tilt == pytest.approx(HORIZONS_RAD[1], abs=0.02)
    assert policy.seen == [0.01] * 5
    assert robot.commands[-1][1] == STOP


def test_decisions_are_made_on_pictures_taken_after_the_robot_stood():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead, Action.RotateRight] * 4, Action.Done)
    robot.run(episode)
    moving = [t for t, command in robot.commands if command != STOP]
    for t, record in robot.records:
        last = max((m for m in moving if m < t), default=0.0)
        assert record.image_stamp_ns * 1e-9 >= last + DT + 0.15
        assert record.estimate_stamp_ns * 1e-9 >= last
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
    assert robot.tilt == pytest.approx(HORIZONS_RAD[1], abs=0.02)
    assert set(robot.tilts) == set(HORIZONS_RAD)


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
    assert policy.seen == [0.97] * 4


def test_without_veto_the_policy_is_obeyed():
    robot = Robot()
    robot.estimate = BLOCKED
    episode, policy = episode_of(Action.MoveAhead, Action.Done, veto=False)
    robot.run(episode)
    assert episode.vetoes == 0
    assert robot.x == pytest.approx(0.25, abs=0.01)
    assert policy.seen == [0.97] * 2


def test_without_lidar_the_policy_is_given_no_probability():
    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, estimate=Inputs().estimate)
    robot.frozen = {"estimate"}
    episode, policy = episode_of(Action.MoveAhead, Action.Done, lidar=False)
    robot.run(episode)
    assert episode.outcome == "done"
    assert policy.seen == [None, None]


def test_a_way_that_closes_stops_the_move():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=driving)
    robot.estimate = BLOCKED
    before = robot.x
    robot.run(episode)
    assert episode.outcome == "done"
    assert robot.x - before < 0.03


def test_clearance_that_shrinks_with_the_way_does_not_stop_it():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    while not episode.ended:
        room = 0.28 - robot.x
        robot.estimate = Estimate(0.4, room, Verdict.GOOD, "", 1.0)
        robot.tick(episode)
    assert robot.x == pytest.approx(0.25, abs=0.01)


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


def test_an_unknown_goal_is_refused_with_the_known_ones():
    robot = Robot()
    episode, policy = episode_of(Action.Done, goal="Unicorn")
    robot.run(episode)
    assert episode.outcome == "refused"
    assert "'Unicorn'" in episode.message
    assert "Laptop, Mug" in episode.message
    assert policy.calls == []


def test_a_picture_that_cannot_be_read_is_refused():
    def bad():
        raise ValueError("The picture is encoded as yuv422.")

    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, frame=Frame(round(100.5e9), bad))
    robot.frozen = {"frame"}
    episode, _ = episode_of(Action.Done)
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("refused", "The picture is encoded as yuv422.")


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("frame", "picture"),
        ("estimate", "collision estimate"),
        ("odometry", "odometry"),
        ("tilt", "tilt"),
    ],
)
def test_a_missing_input_is_waited_for_and_then_refused(name, word):
    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, **{name: getattr(Inputs(), name)})
    robot.frozen = {name}
    episode, _ = episode_of(Action.Done)
    robot.run(episode)
    assert episode.outcome == "refused"
    assert episode.message == f"No {'camera ' * (name == 'tilt')}{word} has arrived."
    assert 10 < robot.t - 100 < 11
    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, **{name: getattr(Inputs(), name)})
    robot.frozen = {name}
    episode, _ = episode_of(Action.Done)
    for _ in range(100):
        robot.tick(episode)
    robot.frozen = set()
    assert robot.run(episode).outcome == "done"


def test_no_robot_and_a_forbidden_robot_are_refused():
    robot = Robot()
    robot.base = BaseCheck(waiting="No robot listens on /cmd_vel.")
    episode, _ = episode_of(Action.Done)
    assert robot.run(episode).message == "No robot listens on /cmd_vel."
    robot = Robot()
    robot.base = BaseCheck(fault="create3_repub listens on /cmd_vel.")
    episode, _ = episode_of(Action.Done)
    robot.run(episode)
    assert episode.outcome == "refused"
    assert robot.t - 100 < 0.2


def test_a_rival_that_appears_while_driving_aborts():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    robot.base = BaseCheck(fault="teleop also publishes on /cmd_vel.")
    start = robot.t
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("aborted", "teleop also publishes on /cmd_vel.")
    assert all(command == STOP for t, command in robot.commands if t >= start)


@pytest.mark.parametrize(
    ("name", "word", "age"),
    [
        ("odometry", "odometry", 0.25),
        ("frame", "picture", 1.0),
        ("estimate", "collision estimate", 0.5),
        ("tilt", "camera tilt", 0.5),
    ],
)
def test_an_input_lost_while_driving_means_zero_then_abort(name, word, age):
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    robot.frozen = {name}
    lost = robot.t
    robot.run(episode)
    assert episode.outcome == "aborted"
    assert word in episode.message
    assert all(command == STOP for t, command in robot.commands if t > lost + age + 1e-6)
    assert 2.0 < robot.t - lost < age + 4.2


def test_an_input_that_comes_back_resumes_the_motion():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=driving)
    robot.frozen = {"odometry"}
    for _ in range(30):
        robot.tick(episode)
    assert robot.commands[-1][1] == STOP
    robot.frozen = set()
    robot.run(episode)
    assert episode.outcome == "done"
    assert robot.x == pytest.approx(0.25, abs=0.01)


def test_a_blind_lidar_forbids_moving_and_then_ends_the_episode():
    robot = Robot()
    episode, policy = episode_of(*[Action.MoveAhead] * 99)
    robot.run(episode, until=lambda e: e.phase is Phase.OBSERVE)
    robot.estimate = BLIND
    robot.run(episode)
    assert (episode.outcome, episode.message) == (
        "aborted",
        "The LiDAR is blind: Nothing returns.",
    )
    assert robot.x == 0.0
    assert set(policy.seen) == {1.0}


def test_a_lidar_that_is_blind_from_the_start_is_waited_for_and_then_refused():
    robot = Robot()
    robot.estimate = BLIND
    episode, _ = episode_of(Action.Done)
    for _ in range(150):
        robot.tick(episode)
    robot.estimate = FREE
    assert robot.run(episode).outcome == "done"
    robot = Robot()
    robot.estimate = BLIND
    episode, _ = episode_of(Action.Done)
    robot.run(episode)
    assert (episode.outcome, episode.message) == (
        "refused",
        "The LiDAR is blind: Nothing returns.",
    )


def test_a_bump_ends_the_move_is_counted_once_and_the_episode_goes_on():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.Done)
    robot.run(episode, until=driving)
    x = robot.x
    while not episode.ended:
        robot.bumped_at = robot.t  # pressed from now on
        robot.tick(episode)
    assert (episode.outcome, episode.track.bumps) == ("done", 1)
    assert robot.x - x < 0.02
    assert math.degrees(robot.yaw) == pytest.approx(45, abs=1)


def test_a_bump_before_the_episode_is_not_counted():
    robot = Robot()
    robot.bumped_at = 99.0
    episode, _ = episode_of(Action.RotateLeft, Action.Done)
    robot.run(episode)
    assert episode.track.bumps == 0


def test_a_base_that_never_moves_ends_the_episode():
    robot = Robot()
    robot.stuck = True
    episode, _ = episode_of(*[Action.RotateLeft] * 50)
    robot.run(episode)
    assert episode.outcome == "aborted"
    assert episode.message == "8 motions failed: RotateLeft made no progress for 1 s."


def test_a_blocked_move_goes_on_with_the_next_decision():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.Done, veto=False)
    robot.run(episode, until=driving)
    robot.stuck = True
    robot.run(episode, until=lambda e: e.steps == 2)
    robot.stuck = False
    assert robot.run(episode).outcome == "done"


def test_a_camera_that_does_not_tilt_ends_the_episode():
    robot = Robot()
    robot.tilt_stuck = True
    episode, _ = episode_of(Action.LookDown, Action.Done)
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("aborted", "The camera stays at 0.00 rad.")


def test_a_camera_without_tilt_needs_none():
    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, tilt=Tilt())
    robot.frozen = {"tilt"}
    episode, _ = episode_of(Action.LookDown, Action.Done, has_tilt=False)
    assert robot.run(episode).outcome == "done"
    assert robot.tilts == []


@pytest.mark.parametrize("moved", [True, False])
def test_an_odometry_reset_aborts(moved):
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving if moved else lambda e: e.phase is Phase.OBSERVE)
    robot.x += 1.0
    robot.run(episode)
    assert episode.outcome == "aborted"
    assert "Odometry jumped" in episode.message
    assert episode.track.path_length < 0.4


def test_a_clock_that_jumps_back_aborts():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    robot.t -= 50.0
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("aborted", "Node time jumped back.")


def test_a_robot_that_does_not_come_to_rest_is_given_up():
    robot = Robot()
    episode, _ = episode_of(Action.Done)
    while not episode.ended:
        robot.v = 0.1  # pushed along, whatever is commanded
        robot.tick(episode)
        assert robot.t < 120
    assert "does not come to rest" in episode.message


def test_a_slow_policy_is_waited_for_at_zero_velocity_and_asked_once():
    robot, asked = Robot(), []

    def submit(function, *args):
        if function.__name__ == "reset":
            return run_now(function, *args)
        asked.append((Future(), function, args))
        return asked[-1][0]

    episode, _ = episode_of(Action.RotateLeft, Action.Done, submit=submit)
    robot.run(episode, until=lambda e: e.phase is Phase.THINK)
    for _ in range(40):
        assert robot.tick(episode).command == STOP
    assert len(asked) == 1
    future, function, args = asked[0]
    future.set_result(function(*args))
    robot.run(episode, until=lambda e: e.phase is Phase.MOVE)
    assert episode.steps == 1
    robot.run(episode, until=lambda e: e.phase is Phase.THINK)
    robot.run(episode)  # never answered
    assert (episode.outcome, episode.message) == ("aborted", "The policy did not answer in time.")


def test_a_policy_that_fails_aborts_with_its_words():
    robot = Robot()
    episode, _ = episode_of()  # nothing scripted: pop from empty list
    robot.run(episode)
    assert (episode.outcome, episode.message) == (
        "aborted",
        "The policy failed: pop from empty list",
    )


def test_bad_limits_are_refused():
    with pytest.raises(ValueError, match="max_steps is 0"):
        EpisodeLimits(max_steps=0)
    with pytest.raises(ValueError, match="veto_probability is 0"):
        EpisodeLimits(veto_probability=0.0)
