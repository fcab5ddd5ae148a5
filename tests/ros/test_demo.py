"""The demo over the real graph, started as a user starts it."""

from __future__ import annotations

import json
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.bag_eval import evaluate_bag  # noqa: E402
from cfnav_ros.bag_reader import read_events, read_pictures  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.node import Node  # noqa: E402


def wait_for(condition: Callable[[], object], deadline_s: float) -> None:
    end = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end, "the condition did not come true in time"
        time.sleep(0.05)


def runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen]]:
    """Return a function that starts the demo as a user does; what is left of it is ended."""
    started = []

    def start_demo(*arguments: str) -> subprocess.Popen:
        command = [sys.executable, "-m", "cfnav_ros.demo", "--out", str(tmp_path / "demo")]
        process = subprocess.Popen(
            [*command, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
        )
        started.append(process)
        return process

    yield start_demo
    for process in started:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)


def descendants(pid: int) -> list[int]:
    """Return the processes that descend from a process."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        parents[int(stat.parent.name)] = int(fields[1])
    found = [pid]
    for ancestor in found:
        found += [child for child, parent in parents.items() if parent == ancestor]
    return found[1:]


def test_demo_over_the_real_graph_leaves_a_bag_that_tells_the_truth(
    demo: Callable[..., subprocess.Popen], eager_bundle: Path, tmp_path: Path
) -> None:
    arguments = [
        "--bundle",
        str(eager_bundle),
        "--room",
        "bathroom:20,kitchen:21",
        "--max-steps",
        "12",
        "--speed",
        "3",
    ]
    process = demo(*arguments, "--seed", "4", "--no-veto", "--episodes", "3")
    output, errors = process.communicate(timeout=400)
    assert process.returncode == 0, errors

    out = tmp_path / "demo"
    assert [p.name for p in tmp_path.iterdir()] == ["demo"]
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["bag_agrees"] is True
    assert [e["room"] for e in metrics["episodes"]] == ["bathroom:20", "kitchen:21", "bathroom:20"]
    for bag, live in zip(metrics["episodes"], metrics["live"], strict=True):
        assert bag["path_length_m"] == pytest.approx(live["path_length_m"], abs=0.02, rel=0.02)
        for name in ("goal", "outcome", "success", "collisions", "cf_success", "steps"):
            assert bag[name] == live[name]
        assert (bag["outcome"], bag["steps"]) == ("done", 7)
    assert sum(e["collisions"] for e in metrics["episodes"]) > 0
    assert set(metrics) >= {"sr", "spl", "cf_sr", "cf_spl", "seed", "bundle", "commit", "command"}
    assert [asdict(e.outcome) for e in evaluate_bag(out / "bag")] == metrics["episodes"]
    assert len(list((out / "trajectories").glob("*.png"))) == 3
    page = (out / "report.html").read_text()
    assert page.count("data:image/jpeg") >= 3
    assert "the bag agrees" in output
    stamps = {d.image_ns for d in read_events(out / "bag").decisions}
    # On a busy machine the transport may lose some; bench counts them, this sees that they come.
    assert len(read_pictures(out / "bag", stamps)) > 0.7 * len(stamps)


def test_interrupt_ends_every_process_and_leaves_no_results(
    demo: Callable[..., subprocess.Popen], eager_bundle: Path, tmp_path: Path
) -> None:
    process = demo("--bundle", str(eager_bundle), "--room", "kitchen:21", "--speed", "1")
    log = tmp_path / "demo.partial" / "logs" / "policy_node.log"
    wait_for(lambda: log.exists() and "Sending TwistStamped" in log.read_text(), 120)
    children = descendants(process.pid)
    assert len(children) >= 3
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; every process was ended" in errors
    assert not [pid for pid in children if runs(pid)]
    assert not (tmp_path / "demo").exists()
    assert not list(tmp_path.rglob("*.mcap"))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--room", "garage:25"], "garage"),
        (["--room", "kitchen:21", "--goals", "Unicorn"], "'Unicorn' is in none of the rooms"),
        (["--bundle", "/nowhere"], "/nowhere"),
    ],
)
def test_what_cannot_run_ends_with_one_sentence(
    demo: Callable[..., subprocess.Popen],
    eager_bundle: Path,
    tmp_path: Path,
    arguments: list[str],
    sentence: str,
) -> None:
    process = demo("--bundle", str(eager_bundle), *arguments)
    _, errors = process.communicate(timeout=150)
    assert process.returncode == 1
    assert re.fullmatch(r"demo: .*\n", errors), errors
    assert sentence in errors
    assert not (tmp_path / "demo").exists()


def test_a_domain_in_use_is_refused(demo: Callable[..., subprocess.Popen]) -> None:
    context = Context()
    domain = random.SystemRandom().randrange(1, 102)
    rclpy.init(context=context, domain_id=domain)
    node = Node("somebody_else", context=context)
    process = demo("--domain", str(domain))
    _, errors = process.communicate(timeout=60)
    node.destroy_node()
    context.shutdown()
    assert process.returncode == 1
    assert f"ROS domain {domain} is in use on this machine by somebody_else" in errors
