"""An episode of a robot that sits on its dock, and of one that goes back to it; without ROS."""

from __future__ import annotations

import math
from concurrent.futures import Future

import pytest
from cfnav_ros.drive.inputs import CameraFrame
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import STOP
from cfnav_ros.drive.phases import Phase
from cfnav_ros.drive.preflight import BaseCheck

from cfnav_core.task.actions import Action
from tests.ros.scripted_robot import Episode, Robot, ScriptedPolicy, run_now

AWAY = {"frame": CameraFrame()}
"""On the dock the camera sleeps."""


class Dock:
    """The base's two actions; the robot of a test sits on the dock or not."""

    def __init__(self, robot, docked=True, served=True):
        self.robot, self.served = robot, served
        self.asked = []
        self.put(docked)

    def put(self, docked):
        self.robot.fields = {"docked": docked, **(AWAY if docked else {})}

    def ask(self):
        if not self.served:
            return None
        self.asked.append(Future())
        return self.asked[-1]

    def episode(self, *actions, undock=True, dock=False, goal="Laptop", **limits):
        return Episode(
            goal, ScriptedPolicy(*actions), run_now, EpisodeLimits(**limits),
            undock=self.ask if undock else None, dock=self.ask if dock else None,
        )  # fmt: skip


def test_a_robot_on_its_dock_leaves_it_and_then_its_episode_begins():
    robot = Robot()
    dock = Dock(robot)
    episode = dock.episode(Action.MoveAhead, Action.Done)
    robot.run(episode, until=lambda _: dock.asked)
    assert (episode.phase, episode.begun) == (Phase.UNDOCK, False)
    # It moves by itself, and its odometry begins anew.
    robot.x, robot.yaw = 3.0, math.pi
    robot.run(episode, until=lambda _: robot.t > 110.0)
    dock.asked[0].set_result("")
    robot.tick(episode)
    assert episode.phase is Phase.UNDOCK  # the base has yet to say that it is off
    robot.x = robot.yaw = 0.0
    dock.put(False)
    robot.run(episode)
    assert (episode.outcome, episode.steps) == ("done", 2), episode.message
    assert episode.track.path_length == pytest.approx(0.25, abs=0.02)
    assert robot.x == pytest.approx(0.25, abs=0.02)
    assert all(command == STOP for t, command in robot.commands if t < 110.0)


def test_without_being_asked_to_it_stays_and_says_so():
    robot = Robot()
    dock = Dock(robot)
    episode = dock.episode(undock=False)
    robot.run(episode)
    assert (episode.outcome, dock.asked) == ("refused", [])
    assert episode.message == "The robot sits on its dock: undock it first."


@pytest.mark.parametrize(
    ("base", "sentence"),
    [
        (BaseCheck(fault="It may be a real robot."), "It may be a real robot."),
        (BaseCheck(waiting="No robot listens."), "No robot listens."),
    ],
)
def test_a_base_that_may_not_be_driven_is_not_asked_to_leave_its_dock(base, sentence):
    robot = Robot()
    robot.base = base
    dock = Dock(robot)
    episode = dock.episode()
    robot.run(episode)
    assert (episode.outcome, episode.message, dock.asked) == ("refused", sentence, [])


def test_nor_is_one_whose_goal_nobody_knows():
    robot = Robot()
    dock = Dock(robot)
    episode = dock.episode(goal="Unicorn")
    robot.run(episode)
    assert (episode.outcome, dock.asked) == ("refused", [])


@pytest.mark.parametrize(
    ("served", "answer", "sentence"),
    [
        (False, None, "The robot did not leave its dock: nobody offers that."),
        (True, "the base refused", "The robot did not leave its dock: the base refused."),
        (True, "", "The robot did not leave its dock within 5 s."),
        (True, None, "The robot did not leave its dock within 5 s."),
    ],
)
def test_what_keeps_it_on_its_dock_is_one_sentence(served, answer, sentence):
    robot = Robot()
    dock = Dock(robot, served=served)
    episode = dock.episode(dock_timeout=5.0)
    if served:
        robot.run(episode, until=lambda _: dock.asked)
    if answer is not None:
        dock.asked[0].set_result(answer)
    robot.run(episode)
    assert (episode.outcome, episode.message) == ("refused", sentence)
    assert all(future.done() for future in dock.asked)


@pytest.mark.parametrize("outcome", ["canceled", "refused"])
def test_the_base_is_told_to_stop_leaving_when_the_goal_ends(outcome):
    robot = Robot()
    dock = Dock(robot)
    episode = dock.episode()
    robot.run(episode, until=lambda _: dock.asked)
    if outcome == "canceled":
        episode.finish("canceled", "The goal was canceled.")
    else:
        robot.fields = {**robot.fields, "powered": False}
        robot.tick(episode)
    assert (episode.ended, episode.outcome) == (True, outcome)
    assert dock.asked[0].cancelled()


def to_the_dock(robot, *actions, **limits):
    """A dock, and an episode that is over and on its way to it."""
    dock = Dock(robot, docked=False)
    episode = dock.episode(*actions or (Action.Done,), dock=True, **limits)
    robot.run(episode, until=lambda episode: episode.over)
    return dock, episode


def test_after_a_drive_it_goes_back_and_ends_on_its_dock():
    robot = Robot()
    dock, episode = to_the_dock(robot)
    assert (episode.phase, episode.outcome) == (Phase.DOCK, "done")
    robot.run(episode, until=lambda _: dock.asked)
    dock.asked[0].set_result("")
    dock.put(True)
    robot.run(episode)
    assert (episode.outcome, episode.steps) == ("done", 1)
    assert episode.message == "The policy says that it sees the Laptop."


def test_a_dock_that_is_not_reached_is_said_and_changes_no_outcome():
    robot = Robot()
    dock, episode = to_the_dock(robot, Action.RotateLeft, max_steps=1)
    robot.run(episode, until=lambda _: dock.asked)
    dock.asked[0].set_result("the base gave up")
    robot.run(episode)
    assert episode.outcome == "step_limit"
    assert episode.message == (
        "1 decisions were made without Done. The robot did not go back to its dock: the base gave "
        "up."
    )


def test_whoever_ends_the_goal_meanwhile_stops_the_robot_on_its_way():
    robot = Robot()
    dock, episode = to_the_dock(robot)
    robot.run(episode, until=lambda _: dock.asked)
    episode.finish("preempted", "A newer goal came.")
    assert (episode.ended, episode.outcome) == (True, "done")
    assert dock.asked[0].cancelled()


@pytest.mark.parametrize("outcome", ["preempted", "aborted"])
def test_what_happens_while_it_stops_keeps_it_from_its_dock(outcome):
    robot = Robot()
    dock = Dock(robot, docked=False)
    episode = dock.episode(Action.MoveAhead, Action.Done, dock=True)
    robot.run(episode, until=lambda episode: episode.phase is Phase.STOPPING)
    episode.finish(outcome, "Meanwhile something else came.")
    robot.run(episode)
    assert (episode.outcome, dock.asked) == ("done", [])


def test_a_time_limit_that_passes_while_it_stops_does_not():
    robot = Robot()
    dock = Dock(robot, docked=False)
    episode = dock.episode(Action.Done, dock=True)
    robot.run(episode, until=lambda episode: episode.phase is Phase.STOPPING)
    episode.finish("time_limit", "60 s have passed.")
    robot.run(episode, until=lambda _: dock.asked)
    assert (episode.phase, episode.outcome) == (Phase.DOCK, "done")


def test_a_battery_that_runs_low_on_the_way_is_no_reason_to_turn_back():
    robot = Robot()
    dock, episode = to_the_dock(robot)
    robot.run(episode, until=lambda _: dock.asked)
    robot.fields = {**robot.fields, "battery": 0.149}
    robot.tick(episode)
    assert episode.phase is Phase.DOCK
    dock.asked[0].set_result("")
    dock.put(True)
    robot.run(episode)
    assert episode.message == "The policy says that it sees the Laptop."


def test_what_breaks_off_the_way_to_the_dock_is_said():
    robot = Robot()
    dock, episode = to_the_dock(robot)
    robot.run(episode, until=lambda _: dock.asked)
    robot.fields = {**robot.fields, "powered": False}
    robot.run(episode)
    assert episode.outcome == "done"
    assert "that it sees the Laptop. The wheels have no power" in episode.message
    assert dock.asked[0].cancelled()


def test_after_an_abort_the_base_moves_no_more():
    robot = Robot()
    dock = Dock(robot, docked=False)
    episode = dock.episode(Action.MoveAhead, dock=True)
    robot.run(episode, until=lambda episode: episode.phase is Phase.MOVE)
    robot.fields = {"powered": False}
    robot.run(episode)
    assert (episode.outcome, dock.asked) == ("aborted", [])
