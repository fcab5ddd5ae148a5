"""The benchmark: its figures from hand-made arrivals, and a short one over the real graph."""

from __future__ import annotations

import json
import re
import signal
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from studies.bench.live_figures import (
    NOMINAL_HZ,
    Heard,
    HeardDecision,
    HeardEpisode,
    count_images,
    figures,
    percentiles,
    rate_hz,
    stamp_ns,
    table,
)

MS = 1_000_000
MACHINE = {
    "load": {"average_1min": 1.0, "cores": 2, "cpu": "a"}, "bundle": "b", "commit": "c"
}  # fmt: skip
LONG_S = 500.0
"""Two starts of the graph and two drives, on a machine that does other things too."""


def stream(count: int, period_ms: int, lost: tuple[int, ...] = ()) -> tuple[Heard, ...]:
    """Messages that arrive 5 ms after their stamp, at 10 s of the steady clock and on."""
    kept = [k for k in range(count) if k not in lost]
    return tuple(Heard(10.0 + (k * period_ms + 5) * 1e-3, k * period_ms * MS) for k in kept)


def made_drive(
    speed: float, slow: float = 1.0, lost: tuple[int, ...] = (), outcome: str = "done"
) -> HeardEpisode:
    """A drive of 2 s: pictures on a grid of 10 ms as the simulator's, one decision."""
    images = [Heard(10.0 + k / 15, round(k / 15, 2) * 1000 * MS) for k in range(31)]
    return HeardEpisode(
        room="kitchen:25",
        goal="Fridge",
        speed=speed,
        outcome=outcome,
        message="",
        clock=tuple(Heard(10.0 + k * 0.02 * slow, k * 20 * MS) for k in range(101)),
        sensors={
            "camera_hz": tuple(image for k, image in enumerate(images) if k not in lost),
            "scan_hz": stream(16, 130),
            "odom_hz": stream(41, 50),
        },
        decisions=(HeardDecision(10.0 + 0.5 * slow, 440 * MS, 400 * MS),),
    )


def test_a_stamp_is_read_from_either_byte_order() -> None:
    little = b"\x00\x01\x00\x00" + struct.pack("<iI", 3, 250 * MS) + b"rest"
    big = b"\x00\x00\x00\x00" + struct.pack(">iI", 3, 250 * MS) + b"rest"
    assert stamp_ns(little) == stamp_ns(big) == 3250 * MS


def test_rate_leaves_out_the_time_between_drives() -> None:
    near = stream(11, 100)
    late = tuple(Heard(h.arrived + 1000.0, h.stamp_ns) for h in near)
    assert rate_hz([near, late, near[:1], ()]) == pytest.approx(10.0)
    with pytest.raises(ValueError, match="two messages"):
        rate_hz([near[:1], ()])


@pytest.mark.parametrize("lost", [(), (7,), (3, 4, 5, 20), tuple(range(2, 29))])
def test_lost_pictures_are_the_gaps_in_the_stamps(lost: tuple[int, ...]) -> None:
    images = made_drive(1.0, lost=lost).sensors["camera_hz"]
    assert count_images(images) == (31, 31 - len(lost))
    assert count_images((*images, images[0])) == (31, 31 - len(lost)), "one came twice"
    assert count_images(()) == (0, 0)


def test_percentiles_are_between_the_samples_and_need_one() -> None:
    assert percentiles([float(n) for n in range(101)]) == {"p50": 50.0, "p99": 99.0, "samples": 101}
    with pytest.raises(ValueError, match="no decision"):
        percentiles([])


def test_figures_by_hand() -> None:
    late = made_drive(0.0, slow=10.0, outcome="aborted")
    report = figures([made_drive(1.0, lost=(4,))], [made_drive(0.0, slow=0.25, lost=(5, 6)), late])
    assert report["image_to_action_ms"]["p50"] == 40.0
    assert report["image_to_action_real_ms"]["p50"] == 100.0  # clock of 0.4 s came at 10.4
    assert report["scan_hz"] == pytest.approx(7.692, abs=1e-3)
    assert report["odom_hz"] == 20.0
    assert report["camera_hz"] == pytest.approx(14.5)
    assert report["real_time_factor"] == 4.0
    assert (report["images_lost"], report["images_published"]) == (3, 93)
    assert report["drives_held"] == 2
    assert [row["images_lost"] for row in report["drives"]] == [1, 2, 0]
    assert figures([late], [late])["real_time_factor"] is None
    assert "none held" in table({**figures([late], [late]), **MACHINE})


@pytest.fixture
def bench(
    start_process: Callable, ros_domain_id: int, eager_bundle: Path, tmp_path: Path
) -> Callable:
    """Return a function that starts a very short benchmark with a bundle that drives ahead."""
    pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
    pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")
    fixed = ["--domain", str(ros_domain_id), "--out", str(tmp_path / "bench")]
    fixed += ["--bundle", str(eager_bundle), "--room", "bathroom:20", "--max-steps", "3"]
    fixed += ["--seconds", "0.1", "--fast-seconds", "0.1"]
    return lambda *arguments: start_process("studies.bench.live", *fixed, *arguments)


@pytest.mark.ros
@pytest.mark.long
def test_a_short_bench_measures_the_real_graph(bench: Callable, tmp_path: Path) -> None:
    process = bench()
    assert process.wait(LONG_S) == 0, process.output
    report = json.loads((tmp_path / "bench/live.json").read_text())
    assert report["nominal_hz"] == NOMINAL_HZ == {"camera_hz": 15, "scan_hz": 7.7, "odom_hz": 20}
    assert all(isinstance(report[name], float) and report[name] > 0 for name in NOMINAL_HZ)
    load = report["load"]
    assert load["average_1min"] >= 0
    assert load["cores"] >= 1
    assert load["cpu"]
    assert report["bundle"] == "eager"
    assert report["commit"]
    assert report["command"].startswith("python -m studies.bench.live --domain")

    drives = report["drives"]
    assert [drive["speed"] for drive in drives] == [1.0, 0.0]
    for drive in drives:
        assert drive["room"] == "bathroom:20"
        # The clock, which is another topic, tells how many pictures there must have been.
        assert drive["images_published"] == pytest.approx(15 * drive["simulated_s"], abs=2.5)
        received = drive["images_received"]
        assert 0 < received == drive["images_published"] - drive["images_lost"]
    steady, fast = drives
    assert (steady["outcome"], steady["decisions"]) == ("step_limit", 3)
    # At full speed a busy machine may let the inputs grow too old: that is what is measured.
    assert fast["outcome"] in ("step_limit", "aborted")
    assert (report["real_time_factor"] is None) == (fast["outcome"] == "aborted")
    assert report["drives_held"] == sum(drive["outcome"] == "step_limit" for drive in drives)
    for name in ("images_lost", "images_published"):
        assert report[name] == sum(drive[name] for drive in drives)
    assert report["image_to_action_real_ms"]["p50"] > 0
    for name in ("image_to_action_ms", "image_to_action_real_ms"):
        delay = report[name]
        assert 0 <= delay["p50"] <= delay["p99"]
        assert delay["samples"] == 3
    lost = rf"images lost +{report['images_lost']} of {report['images_published']}\n"
    assert re.search(lost, process.output)
    assert f"{report['load']['average_1min']:.2f} before the start" in process.output


@pytest.mark.ros
@pytest.mark.long
def test_interrupt_leaves_no_figures(bench: Callable, tmp_path: Path) -> None:
    process = bench("--seconds", "1000")
    process.wait_for_line("speed 1: driving in ROS domain")
    process.process.send_signal(signal.SIGINT)
    assert process.wait() == 130, process.output
    assert process.output.endswith("bench: interrupted; every process was ended\n")
    assert not list((tmp_path / "bench").glob("live.json*"))


@pytest.mark.ros
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--seconds", "0"], "--seconds is 0.0; expected more than 0"),
        (["--room", " ,"], "--room is empty; expected rooms such as kitchen:25"),
        (["--bundle", "/nowhere"], "/nowhere"),
        (["--room", "garage:25"], "garage"),
    ],
)
def test_what_cannot_run_ends_with_one_sentence(
    bench: Callable, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    process = bench(*arguments)
    assert process.wait(LONG_S) == 2, process.output
    assert re.match(r"bench: \S", process.output.splitlines()[-1])
    assert sentence in process.output.splitlines()[-1]
    assert "Traceback" not in process.output
    assert not (tmp_path / "bench/live.json").exists()
