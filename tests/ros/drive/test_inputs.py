"""Which inputs are missing, old, or stamped by another clock."""

import dataclasses

import pytest
from cfnav_ros.drive.inputs import (
    AgeLimits,
    CameraFrame,
    SensorInputs,
    StampedEstimate,
    Tilt,
    unusable,
)
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.lidar.estimate import Estimate, Verdict

T = 1000.0
NAMES = ("frame", "odometry", "estimate", "tilt")


def inputs(notes=None, arrived=None, **ages):
    """Inputs stamped ``ages`` seconds ago; those not in ``arrived`` arrived just now."""
    stamp = {name: T - ages.get(name, 0.0) for name in NAMES}
    return SensorInputs(
        frame=CameraFrame(round(stamp["frame"] * 1e9)),
        odometry=Odometry(stamp["odometry"], 0.0, 0.0, 0.0),
        estimate=StampedEstimate(
            round(stamp["estimate"] * 1e9), Estimate(0.0, 2.0, Verdict.GOOD, "", 1.0)
        ),
        tilt=Tilt(stamp["tilt"], 0.0),
        arrived=dict.fromkeys(NAMES, T) | (arrived or {}),
        notes=notes or {},
    )


def judge(given):
    return unusable(T, given, AgeLimits())


def test_fresh_inputs_can_be_used():
    assert judge(inputs()) == ""
    assert judge(inputs(frame=0.9, odometry=0.2, estimate=0.4, tilt=-0.4)) == ""


def test_what_is_not_needed_may_be_missing():
    given = dataclasses.replace(inputs(), estimate=StampedEstimate(), tilt=Tilt())
    assert judge(given) == "No collision estimate has arrived; no camera tilt has arrived."
    assert unusable(T, given, AgeLimits(), lidar=False, tilt=False) == ""


@pytest.mark.parametrize(
    ("name", "word", "limit"),
    [
        ("frame", "picture", "1"),
        ("odometry", "odometry", "0.25"),
        ("estimate", "collision estimate", "0.5"),
        ("tilt", "camera tilt", "0.5"),
    ],
)
def test_silent_late_and_future_inputs_are_told_apart(name, word, limit):
    silent = judge(inputs(**{name: 3.0}, arrived={name: T - 3.0}))
    cure = ": start the camera's driver again" if name == "frame" else ""
    assert silent == f"The newest {word} is 3.00 s old (limit {limit} s){cure}."
    late = judge(inputs(**{name: 3.0}))
    driver = "its driver read a wrong clock when it started: start the driver again"
    why = driver if name == "frame" else "the clock of its sender is not this computer's"
    assert late == (
        f"The {word} arrives 3.00 s after its stamp (limit {limit} s): it is late, or {why}."
    )
    ahead = judge(inputs(**{name: -5.0}))
    assert ahead == f"The {word} is stamped 5.0 s in the future: {why}."
    zero = judge(inputs(**{name: T}))
    assert zero == f"The {word} arrives without a time, stamped 0: set it in its driver."


@pytest.mark.parametrize("name", NAMES)
def test_a_stamp_ahead_does_not_keep_an_input_young(name):
    limit = getattr(AgeLimits(), name)
    lead = {name: -0.4}
    assert judge(inputs(arrived={name: T - limit + 0.01}, **lead)) == ""
    silent = judge(inputs(arrived={name: T - limit - 0.01}, **lead))
    assert f"is {limit + 0.01:.2f} s old (limit {limit:g} s)" in silent


@pytest.mark.parametrize(("offset", "side"), [(12.3, "behind"), (-12.3, "ahead")])
def test_a_robot_with_another_clock_is_told_as_such(offset, side):
    sentence = judge(inputs(**dict.fromkeys(NAMES, offset)))
    assert sentence == (
        f"The clocks of robot and computer differ by 12.3 s (the robot's is {side}): set both "
        "with chrony, then start the camera's driver again."
    )


def test_simulated_against_system_time_is_told_as_such():
    given = dataclasses.replace(inputs(), arrived=dict.fromkeys(NAMES, 1.7e9))
    sentence = unusable(1.7e9, given, AgeLimits())
    assert sentence.endswith("use_sim_time must be true where /clock is published, and only there.")


def test_one_late_input_among_others_is_no_other_clock():
    assert "clocks of robot" not in judge(inputs(frame=12.3))
    assert "clocks of robot" not in judge(inputs(frame=12.3, odometry=3.0))


def test_a_note_says_why():
    notes = {"odometry": "Odometry holds a value that is not finite"}
    assert judge(inputs(notes, odometry=3.0, arrived={"odometry": T - 3.0})) == (
        "The newest odometry is 3.00 s old (limit 0.25 s) (Odometry holds a value that is not "
        "finite)."
    )
