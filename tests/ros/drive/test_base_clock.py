"""A base whose clock is not the computer's: how far it may be off, and what is said beyond."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from cfnav_ros.drive.inputs import AgeLimits, SensorInputs
from cfnav_ros.drive.motion import STOP, Odometry
from cfnav_ros.robot.stamps import FUTURE_S

from cfnav_core.task.actions import Action
from tests.ros.scripted_robot import DT, Robot, driving, episode_of

BEHIND, AHEAD = "s after its stamp (limit 0.25 s): it is late, or the clock", "s in the future"


class OtherClock(Robot):
    """Stamps its odometry by a clock that is ahead by so many s at a time."""

    def __init__(self, ahead: Callable[[float], float]) -> None:
        super().__init__()
        self.odometry = lambda t: Odometry(t + ahead(t), self.x, self.y, self.yaw, self.v, self.w)

    def sense(self) -> SensorInputs:
        self.fields = {"arrived": {"odometry": self.t}}
        return super().sense()


@pytest.mark.parametrize("ahead", [-0.2, -0.1, 0.1, 0.3, 0.45])
def test_a_base_whose_clock_is_a_little_off_drives_as_ever(ahead: float) -> None:
    robot = OtherClock(lambda t: ahead)
    episode, _ = episode_of(Action.MoveAhead, Action.RotateLeft, Action.MoveAhead, Action.Done)
    robot.run(episode)
    assert (episode.outcome, episode.steps, episode.pushes) == ("done", 4, 0), episode.message
    assert episode.track.path_length == pytest.approx(0.5, abs=0.06)


@pytest.mark.parametrize(("ahead", "says"), [(-0.3, BEHIND), (0.6, AHEAD)])
def test_a_base_whose_clock_is_far_off_is_refused(ahead: float, says: str) -> None:
    robot = OtherClock(lambda t: ahead)
    episode, _ = episode_of(Action.MoveAhead)
    robot.run(episode)
    assert (episode.outcome, robot.x) == ("refused", 0.0)
    assert says in episode.message


@pytest.mark.parametrize(
    ("drift", "most", "says"),
    [(-0.25, AgeLimits().odometry, BEHIND), (0.25, FUTURE_S, AHEAD)],
)
def test_a_base_whose_clock_drifts_is_driven_until_it_is_far_off(
    drift: float, most: float, says: str
) -> None:
    begun = [float("inf")]
    robot = OtherClock(lambda t: drift * max(t - begun[0], 0.0))
    episode, _ = episode_of(*[Action.MoveAhead] * 20)
    robot.run(episode, until=driving)
    begun[0] = robot.t
    robot.run(episode)
    stops = begun[0] + most / abs(drift)
    moved = [t for t, command in robot.commands if command != STOP]
    assert stops - 1.5 < moved[-1] < stops + DT  # between two motions it stands anyway
    assert (episode.outcome, says in episode.message) == ("aborted", True), episode.message
