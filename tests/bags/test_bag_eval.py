"""``cfnav bag eval`` as it is called: exit codes, sentences, any locale and any standard output."""

from __future__ import annotations

import csv
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from cfnav_ros.report.bag_eval import BagEvalConfig
from cfnav_ros.report.bag_eval import run as evaluate_bags

from studies.bags import bag_files as b
from tests.bags.event_bag import bag_of, messages_of
from tests.bags.made import drive as drive_of
from tests.bags.made import recorded

S = 1_000_000_000
EVAL = [sys.executable, "-m", "cfnav.cli", "bag", "eval", "--no-replay", "--jobs", "1"]
ODD = "Läufe 100% #3 ?x=1 [a] & <i>\udcff"
"""A name with everything, and a byte that is no UTF-8."""


def run(*arguments, after="", **environment):
    """Run the command in a shell that adds redirections."""
    line = shlex.join([*EVAL, *map(str, arguments)]) + after
    return subprocess.run(
        ["bash", "-c", line], capture_output=True, text=True, timeout=120,
        env={**os.environ, **environment},
    )  # fmt: skip


def moved(path: Path) -> Path:
    """A bag of a drive of 0.2 m."""
    return bag_of(path, drive_of(100, (1.0, 0.2, 0.0, 0.2, 0.0), (0.5, 0.0, 0.0, 0.0, 0.0)))


def imu_of(path: Path) -> Path:
    """A bag of an IMU alone."""
    kind = "sensor_msgs/msg/Imu"
    said = [b.Message("/imu", kind, t * S, b.make(kind, header=b.header(t * S))) for t in range(3)]
    return b.write(path, said)


def seen_of(path: Path) -> Path:
    """A bag of pictures alone."""
    kind = "sensor_msgs/msg/Image"
    return b.write(
        path, [b.Message("/image_raw", kind, t * S, b.image(t * S)) for t in range(1, 4)]
    )


def written(out: Path) -> dict:
    return json.loads((out / "metrics.json").read_text())


@pytest.mark.parametrize(
    ("environment", "after"),
    [
        ({"PYTHONIOENCODING": "ascii"}, ""),
        ({"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}, ""),
        ({}, " <&- >&- 2>&-"),
        ({}, " 2>&1 | true; exit ${PIPESTATUS[0]}"),
    ],
)
def test_any_locale_and_any_standard_output_will_do(tmp_path, environment, after):
    folder = moved(tmp_path / "plain").rename(tmp_path / ODD)
    out = tmp_path / "out"
    done = run(folder, "--out", out, after=after, **environment)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    (drive,) = written(out)["drives"]
    assert drive["path_length_m"] == pytest.approx(0.2, abs=0.011)
    assert (out / "report.html").read_bytes().decode()
    if not after:
        assert "report in" in done.stdout


def judged(capsys, out: Path, *bags: Path, **options) -> tuple[int, str]:
    """Exit code and standard error of an evaluation in this process."""
    code = evaluate_bags(BagEvalConfig(bags, out, replay=False, jobs=1, **options))
    return code, capsys.readouterr().err


def test_a_bag_that_holds_nothing_to_judge_is_named_with_what_it_holds(tmp_path, capsys):
    out = tmp_path / "out"
    code, said = judged(capsys, out, imu_of(tmp_path / "bag"))
    (sentence,) = [line for line in said.splitlines() if line.startswith("bag_eval:")]
    assert code == 2
    assert "bag: It holds no drive: expected messages of odom, cmd_vel, scan," in sentence
    assert sentence.endswith("left out /imu (Imu, 3 messages).")
    assert not out.exists()


def test_pictures_alone_are_watched_but_are_no_drive(tmp_path, capsys):
    out = tmp_path / "out"
    code, said = judged(capsys, out, seen_of(tmp_path / "bag"))
    assert code == 2
    assert "Used was /image_raw as image, left out nothing." in said
    assert written(out)["drives"] == []
    assert (out / "health.csv").exists()


def test_a_bag_without_a_drive_beside_one_with_a_drive_is_done_in_part(tmp_path, capsys):
    code, said = judged(
        capsys, tmp_path / "out", moved(tmp_path / "good"), imu_of(tmp_path / "imu")
    )
    assert code == 1
    assert "bag_eval: imu: It holds no drive" in said
    assert [drive["bag"] for drive in written(tmp_path / "out")["drives"]] == ["good"]


def test_the_robot_is_chosen_by_its_namespace(tmp_path, capsys):
    said = [
        message
        for name, v in (("/r1", 0.0), ("/r2", 0.2))
        for message in messages_of(drive_of(100, (1.0, v, 0.0, v, 0.0)), name)
    ]
    said += [
        b.Message(f"/{robot}/scan", "sensor_msgs/msg/LaserScan", 100 * S, b.scan(100 * S))
        for robot in ("r1", "r2")
    ]
    bag, out = b.write(tmp_path / "bag", sorted(said, key=lambda m: m.log_ns)), tmp_path / "out"
    for name, way in {"": 0.0, "r1": 0.0, "/r2": 0.2}.items():
        code, told = judged(capsys, out, bag, namespace=name)
        assert code == 0, told
        assert written(out)["drives"][0]["path_length_m"] == pytest.approx(way, abs=0.011)
        assert ("The bag holds several robots, /r1, /r2" in told) is (name == "")
    code, told = judged(capsys, tmp_path / "none", bag, namespace="r3")
    assert code == 2
    assert "The bag holds no topic in the namespace /r3, its robots are /r1, /r2." in told


@pytest.mark.parametrize("params", [None, "robot.yaml"])
def test_a_robot_that_is_not_known_is_told_from_one_of_a_bag(tmp_path, params):
    options = {"params": params and tmp_path / params, "robot": "robot1"}
    (tmp_path / "robot.yaml").write_text("policy_node: {ros__parameters: {robot: differential}}")
    reason = (
        r"^robot is 'robot1', expected a file or one of differential, .*; "
        r"to choose one of the robots in a bag, use --namespace\.$"
    )
    with pytest.raises(ValueError, match=reason):
        evaluate_bags(BagEvalConfig((moved(tmp_path / "bag"),), replay=False, **options))


GO = (3.0, 0.2, 0.0, 0.2, 0.0)
PUSH, REST = (3.0, 0.2, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0, 0.0)


def test_touches_that_cannot_be_seen_are_unknown_wherever_they_are_told(tmp_path, capsys):
    out = tmp_path / "out"
    bags = [
        bag_of(tmp_path / "seen", recorded(REST, GO, PUSH, REST)),
        bag_of(tmp_path / "unseen", recorded(REST, GO, GO, REST, odometry=1)),
    ]
    code = evaluate_bags(BagEvalConfig(tuple(bags), out, replay=False, jobs=1))
    printed = capsys.readouterr()
    why = "odometry every 1.00 s that jitters by 0.0 mm, 0.0 degrees shows only stalls of 3.0 s or"
    assert code == 0
    assert f"unseen: In 1 of 1 drives touches are unknown: {why}" in printed.err
    assert "seen: In 1 of 1 drives touches are unknown" not in printed.err.replace("unseen", "")
    known, unknown = (line.split() for line in printed.out.splitlines()[1:3])
    assert (known[4], unknown[4]) == ("1", "?")
    assert "touches 1.00" in printed.out
    assert "(1 of 2 drives)" in printed.out

    metrics = written(out)
    assert [drive["collisions"] for drive in metrics["drives"]] == [1, None]
    mean = metrics["figures"]["collisions"]
    assert (mean["value"], mean["drives"], list(mean["left_out"].values())) == (1.0, 1, [1])
    rows = list(csv.DictReader((out / "drives.csv").open()))
    assert [row["collisions"] for row in rows] == ["1", ""]
    assert f"collisions: {why}" in rows[1]["missing"]
    page = (out / "report.html").read_text()
    assert page.count(why) >= 2  # beside the figure and on the drive's card
    assert "touches unknown" in page


def test_odometry_with_noise_says_how_its_way_was_counted(tmp_path, capsys):
    bag = bag_of(tmp_path / "bag", recorded(REST, GO, PUSH, REST, sigma=0.005))
    code, said = judged(capsys, tmp_path / "out", bag)
    assert code == 0
    assert "In 1 of 1 drives the path is to be taken with care: the odometry jitters by" in said
    (drive,) = written(tmp_path / "out")["drives"]
    assert drive["collisions"] == 1
    assert drive["path_length_m"] == pytest.approx(0.6, abs=0.03)


def test_odometries_with_other_frames_are_told_and_the_first_counts(tmp_path, capsys):
    said = messages_of(recorded(REST, GO, PUSH, REST))
    others = []
    for message in (m for m in said if m.topic == "/odom"):
        other = b.odometry(message.log_ns, 5.0, 0.0, 0.0)
        other.header.frame_id, other.child_frame_id = "visual_odom", "camera"
        others.append(message._replace(message=other, log_ns=message.log_ns + S // 50))
    both = sorted([*said, *others], key=lambda m: m.log_ns)
    code, told = judged(capsys, tmp_path / "out", b.write(tmp_path / "bag", both))
    assert code == 0
    assert "Several odometries speak on one topic: odom to base_link (200 messages), visual" in told
    (drive,) = written(tmp_path / "out")["drives"]
    assert (drive["collisions"], drive["path_length_m"]) == (1, pytest.approx(0.6))
