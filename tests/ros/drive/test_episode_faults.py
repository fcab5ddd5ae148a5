"""Episodes in which something is missing, wrong or lost: waited for, refused or aborted."""

import dataclasses
import math
import re
from concurrent.futures import Future

import pytest
from cfnav_ros.drive.inputs import AgeLimits, CameraFrame, PictureCheck, SensorInputs
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import STOP
from cfnav_ros.drive.phases import Phase
from cfnav_ros.drive.preflight import BaseCheck

from cfnav_core.task.actions import Action
from tests.ros.scripted_robot import BLIND, DT, FREE, READY, Robot, driving, episode_of, run_now


@pytest.mark.parametrize("base", [READY, BaseCheck(waiting="No robot listens on /cmd_vel.")])
def test_an_unknown_goal_is_refused_at_once_with_the_known_ones(base):
    robot = Robot()
    robot.base = base
    robot.sense()
    robot.inputs = dataclasses.replace(SensorInputs(), base=base)
    robot.frozen = {"frame", "odometry", "estimate", "tilt"}
    episode, policy = episode_of(Action.Done, goal="Unicorn")
    robot.tick(episode)
    assert (episode.ended, episode.outcome) == (True, "refused")
    assert episode.message == (
        "The policy does not take this goal: found goal 'Unicorn', expected one of Laptop, Mug."
    )
    assert policy.calls == []


def test_what_a_policy_admits_beyond_its_trained_goals_is_looked_for():
    robot = Robot()
    episode, policy = episode_of(Action.Done, goal="Chair")
    policy.admits = lambda goal: "" if goal == "Chair" else "found another goal"
    robot.run(episode)
    assert (episode.outcome, policy.calls[0]) == ("done", ("reset", "Chair"))


def test_a_picture_that_cannot_be_read_is_refused():
    def bad():
        raise ValueError("The picture is encoded as yuv422.")

    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, frame=CameraFrame(round(100.5e9), bad))
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
    robot.inputs = dataclasses.replace(robot.inputs, **{name: getattr(SensorInputs(), name)})
    robot.frozen = {name}
    episode, _ = episode_of(Action.Done)
    robot.run(episode)
    assert episode.outcome == "refused"
    assert episode.message == f"No {'camera ' * (name == 'tilt')}{word} has arrived."
    assert 10 < robot.t - 100 < 11
    robot = Robot()
    robot.sense()
    robot.inputs = dataclasses.replace(robot.inputs, **{name: getattr(SensorInputs(), name)})
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


def test_an_input_that_is_late_for_one_tick_does_not_make_the_robot_jerk():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=lambda e: robot.v == pytest.approx(0.2))
    robot.fields = {"picture": PictureCheck(waiting="The camera is frozen.")}
    assert robot.tick(episode).command == STOP
    robot.fields = {}
    speeds = [robot.tick(episode).command.v for _ in range(3)]
    assert speeds == pytest.approx([0.05, 0.075, 0.1])
    assert robot.run(episode).outcome == "done"


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
    assert set(policy.given) == {1.0}


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


def test_a_base_that_never_moves_ends_the_episode():
    robot = Robot()
    robot.stuck = True
    episode, _ = episode_of(*[Action.RotateLeft] * 50)
    robot.run(episode)
    assert episode.outcome == "aborted"
    told_at = next(t for t, command in robot.commands if command.w)
    began, named, rest = re.split(r" (\S+) s ", episode.message, maxsplit=1)
    assert began == "3 motions failed: The base has not moved"
    assert float(named) == pytest.approx(robot.t - 0.5 - told_at, abs=0.15)
    assert rest == "after it was told to: its commands come late or are lost, or it cannot move."


def test_a_camera_that_does_not_tilt_ends_the_episode():
    robot = Robot()
    robot.tilt_stuck = True
    episode, _ = episode_of(Action.LookDown, Action.Done)
    robot.run(episode)
    assert episode.outcome == "aborted"
    assert episode.message.startswith("The camera stays at 0.00 rad, expected -0.52 within ")


@pytest.mark.parametrize("moved", [True, False])
@pytest.mark.parametrize(("x", "yaw"), [(1.0, 0.0), (0.0, math.pi / 2)])
def test_an_odometry_reset_aborts(moved, x, yaw):
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving if moved else lambda e: e.phase is Phase.OBSERVE)
    robot.x, robot.yaw = robot.x + x, robot.yaw + yaw
    assert robot.tick(episode).command == STOP
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
        robot.v, robot.x = 0.1, robot.x + 0.1 * DT  # it rolls, whatever is commanded
        robot.tick(episode)
        assert robot.t < 120
    assert episode.message.startswith("The base does not come to rest: ")


def test_who_stands_and_sees_nothing_new_says_so():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, ages=AgeLimits(frame=9.0))
    robot.run(episode, until=driving)
    robot.frozen = {"frame"}
    robot.run(episode)
    assert episode.message == "No new picture or scan arrives of where the robot stands."


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
    with pytest.raises(ValueError, match="p_hat is 'rgb', expected lidar, own, both, zero or ear"):
        EpisodeLimits(p_hat="rgb")
    with pytest.raises(ValueError, match=r"'shuffled', which meant two things: .* may be lidar, "):
        EpisodeLimits(p_hat="shuffled")
    with pytest.raises(ValueError, match="p_hat is 'own', which does without the LiDAR, and veto"):
        EpisodeLimits(p_hat="own")


def test_after_a_leap_of_node_time_the_robot_is_stopped_as_at_every_end():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 5)
    robot.run(episode, until=lambda episode: driving(episode) and robot.v > 0.15)
    robot.t += 10.0
    episode.fail("Node time leapt ahead.")
    robot.move = lambda command: None  # the first zeros are lost
    for _ in range(8):
        assert robot.tick(episode).command == STOP
        assert not episode.ended
    del robot.move
    robot.run(episode)
    assert (episode.outcome, robot.v) == ("aborted", 0.0)


def test_a_bump_of_before_node_time_began_anew_hides_no_new_one():
    robot = Robot()
    robot.bumped = robot.bump_stamp = robot.t + 4900.0
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=lambda episode: driving(episode) and robot.v > 0.15)
    robot.bumped, robot.bump_stamp, robot.bumper = robot.t, robot.t, True
    robot.tick(episode)
    robot.bumper = False
    robot.run(episode)
    assert episode.track.bumps == 1
