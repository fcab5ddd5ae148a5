"""What is said on /diagnostics, without ROS."""

import dataclasses
import math
import time

import pytest
from cfnav_ros.drive.diagnostics import (
    STATUSES,
    Level,
    Rate,
    Stopwatch,
    base_report,
    episode_report,
    inference_report,
    input_reports,
    status_reports,
)
from cfnav_ros.drive.inputs import (
    DETECTIONS,
    AgeLimits,
    CameraFrame,
    PictureCheck,
    SensorInputs,
)
from cfnav_ros.drive.preflight import BaseCheck

from cfnav_core.detect.sightings import Sighting
from cfnav_core.task.actions import Action
from tests.ros.scripted_robot import READY, Robot, driving, episode_of


def rows(t, inputs, **options):
    found = input_reports(t, inputs, AgeLimits(), {"frame": 15.04}, **options)
    return {report.name: report for report in found}


def test_a_rate_is_that_of_the_last_seconds():
    rate = Rate()
    assert rate.hz(0.0) == 0.0
    for k in range(200):
        rate.note(k * 0.05)
    assert rate.hz(9.95) == pytest.approx(20.0)
    assert rate.hz(12.45) == pytest.approx(10.0, rel=0.02)
    assert rate.hz(20.0) == 0.0


def test_times_are_those_of_the_calls_failed_ones_too():
    watch = Stopwatch()
    assert all(map(math.isnan, watch.percentiles_ms()))
    call = watch.timed(lambda seconds: time.sleep(seconds))
    for _ in range(9):
        call(0.001)
    with pytest.raises(ValueError, match="sleep"):
        call(-1)
    p50, p99 = watch.percentiles_ms()
    assert 1.0 <= p50 <= p99


def test_inputs_have_ages_and_rates():
    robot = Robot()
    inputs = robot.sense()
    found = rows(robot.t + 0.1, inputs)
    assert set(found) == {"picture", "odometry", "collision estimate", "camera tilt"}
    assert found["picture"].level is Level.OK
    assert found["picture"].values == {"age_s": "0.100", "rate_hz": "15.0", "limit_s": "1"}
    assert set(rows(robot.t, inputs, lidar=False, tilt=False)) == {"picture", "odometry"}
    late = rows(robot.t + 0.3, inputs)
    assert late["odometry"].level is Level.ERROR
    assert late["odometry"].message == "the newest odometry is 0.30 s old (limit 0.25 s)"
    never = rows(0.0, SensorInputs())["picture"]
    assert (never.level, never.values["age_s"]) == (Level.ERROR, "never")
    dark = dataclasses.replace(inputs, picture=PictureCheck(waiting="It is dark."))
    assert rows(robot.t, dark)["picture"].message == "It is dark."


def test_what_counts_of_a_detectors_boxes_is_told():
    robot = Robot()
    seen = (
        Sighting("Mug", 0.4, -0.2, 0.0, 0.1, 0.1),
        Sighting("Chair", 0.81, math.radians(12), 0.0, 0.1, 0.1, 1.34),
    )
    frame = CameraFrame(1, lambda every=1: seen, data=("three", "boxes", "came"))
    given = dataclasses.replace(robot.sense(), view=DETECTIONS, frame=frame)
    values = rows(robot.t, given)[DETECTIONS].values
    assert "surest" not in values  # too old to count
    now = dataclasses.replace(frame, stamp_ns=int(robot.t * 1e9))
    given = dataclasses.replace(given, frame=now)
    values = rows(robot.t, given)[DETECTIONS].values
    assert (values["boxes"], values["boxes_that_count"]) == ("3", "2")
    assert values["surest"] == (
        "Chair 0.81, 12 deg to the right, 1.3 m; "
        "Mug 0.40, -11 deg to the right, nobody knows how far"
    )


def test_what_a_base_never_told_is_said():
    silent = {report.name: report for report in status_reports((), STATUSES)}
    assert set(silent) == {"hazards", "wheel status", "dock status", "battery"}
    assert {report.message for report in silent.values()} == {"not heard"}
    assert silent["hazards"].level is Level.WARN
    assert silent["dock status"].level is Level.OK
    heard = next(iter(status_reports({"hazards"}, ())))
    assert (heard.level, heard.message) == (Level.OK, "heard")
    (quiet,) = status_reports((), (), {"hazards"})
    assert (quiet.level, quiet.message) == (Level.OK, "nothing told yet")
    assert not [*status_reports((), ())]  # a base that has none of them


def test_an_episode_says_where_it_stands():
    assert episode_report(None).message == "no goal"
    robot = Robot()
    episode, _ = episode_of(Action.MoveAhead, Action.Done)
    assert episode_report(episode).values["last_action"] == "none"
    robot.run(episode, until=driving)
    values = episode_report(episode).values
    assert (values["phase"], values["last_action"], values["steps"]) == ("move", "MoveAhead", "1")
    assert values["collision_probability"] == "0.010"
    assert float(values["path_length_m"]) > 0.04


def test_a_slow_policy_and_a_base_that_is_not_there_are_told():
    assert inference_report(5.0, 20.0, 10.0).level is Level.OK
    assert inference_report(math.nan, math.nan, 10.0).level is Level.OK
    assert inference_report(5.0, 12_000.0, 10.0).level is Level.WARN
    driven = dataclasses.replace(SensorInputs(), base=READY)
    fine = base_report(driven, "/cmd_vel", READY.type, 0.06, True)
    assert (fine.level, fine.values["largest_gap_s"]) == (Level.OK, "0.060")
    assert base_report(driven, "/cmd_vel", READY.type, 0.3, True).level is Level.WARN
    gone = dataclasses.replace(driven, base=BaseCheck(waiting="No robot listens."))
    assert base_report(gone, "/cmd_vel", "", 0.0, True).message == "No robot listens."
    assert base_report(gone, "/cmd_vel", "", 0.0, False).level is Level.OK
    dead = dataclasses.replace(driven, powered=False)
    assert base_report(dead, "/cmd_vel", "", 0.0, False).level is Level.ERROR
    docked = dataclasses.replace(driven, docked=True)
    assert base_report(docked, "/cmd_vel", "", 0.0, False).level is Level.ERROR
    assert base_report(docked, "/cmd_vel", "", 0.0, False, undocks=True).level is Level.OK
