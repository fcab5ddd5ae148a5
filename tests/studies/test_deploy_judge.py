"""The expectations of faults against the nodes they speak of, and the judge of what was found."""

import inspect
import math

import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.drive.policy_parameters import PolicyParameters  # noqa: E402
from cfnav_ros.lidar.scan_watch import LidarParameters  # noqa: E402
from cfnav_ros.ros import (  # noqa: E402
    lidar_collision_node,
    node_process,
)
from cfnav_ros.ros.real_time import GUARD_PERIOD_S  # noqa: E402
from cfnav_ros.ros.velocity import CHECK_S  # noqa: E402
from sim_bridge.faults.faults import FAULTS  # noqa: E402
from sim_bridge.robot.noise import NoiseLevels  # noqa: E402
from sim_bridge.ros.broadcast import DEPTH_PERIOD  # noqa: E402

from studies.deploy.cell import AFTER_S, WATCH_S  # noqa: E402
from studies.deploy.expectations import (  # noqa: E402
    CHANGED,
    EXPECTATIONS,
    GOES_ON,
    NAMES_CAUSE,
    PROCESS_FAULTS,
    SIMULATED,
)
from studies.deploy.judge import LastMotion, ObservedRun, judge, motions  # noqa: E402
from studies.deploy.reactions import (  # noqa: E402
    CONTROL_S,
    LIMIT_CHANGED,
    LIMITS_S,
    Bounded,
    FaultPhase,
    Reaction,
)
from tests.ros.truth_samples import PAUSE, STEP, TURN, cell, drive  # noqa: E402

# The table


def test_there_is_an_expectation_for_every_fault_in_every_phase():
    assert set(SIMULATED) == set(FAULTS)
    cells = {(e.fault, e.phase) for e in EXPECTATIONS}
    assert cells == {(f, p) for f in (*FAULTS, *PROCESS_FAULTS) for p in FaultPhase}
    assert len(cells) == len(EXPECTATIONS) >= 3 * 60


def test_every_expectation_has_a_reason_and_every_stop_a_bound():
    for expected in EXPECTATIONS:
        assert expected.reason
        assert expected.limit in ("", *LIMITS_S)
        if expected.reaction is Reaction.STOP:
            assert expected.bound_s > 0.2
            assert expected.end_s or expected.bound_s < WATCH_S - AFTER_S
        if expected.reaction in (Reaction.REFUSE, Reaction.RIDE_THROUGH):
            assert expected.bound_s is None
        assert any(expected.fault.startswith(begin) for begin in NAMES_CAUSE)
        assert (expected.bound_s is None) == (expected.bounded is Bounded.NOTHING)
    assert set(CHANGED) <= {e.fault for e in EXPECTATIONS}
    assert set(GOES_ON) <= {e.fault for e in EXPECTATIONS}
    assert set(LIMIT_CHANGED) <= set(LIMITS_S)


def test_limits_are_the_nodes_own_defaults():
    lidar, policy = LidarParameters(), PolicyParameters()
    assert LIMITS_S["stale scan"] == pytest.approx(lidar.stale + 1 / lidar.stale_rate)
    assert pytest.approx(1 / policy.rate) == CONTROL_S
    assert LIMITS_S["base check"] == CHECK_S
    assert LIMITS_S["graph"] == lidar_collision_node.GRAPH_S
    assert f"spin_once(timeout_sec={LIMITS_S['request']:g})" in inspect.getsource(node_process)
    ages = policy.episode.ages
    names = ("tilt", "odometry", "estimate", "picture")
    assert [LIMITS_S[name] for name in names] == [
        ages.tilt, ages.odometry, ages.estimate, ages.frame,
    ]  # fmt: skip
    assert LIMITS_S["frozen scan"] == lidar.frozen + 1 / 7.7
    assert LIMITS_S["frozen picture"] == policy.frozen_picture_time + 1 / 15
    depth = DEPTH_PERIOD + NoiseLevels().depth_latency
    assert LIMITS_S["near depth"] == pytest.approx(depth + 3 / 7.7)
    assert LIMITS_S["clock"] == pytest.approx(0.5 + GUARD_PERIOD_S)


def test_bounds_against_numbers_worked_out_by_hand():
    assert cell("scan_all_inf", FaultPhase.DRIVING).bound_s == pytest.approx(
        2 / 7.7 + 0.05 + 0.05 + 0.2 / 0.9
    )
    assert cell("policy_hang", FaultPhase.TURNING).bound_s == pytest.approx(
        0.5 + 0.05 + 0.1165 / 0.9
    )
    assert cell("odom_silent", FaultPhase.WAITING).bound_s == pytest.approx(0.25 + 0.1 + 0.2 / 0.9)


def test_late_commands_are_bounded_until_what_is_queued_has_been_done():
    for fault, late in (("cmd_late_0.35", 0.35), ("cmd_late_2", 2.0), ("cmd_late_10", 10.0)):
        found = cell(fault, FaultPhase.DRIVING)
        assert (found.reaction, found.ends) == (Reaction.STOP, True)
        assert found.bound_s == pytest.approx(5.0 + late + 0.1 + 0.2 / 0.9)
        assert found.end_s == pytest.approx(5.0 + min(late, 1.0) + 0.1 + 0.2 / 0.9 + 0.5 + 0.05)
        assert cell(fault, FaultPhase.WAITING).bound_s == pytest.approx(found.bound_s + 4.0)
        assert found.before_wall is (late > 0.35)
    assert cell("odom_silent", FaultPhase.DRIVING).end_s is None


# The judge


def judged(
    truth, fault, phase=FaultPhase.DRIVING, outcome="aborted", message="", vetoes=0, at=10.2
):
    return judge(ObservedRun(truth, at, math.inf, outcome, message, vetoes), cell(fault, phase))


def test_motions_are_what_happens_between_rests():
    step, turn = motions(drive(STEP, PAUSE, TURN))
    assert (step.ahead, step.turn) == (pytest.approx(0.25), 0.0)
    assert turn.turn == pytest.approx(math.pi / 4)
    assert step.complete
    assert turn.complete
    assert not motions(drive((0.5, 0.2, 0.0)))[0].complete


def test_a_stop_counts_when_it_is_in_time_and_its_sentence_names_the_cause():
    told = "The newest odometry is 2.30 s old."
    good = judged(drive((0.6, 0.2, 0.0)), "odom_silent", message=told)
    assert (good.reaction, good.as_expected) == (Reaction.STOP, True)
    assert good.stop_s == pytest.approx(0.4)
    assert good.last_motion is LastMotion.CUT_SHORT
    assert not judged(drive((1.0, 0.2, 0.0)), "odom_silent", message=told).as_expected
    assert not judged(drive((0.6, 0.2, 0.0)), "odom_silent", message="Well.").as_expected
    assert not judged(drive((0.6, 0.2, 0.0), collisions=1), "odom_silent", message=told).as_expected


def test_who_stands_in_silence_has_not_said_why():
    stop, told = drive((0.6, 0.2, 0.0)), "The newest odometry is 2.30 s old."
    assert not judged(stop, "odom_silent", outcome="").as_expected
    assert not judged(stop, "odom_silent", outcome="done", message=told).as_expected
    blind = drive(TURN)
    assert not judged(blind, "scan_all_inf", FaultPhase.TURNING, outcome="").as_expected
    assert judged(stop, "policy_hang", outcome="").as_expected
    assert not judged(drive(STEP, PAUSE, STEP), "cmd_loss_30", message="Lost.").as_expected


def test_what_finishes_by_itself_is_no_measured_stop():
    told = "The newest picture is 3.05 s old."
    found = judged(drive(TURN), "image_silent", FaultPhase.TURNING, message=told)
    assert (found.stop_s, found.last_motion) == (None, LastMotion.FINISHED)
    assert found.as_expected
    stood = judged(drive(), "odom_silent", FaultPhase.WAITING, message="The odometry is old.")
    assert (stood.stop_s, stood.last_motion, stood.as_expected) == (None, LastMotion.NONE, True)


def test_the_motion_under_way_must_end_within_its_bound_while_others_may_follow():
    cut, late = (0.6, 0.2, 0.0), (1.2, 0.2, 0.0)
    for fault in ("odom_slip", "base_pushed", "scan_burst_loss"):
        found = judged(drive(cut, PAUSE, STEP), fault, outcome="")
        assert (found.reaction, found.stop_s) == (Reaction.DEGRADE, pytest.approx(0.4))
        assert found.as_expected
        assert not judged(drive(late, PAUSE, cut), fault, outcome="").as_expected


def test_gaps_of_scans_may_be_ridden_through_once_the_first_is_over():
    ride = drive(STEP, PAUSE, STEP)
    assert judged(ride, "scan_burst_loss", FaultPhase.WAITING, outcome="").as_expected
    assert judged(ride, "scan_burst_loss", FaultPhase.WAITING, outcome="step_limit").as_expected
    assert not judged(ride, "scan_burst_loss", FaultPhase.WAITING, outcome="done").as_expected
    assert not judged(ride, "scan_burst_loss", outcome="").as_expected


def test_a_ride_after_the_fault_was_mended_is_none_through_it():
    truth = drive((1.0, 0.0, 0.0), STEP, PAUSE, STEP)
    run = ObservedRun(truth, 10.0, 11.0, "", "", 0)
    found = judge(run, cell("network_cut_1", FaultPhase.WAITING))
    assert (found.reaction, found.as_expected) == (Reaction.STOP, True)


def test_who_moves_again_has_not_stopped():
    found = judged(drive((0.6, 0.2, 0.0), PAUSE, (0.6, 0.2, 0.0)), "odom_silent", outcome="")
    assert (found.reaction, found.as_expected) == (Reaction.DEGRADE, False)
    truth = drive((0.6, 0.2, 0.0), PAUSE, (0.6, 0.2, 0.0))
    mended = ObservedRun(truth, 10.2, 11.0, "", "", 0)
    assert judge(mended, cell("network_cut_1", FaultPhase.DRIVING)).as_expected


def test_whole_motions_are_a_ride_and_a_veto_is_less():
    ride = drive(STEP, PAUSE, STEP)
    assert judged(ride, "cmd_loss_30", outcome="").as_expected
    assert judged(ride, "cmd_loss_30", outcome="", vetoes=1).reaction is Reaction.DEGRADE
    assert judged(ride, "odom_silent", outcome="").reaction is Reaction.RIDE_THROUGH


def test_who_sees_nothing_may_finish_its_turn_but_not_drive():
    message = "The LiDAR is blind."
    turned = judged(drive(TURN), "scan_all_inf", FaultPhase.TURNING, message=message)
    assert (turned.reaction, turned.as_expected) == (Reaction.DEGRADE, True)
    driven = judged(
        drive(TURN, PAUSE, (0.6, 0.2, 0.0)), "scan_all_inf", FaultPhase.TURNING, message=message
    )
    assert (driven.reaction, driven.as_expected) == (Reaction.DEGRADE, False)


def test_where_only_drives_are_bounded_the_end_of_a_turn_is_no_measured_stop():
    told = "The LiDAR is blind."
    turned = judged(drive((1.4, 0.0, 0.3)), "scan_all_inf", FaultPhase.TURNING, message=told)
    assert (turned.stop_s, turned.last_motion) == (None, LastMotion.CUT_SHORT)
    assert turned.as_expected
    drove = judged(drive((0.5, 0.2, 0.0)), "scan_all_inf", FaultPhase.TURNING, message=told)
    assert drove.stop_s == pytest.approx(0.3, abs=0.06)


@pytest.mark.parametrize(
    ("message", "ended_s", "collisions", "expected"),
    [
        ("The base did 1.0 s late what it was told (limit 0.3 s).", 2.5, 0, True),
        ("3 motions failed: The base has not moved: its commands come late.", 2.5, 0, True),
        ("3 motions failed: MoveAhead made no progress for 1 s.", 2.5, 0, False),
        ("The base moved by itself 8 times.", 2.5, 0, False),
        ("The base did 1.0 s late what it was told (limit 0.3 s).", 9.0, 0, False),
        ("The base did 1.0 s late what it was told (limit 0.3 s).", 2.5, 1, False),
        ("", math.inf, 0, False),
    ],
)  # fmt: skip
def test_late_commands_end_the_goal_in_time_with_a_sentence_of_lateness(
    message, ended_s, collisions, expected
):
    truth = drive((0.6, 0.2, 0.0), PAUSE, (0.6, 0.2, 0.0), collisions=collisions)
    outcome = "aborted" if message else ""
    run = ObservedRun(truth, 10.2, math.inf, outcome, message, 0, 10.2 + ended_s)
    assert judge(run, cell("cmd_late_1", FaultPhase.DRIVING)).as_expected is expected


def test_a_refusal_is_one_without_motion():
    still = drive()
    message = "The picture is encoded as '16UC1'."
    found = judged(still, "image_16uc1", FaultPhase.WAITING, outcome="refused", message=message)
    assert (found.reaction, found.as_expected) == (Reaction.REFUSE, True)
