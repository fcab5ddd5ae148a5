"""What a MoveAhead met once is not run into again."""

import dataclasses
import itertools
import math

import pytest
from cfnav_ros.drive.motion import Odometry, Status
from cfnav_ros.drive.phases import Phase
from cfnav_ros.drive.track import Met, Stop

from cfnav_core.task.actions import Action
from tests.ros.scripted_robot import DT, FREE, OWN, Robot, driving, episode_of

MOVE, LEFT, RIGHT = Action.MoveAhead, Action.RotateLeft, Action.RotateRight
WALL = 0.1
"""A table top that no scan shows, so far before the start, metres."""


def at(x=0.0, y=0.0, degrees=0.0):
    return Odometry(0.0, x, y, math.radians(degrees))


@pytest.mark.parametrize(
    ("pose", "leads_there"),
    [
        (at(), True),
        (at(0.05), True),  # a little beyond, as odometry sees it
        (at(-0.24), True),
        (at(-0.26), False),  # not yet
        (at(0.11), False),  # past it
        (at(0.0, 0.09), True),
        (at(0.0, -0.11), False),
        (at(degrees=22), True),
        (at(degrees=45), False),
        (at(degrees=180), False),  # away from it
        (at(-0.1, -0.1, 45), False),  # past it by another heading
    ],
)
def test_the_same_way_again_leads_to_what_was_met(pose, leads_there):
    met = Met()
    assert met.ahead(pose) is None
    stop = Stop(at(), Status.BUMPED, "The bumper was hit.")
    met.take(stop)
    assert met.ahead(pose) == (stop if leads_there else None)


def test_headings_are_compared_across_half_a_circle():
    met = Met()
    met.take(Stop(at(degrees=-179), Status.STALLED, "It slips."))
    assert met.ahead(at(degrees=179))


def before_a_table(*actions, **limits):
    """Drive a robot whose mast runs into what its LiDAR passes under: its wheels slip there."""
    robot, touched = Robot(), []
    episode, policy = episode_of(*actions, **limits)
    obey = robot.move

    def move(command):
        robot.slips = robot.x >= WALL and abs(robot.yaw) < 0.1 and command.v > 0
        touched.append(robot.slips)
        obey(command)

    robot.move = move
    robot.run(episode)
    touches = sum(now and not before for before, now in itertools.pairwise(touched))
    return robot, episode, policy, touches


@pytest.mark.parametrize("veto", [True, False])
def test_what_slipping_wheels_met_is_told_to_the_policy(veto):
    _, episode, policy, touches = before_a_table(MOVE, LEFT, RIGHT, Action.Done, veto=veto)
    assert (episode.outcome, touches) == ("done", 1)
    assert policy.given == [0.01, 1.0, 0.01, 1.0]


@pytest.mark.parametrize(("veto", "touches"), [(True, 1), (False, 2)])
def test_the_veto_keeps_from_touching_twice(veto, touches):
    actions = (MOVE, LEFT, RIGHT, MOVE, LEFT, Action.Done)
    robot, episode, _, touched = before_a_table(*actions, veto=veto)
    assert (episode.outcome, episode.vetoes, touched) == ("done", int(veto), touches)
    met = [record.met_before for _, record in robot.records]
    assert met == [False, True, False, True, True, False]


def test_a_policy_that_insists_ends_as_if_it_had_driven():
    _, episode, _, touches = before_a_table(*[MOVE] * 9)
    assert touches == 1
    assert (episode.outcome, episode.steps, episode.vetoes) == ("aborted", 3, 2)
    assert episode.message.startswith("3 motions failed: The base slips")


def test_a_bump_is_remembered_after_the_reflex_has_backed_off():
    robot = Robot()
    episode, policy = episode_of(MOVE, MOVE, LEFT, MOVE, Action.Done)
    robot.run(episode, until=driving)
    robot.bumped, robot.bumper = robot.t, True
    for _ in range(5):
        robot.tick(episode)
    robot.bumper = False
    for _ in range(15):
        robot.x -= 0.01
        robot.tick(episode)
    robot.run(episode)
    assert (episode.outcome, episode.vetoes, episode.track.bumps) == ("done", 1, 1)
    assert policy.given == [0.01, 1.0, 1.0, 0.01, 0.01]


def test_what_the_scan_shows_is_left_to_the_scan():
    """A MoveAhead that ended because the LiDAR saw its way closing met nothing."""
    robot = Robot()
    episode, policy = episode_of(MOVE, MOVE, Action.Done)
    robot.run(episode, until=driving)
    robot.estimate = dataclasses.replace(FREE, clearance=0.0)
    robot.run(episode, until=lambda e: e.phase is Phase.OBSERVE)
    robot.estimate = FREE
    robot.run(episode)
    assert (episode.outcome, policy.given) == ("done", [0.01, 0.01, 0.01])


def test_a_policy_without_a_lidar_is_given_its_own():
    _, _, policy, touches = before_a_table(MOVE, MOVE, Action.Done, veto=False, p_hat="own")
    assert touches == 2
    assert policy.given == [OWN] * 3


def backing_off(*actions, relayed, **limits):
    """Drive a robot whose base backs off by itself from a wall that no scan shows."""
    robot, touched, back = Robot(), [], [0]
    episode, policy = episode_of(*actions, **limits)
    obey = robot.move

    def move(command):
        if back[0]:
            back[0] -= 1
            robot.bumper = False
            robot.v, robot.w = -0.14, 0.0
            robot.x -= 0.14 * DT
        elif command.v > 0 and robot.x + command.v * DT >= WALL:
            touched.append(robot.t)
            back[0], robot.v = 16, 0.0
            if relayed:
                robot.bumped, robot.bumper = robot.t, True
        else:
            obey(command)

    robot.move = move
    robot.run(episode, limit=300)
    return episode, policy, len(touched)


@pytest.mark.parametrize("relayed", [True, False])
def test_a_reflex_that_nobody_explains_has_met_something(relayed):
    """A TurtleBot 4 on Jazzy relays no hazards; its base backs off all the same."""
    episode, _, touches = backing_off(*[MOVE] * 60, relayed=relayed)
    assert touches == 1
    assert episode.outcome == "aborted"
    _, policy, touches = backing_off(MOVE, MOVE, LEFT, Action.Done, relayed=relayed, veto=False)
    assert policy.given[1] == 1.0


def test_a_base_that_leaves_its_line_has_met_nothing():
    robot = Robot()
    episode, policy = episode_of(MOVE, MOVE, Action.Done)
    robot.run(episode, until=driving)
    robot.y += 0.09
    robot.run(episode)
    assert policy.given[1] == FREE.probability
