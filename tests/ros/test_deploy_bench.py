"""The deployment bench: its table against the nodes it speaks of, its judge, and one real cell."""

import inspect
import json
import math
import os
import re
from types import SimpleNamespace

import numpy as np
import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")
pytest.importorskip("torch", reason="making a bundle needs torch: run 'make test'")

from cfnav_ros.graph import GraphConfig  # noqa: E402
from cfnav_ros.parameters import LidarParameters, PolicyParameters  # noqa: E402
from cfnav_ros.policy_node import GUARD_PERIOD_S  # noqa: E402
from cfnav_ros.processes import GraphError  # noqa: E402
from cfnav_ros.velocity import CHECK_S  # noqa: E402
from sim_bridge.faults import FAULTS  # noqa: E402
from sim_bridge.room import generate_room, parse_room  # noqa: E402
from sim_bridge.world import World  # noqa: E402

from cfnav_core.actions import Action  # noqa: E402
from cfnav_core.bundle import BundleHead  # noqa: E402
from cfnav_ros import lidar_collision_node, policy_node  # noqa: E402
from tests.deploy import bench, fault_matrix, matrix_report, motion_error, usage  # noqa: E402
from tests.deploy.bundles import make_bundle  # noqa: E402
from tests.deploy.expectations import (  # noqa: E402
    CHANGED,
    EXPECTATIONS,
    GOES_ON,
    NAMES_CAUSE,
    PROCESS_FAULTS,
    SIMULATED,
)
from tests.deploy.judge import JUDGE, LastMotion, Run, Truth, judge, motions  # noqa: E402
from tests.deploy.places import AHEAD_M, ROOM, find_places  # noqa: E402
from tests.deploy.pool import _Lab  # noqa: E402
from tests.deploy.reactions import (  # noqa: E402
    CONTROL_S,
    LIMIT_CHANGED,
    LIMITS_S,
    Bounded,
    Phase,
    Reaction,
)


def cell(fault, phase):
    return next(e for e in EXPECTATIONS if e.fault == fault and e.phase is phase)


# The table


def test_there_is_an_expectation_for_every_fault_in_every_phase():
    assert set(SIMULATED) == set(FAULTS)
    cells = {(e.fault, e.phase) for e in EXPECTATIONS}
    assert cells == {(f, p) for f in (*FAULTS, *PROCESS_FAULTS) for p in Phase}
    assert len(cells) == len(EXPECTATIONS) >= 3 * 60


def test_every_expectation_has_a_reason_and_every_stop_a_bound():
    for expected in EXPECTATIONS:
        assert expected.reason
        assert expected.limit in ("", *LIMITS_S)
        if expected.reaction is Reaction.STOP:
            assert 0.2 < expected.bound_s < 6.0
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
    assert f"spin_once(timeout_sec={LIMITS_S['request']:g})" in inspect.getsource(policy_node)
    ages = policy.episode.ages
    names = ("tilt", "odometry", "estimate", "picture")
    assert [LIMITS_S[name] for name in names] == [
        ages.tilt, ages.odometry, ages.estimate, ages.frame,
    ]  # fmt: skip
    assert LIMITS_S["frozen scan"] == lidar.frozen + 1 / 7.7
    assert LIMITS_S["frozen picture"] == policy.frozen_picture_time + 1 / 15
    assert LIMITS_S["clock"] == pytest.approx(0.5 + GUARD_PERIOD_S)


def test_bounds_against_numbers_worked_out_by_hand():
    assert cell("scan_all_inf", Phase.DRIVING).bound_s == pytest.approx(
        2 / 7.7 + 0.05 + 0.05 + 0.2 / 0.9
    )
    assert cell("policy_hang", Phase.TURNING).bound_s == pytest.approx(0.5 + 0.05 + 0.1165 / 0.9)
    assert cell("odom_silent", Phase.WAITING).bound_s == pytest.approx(0.25 + 0.1 + 0.2 / 0.9)


# The judge


def drive(*parts, begin=10.0, collisions=0):
    """Truth at 20 Hz of parts (seconds, v, w), at rest a second before and after."""
    truth, t, x, yaw, still = [], begin - 1.0, 0.0, 0.0, 1.0
    for seconds, v, w in ((1.0, 0.0, 0.0), *parts, (1.0, 0.0, 0.0)):
        moving = v != 0 or w != 0
        still = 0.0 if moving else t
        for _ in range(round(seconds / 0.05)):
            truth.append(Truth(t, x, 0.0, yaw, v, w, still, 0))
            t, x, yaw = t + 0.05, x + 0.05 * v * math.cos(yaw), yaw + 0.05 * w
    truth[-1] = Truth(t, x, 0.0, yaw, 0.0, 0.0, still, collisions)
    return truth


def judged(truth, fault, phase=Phase.DRIVING, outcome="aborted", message="", vetoes=0, at=10.2):
    return judge(Run(truth, at, math.inf, outcome, message, vetoes), cell(fault, phase))


STEP, TURN, PAUSE = (1.25, 0.2, 0.0), (1.0, 0.0, math.pi / 4), (0.5, 0.0, 0.0)


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
    assert not judged(blind, "scan_all_inf", Phase.TURNING, outcome="").as_expected
    assert judged(stop, "policy_hang", outcome="").as_expected
    assert not judged(drive(STEP, PAUSE, STEP), "cmd_loss_30", message="Lost.").as_expected


def test_what_finishes_by_itself_is_no_measured_stop():
    told = "The newest picture is 3.05 s old."
    found = judged(drive(TURN), "image_silent", Phase.TURNING, message=told)
    assert (found.stop_s, found.last_motion) == (None, LastMotion.FINISHED)
    assert found.as_expected
    stood = judged(drive(), "odom_silent", Phase.WAITING, message="The odometry is old.")
    assert (stood.stop_s, stood.last_motion, stood.as_expected) == (None, LastMotion.NONE, True)


def test_the_motion_under_way_must_end_within_its_bound_while_others_may_follow():
    cut, late = (0.6, 0.2, 0.0), (1.2, 0.2, 0.0)
    for fault in ("odom_slip", "base_pushed", "scan_burst_loss"):
        found = judged(drive(cut, PAUSE, STEP), fault, outcome="")
        assert (found.reaction, found.stop_s) == (Reaction.DEGRADE, pytest.approx(0.4))
        assert found.as_expected
        assert not judged(drive(late, PAUSE, cut), fault, outcome="").as_expected


def test_a_ride_after_the_fault_was_mended_is_none_through_it():
    truth = drive((1.0, 0.0, 0.0), STEP, PAUSE, STEP)
    run = Run(truth, 10.0, 11.0, "", "", 0)
    found = judge(run, cell("network_cut_1", Phase.WAITING))
    assert (found.reaction, found.as_expected) == (Reaction.STOP, True)


def test_who_moves_again_has_not_stopped():
    found = judged(drive((0.6, 0.2, 0.0), PAUSE, (0.6, 0.2, 0.0)), "odom_silent", outcome="")
    assert (found.reaction, found.as_expected) == (Reaction.DEGRADE, False)
    truth = drive((0.6, 0.2, 0.0), PAUSE, (0.6, 0.2, 0.0))
    mended = Run(truth, 10.2, 11.0, "", "", 0)
    assert judge(mended, cell("network_cut_1", Phase.DRIVING)).as_expected


def test_whole_motions_are_a_ride_and_a_veto_is_less():
    ride = drive(STEP, PAUSE, STEP)
    assert judged(ride, "cmd_loss_30", outcome="").as_expected
    assert judged(ride, "cmd_loss_30", outcome="", vetoes=1).reaction is Reaction.DEGRADE
    assert judged(ride, "odom_silent", outcome="").reaction is Reaction.RIDE_THROUGH


def test_who_sees_nothing_may_finish_its_turn_but_not_drive():
    message = "The LiDAR is blind."
    turned = judged(drive(TURN), "scan_all_inf", Phase.TURNING, message=message)
    assert (turned.reaction, turned.as_expected) == (Reaction.DEGRADE, True)
    driven = judged(
        drive(TURN, PAUSE, (0.6, 0.2, 0.0)), "scan_all_inf", Phase.TURNING, message=message
    )
    assert (driven.reaction, driven.as_expected) == (Reaction.DEGRADE, False)


def test_a_refusal_is_one_without_motion():
    still = drive()
    message = "The picture is encoded as '16UC1'."
    found = judged(still, "image_16uc1", Phase.WAITING, outcome="refused", message=message)
    assert (found.reaction, found.as_expected) == (Reaction.REFUSE, True)


# Files and figures


def test_runs_that_are_written_are_not_made_again():
    config = fault_matrix.MatrixConfig(runs=2, only="^(odom_silent|policy_sigint)$")
    tasks = fault_matrix.missing(config, [])
    assert len(tasks) == 12
    assert [EXPECTATIONS[t[0]].fault for t in tasks[-6:]] == ["policy_sigint"] * 6
    driving = cell("odom_silent", Phase.DRIVING)
    row = {"fault": "odom_silent", "phase": "driving", "run": 1, "terms": driving.terms}
    rows = fault_matrix.today([{**row, "judge": JUDGE}])
    left = fault_matrix.missing(config, rows)
    assert sorted(set(tasks) - set(left)) == [
        (EXPECTATIONS.index(cell("odom_silent", Phase.DRIVING)), 1)
    ]


def test_runs_judged_by_other_terms_are_made_again():
    expected = cell("odom_silent", Phase.DRIVING)
    row = {"fault": "odom_silent", "phase": "driving", "run": 1, "judge": JUDGE}
    terms = json.loads(json.dumps(expected.terms))
    assert fault_matrix.today([{**row, "terms": terms}])
    assert not fault_matrix.today([row])
    assert not fault_matrix.today([{**row, "terms": {**terms, "bound_s": 9.0}}])
    assert not fault_matrix.today([{**row, "terms": terms, "judge": JUDGE - 1}])


def test_attempts_that_failed_stand_beside_the_result(tmp_path, monkeypatch):
    lab = _Lab(tmp_path, tmp_path)
    monkeypatch.setattr(lab, "_open", lambda: None)
    left = [GraphError("no odometry"), GraphError("no picture")]

    def work(rig, places, task):
        if left:
            raise left.pop(0)
        return {"task": task}, False

    assert lab.do(work, 7) == {"task": 7, "attempts": 3, "failures": ["no odometry", "no picture"]}
    left += [GraphError(f"failed {n}") for n in range(3)]
    assert lab.do(work, 7) == "failed 2"


def test_half_of_the_runs_that_must_stop_by_scan_are_made_before_a_wall():
    places, world = find_places(), World(generate_room(*parse_room(ROOM)))
    for number in range(8):
        x, y, yaw = places.before_wall(2 * number + 1)
        way = (math.cos(yaw), math.sin(yaw))
        ends = [(x + d * way[0], y + d * way[1]) for d in (AHEAD_M - 0.05, AHEAD_M + 0.05)]
        assert [world.sweep_free((x, y), end) for end in ends] == [True, False]
    assert cell("scan_silent", Phase.DRIVING).before_wall
    assert cell("lidar_hang", Phase.DRIVING).before_wall
    assert not cell("scan_half_rate", Phase.DRIVING).before_wall
    assert not cell("scan_silent", Phase.TURNING).before_wall


def test_a_bundle_is_named_by_its_actions(tmp_path):
    lists = {"Laptop": (Action.MoveAhead,)}
    first = make_bundle(tmp_path, lists)
    written = (first / "bundle.json").stat().st_mtime_ns
    assert make_bundle(tmp_path, lists) == first
    assert (first / "bundle.json").stat().st_mtime_ns == written
    (first / "policy.onnx").write_bytes(b"")
    assert BundleHead.load(make_bundle(tmp_path, lists)).goals == ("Laptop",)
    assert make_bundle(tmp_path, {"Laptop": (Action.RotateLeft,)}) != first


def test_drives_that_fail_are_told_beside_the_figures(tmp_path, monkeypatch):
    def results(work, tasks, *_):
        motions = motion_error.errors(
            drive(STEP, PAUSE, TURN), (Action.MoveAhead, Action.RotateLeft)
        )
        yield {"motions": motions, "failure": "", "attempts": 2, "failures": ["no scan"]}
        yield {
            "motions": [],
            "failure": "the drive ended as aborted",
            "attempts": 1,
            "failures": [],
        }

    monkeypatch.setattr(motion_error, "results", results)
    monkeypatch.setattr(motion_error, "make_bundle", lambda folder, lists: folder)
    found = motion_error.measure(motion_error.MotionConfig(tmp_path, n=40))
    assert found["drives"] == {"n": 2, "left_out": 1, "attempts": 3}
    assert found["forward_cm"]["n"] == 1


def test_the_commit_of_the_matrix_is_that_of_its_rows():
    cells = [{"commits": ["abc1"]}, {"commits": ["abc1", "def2"]}]
    assert bench._commit("matrix", {"fault_matrix": cells}) == "abc1, def2"


def test_a_summary_tells_of_every_run_of_a_cell(tmp_path):
    expected = cell("odom_silent", Phase.DRIVING)
    row = {
        "fault": "odom_silent", "phase": "driving", "contacts": 0, "message": "", "commit": "ab1",
        "reaction": "stop", "last_motion": "cut short", "place": "wall", "attempts": 2,
    }  # fmt: skip
    rows = [{**row, "stop_s": s, "as_expected": s < 0.5} for s in (0.4, 0.45, 0.6)]
    rows.append({**row, "stop_s": None, "as_expected": True, "last_motion": "finished"})
    (summary,) = matrix_report.summarise(rows)
    assert (summary["stop_s_min"], summary["stop_s_median"], summary["stop_s_max"]) == (
        0.4, 0.45, 0.6,
    )  # fmt: skip
    assert (summary["as_expected"], summary["runs_as_expected"]) == (False, 3)
    assert summary["changed"] == expected.changed
    text = matrix_report.table([summary])
    assert text.startswith(
        "0 of 1 cells as expected, 4 runs (4 before a wall), 0 contacts, at commit ab1. "
        "4 attempts did not come about"
    )
    assert "| `odom_silent` | **stop 0.45, 0.60 of 0.57: 3 of 4 as expected, stop** |" in text
    (finished,) = matrix_report.summarise(rows[-1:])
    assert "| stop: finished, none followed |" in matrix_report.table([finished])
    matrix_report.draw([summary], tmp_path / "matrix.png")
    assert (tmp_path / "matrix.png").stat().st_size > 5000


def test_drawn_motions_keep_within_reach_and_errors_are_told_from_rests():
    for seed in range(5):
        x = y = yaw = 0.0
        for action in motion_error.draw_actions(np.random.default_rng(seed), 1.0):
            yaw += motion_error.TURNS.get(action, 0.0)
            ahead = 0.25 * (action is Action.MoveAhead)
            x, y = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
            assert math.hypot(x, y) <= 1.0 + 1e-9
    actions = (Action.MoveAhead, Action.RotateLeft)
    step, turn = motion_error.errors(drive((1.3, 0.2, 0.0), PAUSE, (1.0, 0.0, 0.8)), actions)
    assert step["forward_cm"] == pytest.approx(1.0)
    assert turn["turn_deg"] == pytest.approx(math.degrees(0.8) - 45)
    with pytest.raises(GraphError, match="2 motions were seen of 1"):
        motion_error.errors(drive(STEP, PAUSE, TURN), actions[:1])


def test_a_part_that_does_not_exist_is_told():
    assert bench.chosen(" motion, usage") == ["motion", "usage"]
    with pytest.raises(GraphError, match="--only names 'faults', expected parts of matrix"):
        bench.chosen("faults")


def test_memory_and_cpu_of_a_process_are_read_and_growth_is_told():
    me = {"me": os.getpid()}
    share = usage.cpu_share(me, lambda: sum(range(3_000_000)))
    assert 0.2 < share["me"] < 3.0
    memory = usage.Memory(me, lambda: 0.0)
    memory.times_s = [36.0 * k for k in range(100)]
    memory.rss_mb = {"me": [200.0 + max(k - 20, 0) for k in range(100)]}
    assert memory.slopes()["me"] == pytest.approx(100.0)  # 1 MB in 36 s, the warm-up left out


class Standing:
    """A graph whose policy answers every goal alike."""

    def __init__(self, outcome, steps):
        self.result = SimpleNamespace(outcome=outcome, message="No picture.", steps=steps)
        self.node = SimpleNamespace(create_subscription=lambda *_: None)

    def start_episode(self, *_):
        return SimpleNamespace(ok=True, goals=("Mug",))

    def navigate(self, *_):
        return self.result

    def end_episode(self):
        return SimpleNamespace(path_length=0.25)


def test_cost_is_not_measured_while_goals_are_refused_and_what_was_driven_is_told():
    rounds = iter((False, False, True))
    drive = usage._Drive(Standing("done", 4), "kitchen:1")
    drive.seek(lambda: next(rounds))
    assert drive.driven == {"goals": 2, "decisions": 8, "metres": 0.5}
    with pytest.raises(GraphError, match="refused the goal 'Mug': No picture"):
        usage._Drive(Standing("refused", 0), "kitchen:1").seek(lambda: False)


def test_parts_that_were_measured_before_stay_on_the_page():
    about = {"command": "c", "commit": "1234567", "load_before": 0.1, "load_after": 2.0, "cores": 2}
    found = {"motion_error": {"forward_cm": {"mean": 0.25}}, "measured": {"motion": about}}
    page = bench.page(found)
    assert "| motion_error | forward_cm mean 0.25 | `c` | 1234567 | 0.1 to 2.0, 2 cores |" in page


def test_the_camera_as_sold_is_asked_of_the_mock_and_does_not_tilt(tmp_path):
    for camera, tilts in (("mast", None), ("preview", False)):
        nodes = GraphConfig("kitchen:1", tmp_path, camera=camera).nodes
        of = {name: parameters for _, name, parameters in nodes}
        assert of["mock_turtlebot4"]["camera"] == camera
        assert of["policy_node"].get("episode.has_tilt") is tilts


# The real thing


def test_one_cell_on_a_live_graph(tmp_path):
    config = fault_matrix.MatrixConfig(
        tmp_path / "faults.jsonl", runs=1, graphs=1, only="^odom_silent$", phase=(Phase.DRIVING,)
    )
    (row,) = fault_matrix.measure(config)
    assert json.loads(config.out.read_text()) == row
    assert (row["reaction"], row["outcome"], row["contacts"]) == ("stop", "aborted", 0)
    assert re.search("newest odometry is .* old", row["message"])
    assert (row["attempts"], row["place"]) == (1, "open")
    assert row["as_expected"], row
