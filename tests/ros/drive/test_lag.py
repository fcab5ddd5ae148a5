"""Commands that come late: a base that obeys its queue, and one that drives into a wall with it."""

from __future__ import annotations

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


@pytest.mark.parametrize("late", [0.6, 1.0, 2.0, 10.0])
def test_a_late_base_goes_less_than_one_step_and_its_drive_ends(late: float) -> None:
    robot = LateRobot(late)
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode)
    assert episode.outcome == "aborted"
    robot.carry_out(20.0)
    assert 0 < robot.x < 0.25
    if late < 10:
        assert "late what it was told (limit 0.3 s): its commands wait somewhere" in episode.message
    else:
        assert "motions failed: MoveAhead made no progress" in episode.message


@pytest.mark.parametrize("late", [0.5, 1.0, 2.0, 10.0])
def test_a_base_that_gets_late_in_the_midst_of_a_motion_stays_before_the_wall(late: float) -> None:
    """0.40 m away: one MoveAhead is free, and the LiDAR forbids the second."""
    robot = LateRobot(0.0)
    episode, _ = episode_of(*[Action.MoveAhead] * 9)
    robot.run(episode, until=lambda e: robot.v > 0.1)
    robot.late = late
    for _ in range(600):
        if 0.40 - robot.x < 0.25:
            robot.estimate = BLOCKED
        robot.tick(episode)
    robot.carry_out(20.0)
    assert robot.x < 0.38
    assert episode.ended or late == 0.5


def test_a_base_that_stops_late_is_told_of() -> None:
    lag, said = Lag(0.3), []
    for tick in range(60):
        t = 0.05 * tick
        lag.told(t, AHEAD if tick < 20 else STOP)
        said.append(lag.late(Odometry(t, 0.0, 0.0, 0.0, 0.2 if 2 <= tick < 50 else 0.0)))
    assert [s for s in said if s] == [pytest.approx(0.8, abs=0.05)]


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
