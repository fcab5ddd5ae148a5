"""When a moment of a simulator in lock-step is complete, and what it is answered."""

import dataclasses

import pytest
from cfnav_ros.drive.inputs import SensorInputs
from cfnav_ros.drive.lock_step import Answer, LockStep, Moment

from tests.ros.scripted_robot import Robot

NS = 123_450_000_000
MOMENT = Moment(NS + 10, NS, NS, NS)


def inputs():
    robot = Robot()
    robot.t = 123.45
    return robot.sense()


@pytest.fixture
def step():
    step = LockStep(lidar=True, tilt=True)
    step.begin(MOMENT)
    return step


def test_a_moment_is_complete_when_its_messages_are_there(step):
    assert step.complete(inputs())
    assert not step.complete(SensorInputs())
    assert not LockStep(lidar=True, tilt=True).complete(inputs())


@pytest.mark.parametrize("name", ["image_ns", "scan_ns", "odometry_ns"])
def test_every_stamp_of_the_moment_counts_unless_there_is_none(name):
    step = LockStep(lidar=True, tilt=True)
    step.begin(dataclasses.replace(MOMENT, **{name: NS + 50_000_000}))
    assert not step.complete(inputs())
    step.begin(dataclasses.replace(MOMENT, **{name: 0}))
    assert step.complete(inputs())


def test_estimate_and_tilt_count_only_where_they_are_used():
    late = dataclasses.replace(MOMENT, scan_ns=NS + 1_000_000)
    step = LockStep(lidar=False, tilt=True)
    step.begin(late)
    assert step.complete(inputs())
    robot = Robot()
    robot.t = 123.45
    robot.sense()
    robot.frozen = {"tilt"}
    robot.t += 0.05
    given, moved = robot.sense(), Moment(NS, *[NS + 50_000_000] * 3)
    for tilt in (True, False):
        step = LockStep(lidar=True, tilt=tilt)
        step.begin(moved)
        assert step.complete(given) is not tilt


def test_an_idle_moment_is_kept_for_the_next_goal(step):
    assert step.say_idle(1.0) == Answer(NS + 10, idle=True)
    assert step.say_idle(1.5) is None
    assert step.say_idle(2.1) == Answer(NS + 10, idle=True)  # in case nobody heard
    assert step.complete(inputs())
    assert step.answer(3.0) == Answer(NS + 10, idle=False)
    assert not step.complete(inputs())


def test_an_answer_is_repeated_until_the_next_moment_comes(step):
    step.answer(3.0)
    assert step.repeat(3.5) is None
    assert step.repeat(4.1) == Answer(NS + 10, idle=False)
    step.begin(MOMENT)  # it asks again
    assert step.moment is None
    assert step.repeat(4.2) == Answer(NS + 10, idle=False)
    step.begin(dataclasses.replace(MOMENT, stamp_ns=NS + 20))
    assert step.moment is not None


def test_messages_that_never_come_are_taken_for_lost(step):
    assert not step.lost(1.0)
    assert not step.lost(3.9)
    assert step.lost(4.1)
    step.begin(dataclasses.replace(MOMENT, stamp_ns=NS + 20))
    assert not step.lost(4.2)
    step.answer(4.3)
    assert not step.lost(9.0)


def test_the_silence_counts_from_what_was_acted_on(step):
    step.restart(1.0)
    assert step.silence(4.0) == 3.0
    step.answer(5.0)  # messages were lost
    assert step.silence(6.0) == 5.0
    step.begin(dataclasses.replace(MOMENT, stamp_ns=NS + 20))
    step.act(7.0)
    assert step.silence(7.5) == 0.5


def test_what_the_simulator_has_not_sent_since_it_began_anew_does_not_count(step):
    step.begin(Moment(NS + 20, odometry_ns=NS))
    t, left = step.present(inputs())
    assert t == pytest.approx(1000.0, abs=1e-9)
    assert left.odometry.stamp == left.tilt.stamp == pytest.approx(1000.0 - 2e-8, abs=1e-9)
    assert (left.frame, left.estimate) == (SensorInputs().frame, SensorInputs().estimate)


def test_an_episode_does_not_depend_on_when_it_begins():
    seen = []
    for begun in (0.05, 12345.65, 777777.1):
        step, robot = LockStep(lidar=True, tilt=True), Robot()
        step.restart(0.0)
        ticks = []
        for tick in range(30):
            ns = round((begun + 0.05 * tick) * 1e9)
            robot.t = ns * 1e-9
            came = robot.t - 0.01 * (len(seen) + tick) % 0.05  # the node's clock is not in step
            given = dataclasses.replace(
                robot.sense(), bumped_at=robot.t, arrived={"tilt": came, "bumped_at": came}
            )
            step.begin(Moment(ns, ns, ns, ns))
            t, now = step.present(given)
            ticks.append((t, now.frame.stamp_ns, now.estimate, now.odometry, now.tilt, now.arrived))
            ticks.append((now.bumped_at, now.bumper))
            step.answer(0.0)
        seen.append(ticks)
    assert seen[0] == seen[1] == seen[2]


def test_a_message_came_at_the_moment_at_which_it_is_first_presented(step):
    given = dataclasses.replace(inputs(), bumped_at=5.0, arrived={"bumped_at": 5.0})
    t, first = step.present(given)
    assert first.arrived["bumped_at"] == t
    step.begin(dataclasses.replace(MOMENT, stamp_ns=NS + 50_000_010))
    later, second = step.present(given)
    assert second.arrived["bumped_at"] == t < later
    again = dataclasses.replace(given, bumped_at=float("5.0"))  # another report, stamped the same
    assert step.present(again)[1].arrived["bumped_at"] == later
