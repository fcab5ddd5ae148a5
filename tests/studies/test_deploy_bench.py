"""The deployment bench: its files and figures, and one real cell."""

import json
import math
import os
import re
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")
pytest.importorskip("torch", reason="making a bundle needs torch: run 'make test'")

from cfnav_ros.lidar import depth_watch  # noqa: E402
from cfnav_ros.process.graph_config import GraphConfig  # noqa: E402
from cfnav_ros.process.processes import GraphError  # noqa: E402
from sim_bridge.robot import simulator  # noqa: E402
from sim_bridge.room.room import generate_room, parse_room  # noqa: E402
from sim_bridge.world.world import World  # noqa: E402

from cfnav_core.policy.bundle import BundleHead  # noqa: E402
from cfnav_core.robot.robot import load_robot  # noqa: E402
from cfnav_core.task.actions import Action  # noqa: E402
from cfnav_core.task.camera import CAMERAS  # noqa: E402
from studies.deploy import (  # noqa: E402
    bench,
    fault_matrix,
    matrix_report,
    motion_error,
    usage,
)
from studies.deploy.bundles import make_bundle  # noqa: E402
from studies.deploy.expectations import (  # noqa: E402
    EXPECTATIONS,
)
from studies.deploy.judge import JUDGE  # noqa: E402
from studies.deploy.places import AHEAD_M, ROOM, find_places  # noqa: E402
from studies.deploy.pool import _Lab  # noqa: E402
from studies.deploy.reactions import (  # noqa: E402
    FaultPhase,
)
from studies.deploy.rig import COUNTS_ANEW  # noqa: E402
from studies.parts import measure_parts  # noqa: E402
from tests.ros.truth_samples import PAUSE, STEP, TURN, cell, drive  # noqa: E402

# Files and figures


def test_runs_that_are_written_are_not_made_again():
    config = fault_matrix.MatrixConfig(runs=2, only="^(odom_silent|policy_sigint)$")
    tasks = fault_matrix.missing(config, [])
    assert len(tasks) == 12
    assert [EXPECTATIONS[t[0]].fault for t in tasks[-6:]] == ["policy_sigint"] * 6
    driving = cell("odom_silent", FaultPhase.DRIVING)
    row = {"fault": "odom_silent", "phase": "driving", "run": 1, "terms": driving.terms}
    rows = fault_matrix.today([{**row, "judge": JUDGE}])
    left = fault_matrix.missing(config, rows)
    assert sorted(set(tasks) - set(left)) == [
        (EXPECTATIONS.index(cell("odom_silent", FaultPhase.DRIVING)), 1)
    ]


def test_runs_judged_by_other_terms_are_made_again():
    expected = cell("odom_silent", FaultPhase.DRIVING)
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
    assert cell("scan_silent", FaultPhase.DRIVING).before_wall
    assert cell("lidar_hang", FaultPhase.DRIVING).before_wall
    assert not cell("scan_half_rate", FaultPhase.DRIVING).before_wall
    assert not cell("scan_silent", FaultPhase.TURNING).before_wall


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


def test_the_commit_of_the_matrix_is_that_of_its_rows(tmp_path, monkeypatch):
    cells = [{"commits": ["abc1"]}, {"commits": ["abc1", "def2"]}]
    monkeypatch.setitem(bench.PARTS, "matrix", lambda config: {"fault_matrix": cells})
    monkeypatch.setattr(matrix_report, "table", lambda cells: "a table")
    found = bench.measure(bench.DeployConfig(tmp_path, only="matrix"))
    assert found["measured"]["matrix"]["commit"] == "abc1, def2"
    assert "a table" in (tmp_path / "deploy.md").read_text()


def test_parts_that_are_left_out_keep_their_figures(tmp_path):
    parts = {"a": lambda: {"one": 1}, "b": lambda: {"two": 2}}
    path = tmp_path / "found.json"
    measure_parts(path, "tests.bench", parts, " a, b")
    parts["b"] = lambda: {"two": 3}
    found = measure_parts(path, "tests.bench", parts, "b")
    assert json.loads(path.read_text()) == found
    assert (found["one"], found["two"]) == (1, 3)
    assert set(found["measured"]) == {"a", "b"}
    assert found["measured"]["b"]["command"].startswith("python -m tests.bench")


def test_a_summary_tells_of_every_run_of_a_cell(tmp_path):
    expected = cell("odom_silent", FaultPhase.DRIVING)
    row = {
        "fault": "odom_silent", "phase": "driving", "contacts": 0, "message": "", "commit": "ab1",
        "reaction": "stop", "last_motion": "cut short", "place": "wall", "attempts": 2,
        "end_s": 1.5,
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
    mixed = [{**row, "reaction": "ride_through"}, *[{**row, "reaction": "degrade"}] * 2]
    late = [
        {**row, "fault": "cmd_late_1", "end_s": end, "stop_s": 0.5, "as_expected": True}
        for end in (2.25, 2.0)
    ]
    for own in mixed:
        own.update(fault="cmd_cut_1", stop_s=None, as_expected=True)
    text = matrix_report.table(matrix_report.summarise([*mixed, *late]))
    assert "| degrade (2), ride through (1) |" in text
    bound = cell("cmd_late_1", FaultPhase.DRIVING).end_s
    assert f"; ended 2.25 of {bound:.2f} |" in text
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
    with pytest.raises(GraphError, match="--only names 'faults', expected parts of matrix"):
        bench.measure(bench.DeployConfig(only="motion, faults"))


def test_memory_and_cpu_of_a_process_are_read_and_growth_is_told():
    me = {"me": os.getpid()}
    used, began = time.process_time(), time.monotonic()
    share = usage.cpu_share(me, lambda: sum(range(30_000_000)))
    expected = (time.process_time() - used) / (time.monotonic() - began)
    assert share["me"] == pytest.approx(expected, abs=0.1)  # the kernel counts in ticks of 10 ms
    memory = usage.MemoryLog(me, lambda: 0.0)
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
    own = tmp_path / "own.json"
    own.write_text(json.dumps(CAMERAS["lite"].to_json()))
    for camera, tilts in (
        ("mast", True), ("stock_preview", False), ("lite", False), (str(own), False)
    ):  # fmt: skip
        parts = GraphConfig("kitchen:1", tmp_path, camera=camera).parts
        of = {part.executable: part.parameters for part in parts}
        assert of["mock_turtlebot4"]["camera"] == camera
        assert load_robot(of["policy_node"]["robot"]).tilts is tilts
        assert of["policy_node"].get("other_camera", False) is not tilts


def test_the_lag_of_commands_is_counted_in_real_time(tmp_path):
    for speed, lag in ((0, None), (1, None), (2, 0.6), (1000, 10.0)):
        policy = GraphConfig("kitchen:1", tmp_path, speed=speed).parts[-1]
        assert (policy.executable, policy.parameters.get("episode.command_lag")) == (
            "policy_node", lag
        )  # fmt: skip


def test_only_cells_of_a_part_are_measured_on_a_robot_that_has_it(tmp_path, monkeypatch):
    asked = []

    def results(work, tasks, bundle, logs, graphs, part):
        asked.append((part, bundle, {EXPECTATIONS[task[0]].fault for task in tasks}))
        yield from ()

    monkeypatch.setattr(fault_matrix, "results", results)
    monkeypatch.setattr(fault_matrix, "make_bundle", lambda folder, lists, sightings: sightings)
    only = "^(image|depth|detections)_silent$"
    config = fault_matrix.MatrixConfig(tmp_path / "faults.jsonl", only=only)
    fault_matrix.measure(config)
    assert asked == [
        ("", False, {"image_silent"}), ("depth", False, {"depth_silent"}),
        ("detector", True, {"detections_silent"}),
    ]  # fmt: skip


def test_a_robot_that_is_put_down_elsewhere_forgets_what_depth_has_shown():
    assert COUNTS_ANEW == "odom_turned"
    assert simulator.JUMP_RAD > depth_watch.JUMP_RAD


# The real thing


@pytest.mark.long
def test_one_cell_on_a_live_graph(tmp_path):
    config = fault_matrix.MatrixConfig(
        tmp_path / "faults.jsonl",
        runs=1,
        graphs=1,
        only="^odom_silent$",
        phase=(FaultPhase.DRIVING,),
    )
    (row,) = fault_matrix.measure(config)
    assert json.loads(config.out.read_text()) == row
    assert (row["reaction"], row["outcome"], row["contacts"]) == ("stop", "aborted", 0)
    assert re.search("newest odometry is .* old", row["message"])
    assert row["place"] == "open"
    # How fast it stops is the machine's too, which the bench measures.
    assert row["as_expected"] is ((row["stop_s"] or 0.0) <= row["terms"]["bound_s"]), row
