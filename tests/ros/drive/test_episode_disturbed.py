"""Episodes in which the base does not do what it is told, or may not be driven any more."""

import dataclasses
import math

import pytest
from cfnav_ros.drive.inputs import PictureCheck
from cfnav_ros.drive.motion import STOP, Command, Odometry
from cfnav_ros.drive.phases import Phase
from cfnav_ros.drive.preflight import UNSTAMPED, BaseCheck

from cfnav_core.task.actions import Action
from tests.ros.scripted_robot import BLIND, BLOCKED, DT, FREE, Robot, driving, episode_of, run_now


def observing(episode):
    return episode.phase is Phase.OBSERVE and episode.track.still_since is not None


def push(robot, episode, x=0.0, y=0.15, yaw=0.0, ticks=10):
    """Displace the robot by so much within half a second."""
    for _ in range(ticks):
        robot.x, robot.y = robot.x + x / ticks, robot.y + y / ticks
        robot.yaw += yaw / ticks
        robot.tick(episode)


class Slow:
    """Answers ``act`` only when told."""

    def __init__(self):
        self.waiting = []

    def __call__(self, function, *args):
        future = run_now(function, *args)
        if function.__name__ == "reset":
            return future
        self.waiting.append(future)
        done = future.done
        future.done = lambda: not self.waiting and done()
        return future


def test_a_push_before_a_decision_means_looking_again():
    robot = Robot()
    episode, _ = episode_of(Action.RotateLeft, Action.Done)
    robot.run(episode, until=observing)
    push(robot, episode, yaw=math.radians(15))
    pushed_at = robot.t
    robot.run(episode)
    assert (episode.outcome, episode.pushes) == ("done", 1)
    assert robot.records[0][1].image_stamp_ns * 1e-9 > pushed_at
    # 15 degrees off, the next heading of the set is nearest to where the push left it.
    assert math.degrees(robot.yaw) == pytest.approx(45, abs=2)


def test_a_move_decided_before_a_push_is_not_executed():
    robot, slow = Robot(), Slow()
    episode, _ = episode_of(Action.MoveAhead, Action.Done, submit=slow)
    robot.run(episode, until=lambda e: e.phase is Phase.THINK)
    for _ in range(4):
        robot.tick(episode)
    push(robot, episode)
    before = (robot.x, robot.y)
    slow.waiting.clear()
    robot.run(episode, until=lambda e: e.steps == 1)
    assert episode.vetoes == 1
    assert robot.records[0][1].vetoed
    slow.waiting.clear()
    robot.run(episode, until=lambda e: e.phase is Phase.THINK)
    slow.waiting.clear()
    robot.run(episode)
    assert episode.outcome == "done"
    assert (robot.x, robot.y) == before


@pytest.mark.parametrize("estimate", [BLOCKED, BLIND])
@pytest.mark.parametrize("veto", [True, False])
def test_who_steps_in_while_the_policy_thinks_is_heeded(estimate, veto):
    robot, slow = Robot(), Slow()
    episode, policy = episode_of(Action.MoveAhead, Action.Done, submit=slow, veto=veto)
    robot.run(episode, until=lambda e: e.phase is Phase.THINK)
    for tick in range(60):
        robot.tick(episode)
        robot.estimate = estimate if tick > 20 else robot.estimate
    slow.waiting.clear()
    robot.run(episode, until=lambda e: e.steps == 1)
    assert policy.given == [0.01]
    assert (episode.vetoes, robot.records[0][1].vetoed) == (int(veto), veto)
    assert (episode.phase is Phase.MOVE) is not veto


def test_a_move_off_its_heading_turns_looks_again_and_heeds_what_lies_there():
    robot = Robot()
    episode, policy = episode_of(Action.MoveAhead, Action.MoveAhead, Action.Done)
    robot.run(episode, until=observing)
    push(robot, episode, y=0.0, yaw=math.radians(20))
    while not episode.ended:
        robot.tick(episode)
        robot.estimate = BLOCKED if abs(robot.yaw) < math.radians(2) else FREE
    assert (episode.outcome, episode.vetoes) == ("done", 1)
    assert policy.given == [0.01, 0.97, 0.97]
    assert (robot.x, robot.y) == (0.0, 0.0)
    assert robot.yaw == pytest.approx(0.0, abs=math.radians(1))


def test_done_decided_before_a_push_means_looking_again():
    robot, slow = Robot(), Slow()
    episode, policy = episode_of(Action.Done, Action.RotateLeft, Action.Done, submit=slow)
    robot.run(episode, until=lambda e: e.phase is Phase.THINK)
    for _ in range(4):
        robot.tick(episode)
    push(robot, episode)
    pushed_at = robot.t
    slow.waiting.clear()
    robot.run(episode, until=lambda e: e.steps == 1)
    assert (episode.outcome, robot.records[0][1].vetoed) == ("", True)
    for _ in range(2):
        robot.run(episode, until=lambda e: e.phase is Phase.THINK)
        slow.waiting.clear()
        robot.run(episode, until=lambda e: e.phase is not Phase.THINK)
    robot.run(episode)
    assert (episode.outcome, episode.steps, policy.actions) == ("done", 3, [])
    assert robot.records[1][1].image_stamp_ns * 1e-9 > pushed_at


def test_a_turn_decided_before_a_push_waits_until_the_base_stands():
    robot, slow = Robot(), Slow()
    episode, _ = episode_of(Action.RotateLeft, Action.Done, submit=slow)
    robot.run(episode, until=lambda e: e.phase is Phase.THINK)
    for _ in range(4):
        robot.tick(episode)
    for tick in range(20):
        robot.y += 0.02
        robot.tick(episode)
        if tick == 5:
            slow.waiting.clear()
    assert episode.steps == 0
    robot.run(episode, until=lambda e: e.phase is Phase.MOVE)
    assert episode.steps == 1


@pytest.mark.parametrize("action", [Action.MoveAhead, Action.RotateLeft])
def test_a_push_during_a_motion_ends_it(action):
    robot = Robot()
    episode, policy = episode_of(action, Action.Done)
    robot.run(episode, until=lambda e: e.phase is Phase.MOVE)
    for _ in range(5):
        robot.tick(episode)
    push(robot, episode)
    assert episode.pushes == 1
    assert robot.commands[-1][1] == STOP
    robot.run(episode)
    assert (episode.outcome, episode.pushes, policy.actions) == ("done", 1, [])


def test_too_many_pushes_end_the_episode():
    robot = Robot()
    episode, _ = episode_of(*[Action.RotateLeft] * 9, max_pushes=3)
    for _ in range(3):
        robot.run(episode, until=lambda e: observing(e) or e.ended)
        push(robot, episode, ticks=4)
    robot.run(episode)
    assert episode.outcome == "aborted"
    assert episode.message.startswith("The base moved by itself 3 times")


@pytest.mark.parametrize(("lasts", "outcome"), [(3.0, "done"), (10.0, "aborted")])
@pytest.mark.parametrize("action", [Action.MoveAhead, Action.RotateLeft])
def test_a_base_that_drives_by_itself_is_told_to_stand_and_given_up_when_it_lasts(
    action, lasts, outcome
):
    robot = Robot()
    episode, _ = episode_of(action, Action.Done)
    robot.run(episode, until=lambda e: e.phase is Phase.MOVE and robot.v + robot.w > 0.1)
    obey, began, told = robot.move, robot.t, []

    def act(command):
        told.append(command)
        obey(Command(0.1, 0.5) if robot.t - began < lasts else command)

    robot.move = act
    robot.run(episode)
    assert episode.outcome == outcome, episode.message
    assert set(told[round(2.0 / DT) :]) == {STOP}
    if outcome == "aborted":
        assert episode.message.startswith("The base does not come to rest: ")


def test_the_reflex_after_a_bump_is_no_push():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.Done)
    robot.run(episode, until=driving)
    robot.bumped, robot.bumper = robot.t, True
    robot.tick(episode)
    for _ in range(4):
        robot.tick(episode)  # it rests, then its reflex backs off
    robot.bumper = False
    push(robot, episode, x=-0.1, y=0.0, ticks=15)
    robot.run(episode)
    assert (episode.outcome, episode.track.bumps, episode.pushes) == ("done", 1, 0)


def test_a_pressed_bumper_forbids_driving_ahead_but_no_turn():
    """One report tells of it: the firmware is silent until the bumper is free."""
    robot = Robot()
    robot.bumped, robot.bumper = robot.t, True
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.MoveAhead, Action.Done)
    while not episode.ended:
        robot.tick(episode)
    assert (episode.outcome, robot.x, robot.y) == ("done", 0.0, 0.0)
    assert math.degrees(robot.yaw) == pytest.approx(45, abs=1)


@pytest.mark.parametrize("skew", [0.0, 5.0, -5.0])
def test_a_short_bump_stamped_by_another_clock_ends_only_the_move_under_way(skew):
    """It was pressed and free again between two looks."""
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, *[Action.RotateLeft] * 2, *[Action.MoveAhead] * 3,
                            Action.Done)  # fmt: skip
    robot.run(episode, until=driving)
    robot.bumped, robot.bump_stamp = robot.t, robot.t + skew
    robot.tick(episode)
    assert robot.commands[-1][1] == STOP
    robot.run(episode)
    assert (episode.outcome, episode.track.bumps) == ("done", 1)
    assert robot.y == pytest.approx(0.75, abs=0.04)


def test_a_bump_before_the_episode_is_old():
    robot = Robot()
    robot.bumped = robot.t
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode)
    assert (episode.track.bumps, robot.x) == (0, pytest.approx(0.25, abs=0.01))


def test_a_bumper_that_is_pressed_from_before_the_episode_blocks_and_is_no_bump_of_it():
    robot = Robot()
    robot.bumped, robot.bumper = robot.t, True
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode)
    assert (episode.outcome, episode.track.bumps, robot.x) == ("done", 0, 0.0)


def test_a_push_long_after_a_bump_stamped_ahead_is_a_push():
    robot = Robot()
    episode, _ = episode_of(*[Action.RotateLeft] * 3, Action.Done)
    robot.run(episode, until=observing)
    robot.bumped, robot.bump_stamp = robot.t, robot.t + 60.0
    robot.run(episode, until=lambda e: e.steps == 2)
    robot.run(episode, until=observing)
    assert robot.t - 100.0 > 2.5
    push(robot, episode)
    assert episode.pushes == 1


def test_wheels_that_slip_end_a_motion_soon_and_then_the_episode():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    robot.slips = True
    slipped = robot.t
    robot.run(episode, until=lambda e: e.phase is not Phase.MOVE)
    assert robot.t - slipped < 0.5
    robot.run(episode)
    assert episode.outcome == "aborted"
    assert episode.message.startswith("3 motions failed: The base slips")


def test_odometry_that_freezes_while_driving_stops_the_robot_for_good():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    frozen, since = dataclasses.replace(robot.inputs.odometry), robot.t
    robot.odometry = lambda t: dataclasses.replace(frozen, stamp=t)
    robot.run(episode)
    assert "its odometry is frozen" in episode.message
    assert all(command == STOP for t, command in robot.commands if t > since + 0.4)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"docked": True}, "The robot sits on its dock: undock it first."),
        ({"powered": False}, "The wheels have no power: release the emergency stop of the base."),
        ({"battery": 0.14}, "The battery holds 14% (limit 15%): let the robot charge"),
        ({"base": BaseCheck(type=UNSTAMPED)}, "The listener on cmd_vel now wants geometry_msgs"),
    ],
)
def test_a_base_that_may_not_be_driven_ends_an_episode_at_once(fields, sentence):
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    robot.fields = fields
    robot.tick(episode)
    assert robot.commands[-1][1] == STOP
    robot.run(episode)
    assert episode.outcome == "aborted"
    assert episode.message.startswith(sentence)
    assert all(command == STOP for _, command in robot.commands[-12:])


@pytest.mark.parametrize("fields", [{"docked": True}, {"powered": False}, {"battery": 0.0}])
def test_a_base_that_may_not_be_driven_is_refused(fields):
    robot = Robot()
    robot.fields = fields
    episode, policy = episode_of(Action.Done)
    robot.run(episode)
    assert (episode.outcome, policy.calls) == ("refused", [])
    assert robot.t - 100 < 0.2


def test_a_listener_that_goes_away_stops_the_robot_and_ends_the_episode():
    robot = Robot()
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=driving)
    gone = robot.t
    robot.fields = {"base": BaseCheck(waiting="No robot listens on /cmd_vel.", deaf=True)}
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("aborted", "No robot listens on /cmd_vel.")
    assert all(command == STOP for t, command in robot.commands if t >= gone)


def test_a_listener_without_a_name_beside_the_robot_is_no_reason_to_stop():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=driving)
    robot.fields = {"base": BaseCheck(waiting="A listener on /cmd_vel has not said its name.")}
    assert robot.run(episode).outcome == "done"


def test_a_picture_that_cannot_be_trusted_stops_the_robot_until_it_can():
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    robot.run(episode, until=driving)
    robot.fields = {"picture": PictureCheck(waiting="The camera is frozen.")}
    for _ in range(20):
        assert robot.tick(episode).command == STOP
    robot.fields = {}
    robot.run(episode)
    assert episode.outcome == "done"
    assert robot.x == pytest.approx(0.25, abs=0.01)
    robot = Robot()
    episode, _ = episode_of(*[Action.RotateLeft] * 9)
    robot.run(episode, until=observing)
    robot.fields = {"picture": PictureCheck(waiting="The camera is frozen.")}
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("aborted", "The camera is frozen.")


def test_a_picture_that_does_not_suit_is_refused_at_once_and_an_empty_one_waited_for():
    robot = Robot()
    robot.fields = {"picture": PictureCheck(fault="The camera's pictures do not suit.")}
    episode, _ = episode_of(Action.Done)
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("refused", "The camera's pictures do not suit.")
    assert robot.t - 100 < 0.2
    robot = Robot()
    robot.fields = {"picture": PictureCheck(waiting="The picture shows nothing.")}
    episode, _ = episode_of(Action.Done)
    for _ in range(50):
        robot.tick(episode)
    robot.fields = {}
    assert robot.run(episode).outcome == "done"


def test_what_is_worse_is_said_first():
    """An emergency stop comes before a jump, a lost input and a time limit of the same moment."""
    robot = Robot()
    episode, _ = episode_of(*[Action.RotateLeft] * 9, time_limit=2.0)
    robot.run(episode, until=lambda e: robot.t > 101.95)
    robot.fields = {"powered": False}
    robot.odometry = lambda t: Odometry(t - 1.0, 5.0, 0.0, 0.0)
    robot.estimate = BLOCKED
    robot.t += 2 * DT
    robot.run(episode)
    assert episode.message.startswith("The wheels have no power")
