"""Commands that come late: a base that obeys its queue, and one that drives into a wall with it."""

from __future__ import annotations

import re

import pytest
from cfnav_ros.drive.lag import Lag
from cfnav_ros.drive.motion import STOP, Command, Odometry

from cfnav_core.task.actions import Action
from tests.ros.scripted_robot import BLOCKED, Robot, episode_of

AHEAD = Command(0.2)


HOLDS_S = 0.5
"""How long a base keeps a command."""


class LateRobot(Robot):
    """Hears what it is told some seconds later, from a time on."""

    def __init__(self, late: float) -> None:
        super().__init__()
        self.late, self._heard = late, [(0.0, STOP)]

    def move(self, command: Command) -> None:
        self._heard.append((self.t + self.late, command))
        heard_at, newest = [heard for heard in self._heard if heard[0] <= self.t + 1e-9][-1]
        super().move(newest if self.t - heard_at <= HOLDS_S else STOP)

    def carry_out(self, seconds: float) -> None:
        """What is under way still arrives."""
        for _ in range(round(seconds / 0.05)):
            self.t += 0.05
            self.move(STOP)


@pytest.mark.parametrize("late", [0.0, 0.1, 0.2, 0.25])
def test_a_base_that_is_a_little_late_is_driven(late: float) -> None:
    robot = LateRobot(late)
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.MoveAhead, Action.Done)
    robot.run(episode)
    assert episode.outcome == "done", episode.message


def told_lag(message: str) -> float:
    """The lag that a sentence names, seconds; the sentence must be one of lateness."""
    late = r"The base did (\S+) s late what it was told \(limit 0.3 s\): its commands wait"
    still = r"3 motions failed: The base has not moved (\S+) s after it was told to: its commands"
    found = re.match(f"{late}|{still}", message)
    assert found, message
    return float(found[1] or found[2])


@pytest.mark.parametrize("late", [0.35, 0.4, 0.5, 0.6, 1.0, 2.0, 4.0, 10.0])
def test_a_late_base_goes_less_than_one_step_and_its_drive_ends(late: float) -> None:
    robot = LateRobot(late)
    episode, _ = episode_of(*[Action.MoveAhead] * 99)
    robot.run(episode, limit=5.0)
    assert episode.outcome == "aborted"
    robot.carry_out(20.0)
    assert 0 < robot.x < 0.25
    assert told_lag(episode.message) == pytest.approx(min(late, 3.5), abs=0.11)


@pytest.mark.parametrize("wall", [False, True])
@pytest.mark.parametrize("action", [Action.MoveAhead, Action.RotateLeft])
@pytest.mark.parametrize("late", [0.5, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 10.0])
def test_a_base_that_gets_late_in_the_midst_of_a_motion_stays_before_the_wall(
    late: float, action: Action, wall: bool
) -> None:
    """0.40 m away: one MoveAhead is free, and the LiDAR forbids the second."""
    robot = LateRobot(0.0)
    episode, _ = episode_of(action, *[Action.MoveAhead] * 999)
    robot.run(episode, until=lambda e: robot.v > 0.1 or robot.w > 0.3)
    robot.late, began = late, robot.t
    while not episode.ended:
        if wall and 0.40 - robot.x < 0.25:
            robot.estimate = BLOCKED
        robot.tick(episode)
        assert robot.t < began + 8.5, "the drive did not end in time"
    robot.carry_out(20.0)
    assert robot.x < 0.38
    named = told_lag(episode.message)
    if late != 3.0:  # then what was queued is taken for an obeyed retry at first
        assert named == pytest.approx(min(late, 4.0), abs=0.16)


def test_a_lag_just_beyond_the_limit_is_told_by_two_motions() -> None:
    robot = LateRobot(0.0)
    episode, _ = episode_of(*[Action.MoveAhead] * 99)
    robot.run(episode, until=lambda e: robot.v > 0.1)
    robot.late = 0.35
    robot.run(episode, limit=5.0)
    assert told_lag(episode.message) == pytest.approx(0.35, abs=0.06)


@pytest.mark.parametrize(
    ("moves_until", "said"), [(1.55, []), (1.65, [0.39]), (1.8, [0.54]), (2.5, [])]
)
def test_a_base_that_stops_late_is_told_of(moves_until: float, said: list[float]) -> None:
    """It is told to at 1 s, which takes 0.2 s; who goes on for another second drives by itself."""
    lag, found = Lag(0.3), []
    for tick in range(100):
        t = 0.05 * tick
        lag.told(t, AHEAD if tick < 20 else STOP)
        v = 0.2 if 0.1 <= t < moves_until - 0.01 else 0.0
        found.append(lag.late(Odometry(t, 0.0, 0.0, 0.0, v)))
    assert [late for late in found if late] == pytest.approx(said, abs=0.03)


def test_one_late_command_is_no_reason_to_end() -> None:
    robot = LateRobot(0.0)
    episode, _ = episode_of(*[Action.MoveAhead] * 4, Action.Done)
    robot.stuck = True
    robot.run(episode, until=lambda e: robot.t > 101.5)
    robot.stuck = False
    robot.run(episode)
    assert episode.outcome == "done", episode.message


def test_a_motion_that_pauses_again_and_again_is_one_try() -> None:
    lag = Lag(0.3)
    for k in range(6):  # odometry of 3 Hz that is 0.25 s old at most
        t = 0.33 * k
        assert lag.told(t, AHEAD) == AHEAD
        lag.pause(t + 0.25)
        assert lag.late(Odometry(t + 0.33, 0.0, 0.0, 0.0, 0.0)) == 0.0
