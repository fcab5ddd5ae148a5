"""The demo and the trials over the real graph, started as a user starts them."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.bags.evaluation import JudgeOptions, evaluate  # noqa: E402
from cfnav_ros.bags.judge.outcomes import live_outcome  # noqa: E402
from cfnav_ros.drive.outcome import Outcome  # noqa: E402
from cfnav_ros.live.demo import run_trial  # noqa: E402
from cfnav_ros.live.plan import Trial  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402

from cfnav_core.task.actions import Action  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402

LONG_S = 400.0
"""A whole demo, on a machine that does other things too."""


@pytest.fixture
def demo(
    start_process: Callable, ros_domain_id: int, eager_bundle: Path, tmp_path: Path
) -> Callable:
    """Return a function that starts the demo with a bundle that only drives ahead."""
    fixed = ["--domain", str(ros_domain_id), "--bundle", str(eager_bundle)]
    fixed += ["--out", str(tmp_path / "demo")]
    return lambda *arguments: start_process("cfnav.cli", "demo", *fixed, *arguments)


def descendants(pid: int) -> list[int]:
    """Return the processes that descend from a process."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    found = [pid]
    for ancestor in found:
        found += [child for child, parent in parents.items() if parent == ancestor]
    return found[1:]


def runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_demo_over_the_real_graph_leaves_a_bag_that_tells_the_truth(
    demo: Callable, tmp_path: Path
) -> None:
    process = demo(
        *("--room", "bathroom:20,kitchen:21", "--seed", "4", "--episodes", "3"),
        *("--speed", "0", "--no-veto"),  # in lock-step no machine is too busy
    )
    assert process.wait(LONG_S) == 0, process.output

    out = tmp_path / "demo"
    assert not (tmp_path / "demo.partial").exists()
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["bag_agrees"] is True
    assert [e["room"] for e in metrics["episodes"]] == ["bathroom:20", "kitchen:21", "bathroom:20"]
    for bag, live in zip(metrics["episodes"], metrics["live"], strict=True):
        assert bag["path_length_m"] == pytest.approx(live["path_length_m"], abs=0.02, rel=0.02)
        for name in ("goal", "outcome", "success", "collisions", "cf_success", "steps"):
            assert bag[name] == live[name]
        told = (out / "logs/policy_node.log").read_text()
        assert bag["outcome"] == "done", told
    assert sum(e["collisions"] for e in metrics["episodes"]) > 0
    assert set(metrics) >= {"sr", "spl", "cf_sr", "cf_spl", "seed", "commit", "command"}
    assert metrics["bundle"] == "eager"
    evaluation = evaluate(out / "bag", JudgeOptions())
    assert (evaluation.damaged, evaluation.missing) == (False, ())
    # The base may still give way to a wall after a decision. Then that comes to nothing, and the
    # policy, which has counted it, decides anew: a MoveAhead less, or Done again.
    for one in evaluation.drives:
        actions = [decision.action for decision in one.drive.decisions]
        assert actions == [Action.MoveAhead] * 6 + [Action.Done] * (len(actions) - 6)
        done = [not decision.vetoed for decision in one.drive.decisions[6:]]
        assert done == [False] * (len(done) - 1) + [True]
    judged = [live_outcome(drive.drive) for drive in evaluation.drives]
    assert [asdict(outcome) for outcome in judged if outcome] == metrics["episodes"]
    assert len(list((out / "trajectories").glob("*.png"))) == 3
    page = (out / "report.html").read_text()
    assert page.count("data:image/jpeg") >= 3
    assert "eager: the same" in page
    # The transport may lose a few pictures on their way to the recorder.
    assert sum(len(drive.pictures) for drive in evaluation.drives) > 0.7 * 3 * 7


def test_a_drive_that_did_not_end_by_itself_says_why(capsys: pytest.CaptureFixture) -> None:
    why = "The newest picture is 3.00 s old (limit 1 s): start the camera's driver again."
    for ended, told in (("aborted", f": {why}"), ("done", "")):
        outcome = Outcome("Mug", "kitchen:0", ended, False, 0, False, 3, 0.5, 1.0)
        graph = SimpleNamespace(run_episode=lambda *_, made=outcome: made, message=why)
        run_trial(graph, Trial("kitchen:0", "Mug", 0))
        line = f"kitchen:0 Mug: ✗ missed ({ended}, 3 steps, 0.50 m, collisions 0){told}\n"
        assert capsys.readouterr().out == line


def test_goals_that_the_camera_does_not_see_are_left_out_and_told(
    demo: Callable, tmp_path: Path
) -> None:
    process = demo(
        *("--room", "bathroom:20", "--goals", "Mirror,Towel", "--camera", "stock_preview"),
        *("--speed", "2", "--no-veto", "--no-report"),
    )
    assert process.wait(LONG_S) == 0, process.output
    assert "learnt from a camera of 90 x 90 degrees" in process.output
    assert "left out: room bathroom:20: Mirror is seen within 1.5 m from 0" in process.output
    metrics = json.loads((tmp_path / "demo/metrics.json").read_text())
    assert [episode["goal"] for episode in metrics["episodes"]] == ["Towel"]
    assert metrics["camera"] == "stock_preview"


def test_interrupt_stops_the_robot_ends_every_process_and_leaves_no_results(
    demo: Callable, ros_domain_id: int, tmp_path: Path
) -> None:
    process = demo("--room", "bathroom:20", "--speed", "1")
    process.wait_for_line("episodes?, ROS domain")
    # The policy knows a node of this name for no robot.
    listener = OwnNode(ros_domain_id, "recorder")
    speeds = []
    listener.node.create_subscription(
        TwistStamped,
        "cmd_vel",
        lambda message: speeds.append((message.twist.linear.x, message.twist.angular.z)),
        qos_profile_sensor_data,
    )
    listener.wait(lambda: any(v for v, _ in speeds), "the robot to drive")
    children = descendants(process.process.pid)
    assert len(children) >= 3
    process.process.send_signal(signal.SIGINT)
    listener.wait(lambda: process.process.poll() is not None, "the end of the demo")
    assert process.wait() == 130, process.output
    assert "cfnav: interrupted; every process was ended\n" in process.output
    listener.wait(lambda: speeds[-1] == (0.0, 0.0), "a velocity of zero at the end")
    listener.close()
    assert not [pid for pid in children if runs(pid)]
    assert not (tmp_path / "demo").exists()
    assert not list(tmp_path.rglob("*.mcap"))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--room", "garage:25"], "garage"),
        (["--goals", "Unicorn"], "found goal 'Unicorn', expected one of AlarmClock"),
        (["--room", "kitchen:21", "--goals", "Pillow"], "'Pillow' is in none of the rooms"),
        (["--bundle", "/nowhere"], "/nowhere"),
        (
            ["--camera", "periscope"],
            "expected mast, stock_preview, stock_wide, lite or a JSON file",
        ),
        (
            ["--room", "bathroom:20", "--goals", "Mirror", "--camera", "lite"],
            "no goal can be sought; the last: room bathroom:20: Mirror is seen within 1.5 m from 0",
        ),
    ],
)
def test_what_cannot_run_ends_with_one_sentence(
    demo: Callable, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    process = demo(*arguments)
    assert process.wait() == 2, process.output
    last = process.output.splitlines()[-1]
    assert re.match(r"cfnav: \S", last)
    assert sentence in last
    assert "Traceback" not in process.output
    assert not (tmp_path / "demo").exists()


def test_a_domain_in_use_is_refused(demo: Callable, ros_domain_id: int) -> None:
    somebody = OwnNode(ros_domain_id, "somebody_else")
    process = demo()
    assert process.wait() == 2
    sentence = f"ROS domain {ros_domain_id} is in use on this machine by somebody_else"
    assert sentence in process.output
    somebody.close()


@pytest.mark.long
def test_trials_go_on_where_they_stopped_and_repeat_themselves(
    start_process: Callable, ros_domain_id: int, eager_bundle: Path, tmp_path: Path
) -> None:
    out = tmp_path / "trials.jsonl"
    fixed = ["episodes", "--domain", str(ros_domain_id), "--out", str(out)]
    fixed += ["--room", "bathroom:20", "--speed", "0"]

    def run(*arguments: str) -> list[dict]:
        process = start_process("studies.live.trials", *fixed, *arguments)
        assert process.wait(LONG_S) == 0, process.output
        return [json.loads(line) for line in out.read_text().splitlines()]

    mine = ["--bundle", str(eager_bundle)]
    first = run(*mine, "--episodes", "1")
    out.write_text(out.read_text() + '{"trial": {"ro')  # as if killed while writing
    both = run(*mine, "--episodes", "2")
    assert both[:1] == first
    assert [row["trial"]["room"] for row in both] == ["bathroom:20"] * 2
    assert both[0]["trial"]["goal"] != both[1]["trial"]["goal"]
    assert [row["steps"] for row in both] == [7, 7]
    out.unlink()
    again = run(*mine, "--episodes", "1")[0]
    assert again.pop("path_length_m") == pytest.approx(first[0]["path_length_m"], abs=1e-9)
    assert again.items() <= first[0].items()
    other = start_process("studies.live.trials", *fixed, *mine, "--max-steps", "9")
    assert other.wait(LONG_S) == 2
    assert "trials.jsonl holds episodes run with" in other.output
