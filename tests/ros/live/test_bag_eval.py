"""A real MCAP bag written and judged."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.writer import BagWriter, typestore_with
from cfnav_ros.report.bag_eval import BagEvalConfig, options_of

from cfnav_core.task.actions import Action
from studies.bags.bag_files import VARIANTS
from studies.bags.bag_files import drive as recorded

A = Action
DRIVE = [A.MoveAhead, A.MoveAhead, A.RotateLeft, A.MoveAhead, A.MoveAhead, A.Done]
S = 1_000_000_000


@pytest.fixture
def bag(synthetic_bag) -> Path:
    """A bag of a clean, a touching and a missed episode."""
    writer = synthetic_bag()
    writer.map(S // 2)
    t = writer.episode(S, DRIVE)
    t = writer.episode(t, DRIVE, touch=(2, 4))
    writer.episode(t, DRIVE, goal="Fridge", seen=False)
    writer.writer.close()
    return writer.path


def test_outcomes_of_a_real_bag(bag: Path) -> None:
    outcomes = [drive.outcome for drive in evaluate(bag, JudgeOptions()).drives]
    judged = [
        (o.goal, o.success.value, o.collisions.value, o.cf_success.value, o.steps) for o in outcomes
    ]
    assert judged == [
        ("Laptop", True, 0, True, 6),
        ("Laptop", True, 2, False, 6),
        ("Fridge", False, 0, False, 6),
    ]
    assert [o.driven_m.value for o in outcomes] == pytest.approx([1.0, 1.0, 1.0])


def bag_eval(*arguments: object) -> subprocess.CompletedProcess:
    """What the command line makes of its arguments."""
    command = [sys.executable, "-m", "cfnav.cli", "bag", "eval", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


def test_command_line_writes_the_figures_and_the_page(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = bag_eval(bag, "--out", out)
    assert done.returncode == 0, done.stderr
    assert {file.name for file in out.iterdir()} == {
        "report.html", "metrics.json", "drives.csv", "decisions.csv", "health.csv"
    }  # fmt: skip
    written = json.loads((out / "metrics.json").read_text())
    assert written["figures"]["cf_sr"]["value"] == pytest.approx(1 / 3)
    assert written["drives"][1]["collisions"] == 2
    assert [bundle["name"] for bundle in written["bundles"]] == ["default"]
    assert "cf_sr" in done.stdout
    assert f"report in {out / 'report.html'}" in done.stdout


def test_bags_side_by_side_are_those_one_after_the_other(bag: Path, tmp_path: Path) -> None:
    for name in ("first", "second"):
        shutil.copytree(bag, tmp_path / "bags" / name / "bag")
    rows = []
    for jobs in (1, 2):
        out = tmp_path / f"out{jobs}"
        done = bag_eval(tmp_path / "bags", "--out", out, "--no-replay", "--jobs", jobs)
        assert done.returncode == 0, done.stderr
        rows.append((out / "drives.csv").read_text())
    assert rows[0] == rows[1]
    table = list(csv.DictReader(rows[0].splitlines()))
    assert [row["bag"] for row in table] == ["first/bag"] * 3 + ["second/bag"] * 3


def test_a_damaged_bag_leaves_the_others_whole_and_is_named(bag: Path, tmp_path: Path) -> None:
    shutil.copytree(bag, tmp_path / "bags/whole")
    (file,) = bag.glob("*.mcap")
    (tmp_path / "bags/cut").mkdir()
    (tmp_path / "bags/cut/cut.mcap").write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    out = tmp_path / "out"
    done = bag_eval(tmp_path / "bags", "--out", out, "--no-replay")
    assert done.returncode == 1
    assert "bag_eval: cut: " in done.stderr
    assert "Traceback" not in done.stderr
    written = json.loads((out / "metrics.json").read_text())
    assert [b["damaged"] for b in written["bags"]] == [True, False]
    assert sum(row["bag"] == "whole" for row in written["drives"]) == 3


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--topic", "picture:=/camera"], "expected ROLE:=NAME"),
        (["--bundle", "nowhere"], "nowhere"),
        (["--bundle", "nowhere", "--bundle", "nowhere"], "is given twice"),
        (["--episodes", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_what_makes_no_sense_ends_with_one_sentence(
    bag: Path, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    done = bag_eval(bag, "--out", tmp_path / "out", *arguments)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [["--topic", "image:=/wrong"], []])
def test_decisions_that_could_not_be_replayed_are_told_and_no_success(
    synthetic_bag, tmp_path: Path, arguments: list[str]
) -> None:
    writer = synthetic_bag()
    if not arguments:
        writer.picture = lambda t: None
    writer.episode(S, DRIVE)
    writer.writer.close()
    out = tmp_path / "out"
    done = bag_eval(writer.path, "--out", out, *arguments)
    assert done.returncode == 1, done.stderr
    (sentence,) = [line for line in done.stderr.splitlines() if "Not replayed" in line]
    assert "Not replayed were 6 decisions or drives (6: The bag holds no picture" in sentence
    assert ("/wrong that was given for image is not in the bag" in done.stderr) is bool(arguments)
    written = json.loads((out / "metrics.json").read_text())
    silent = [f["topic"] for f in written["bags"][0]["findings"] if f["kind"] == "silent"]
    assert silent == ([] if arguments else ["/oakd/rgb/preview/image_raw"])


def test_a_topic_that_was_named_and_is_not_there_is_no_success(bag: Path, tmp_path: Path) -> None:
    arguments = ["--out", tmp_path / "out", "--no-replay", "--topic", "image:=/wrong"]
    assert bag_eval(bag, *arguments).returncode == 1


def test_rows_of_the_episodes_file_speak_of_one_bag_each(bag: Path, tmp_path: Path) -> None:
    for name in ("first", "second"):
        shutil.copytree(bag, tmp_path / "bags" / name / "bag")
    rows = tmp_path / "rows.yaml"
    for name, fits in (("tuor", "none of the bags"), ("bag", "first/bag and ")):
        rows.write_text(f"- {{bag: {name}, start: 0, end: 5, goal: Laptop}}\n")
        done = bag_eval(tmp_path / "bags", "--out", tmp_path / "out", "--episodes", rows)
        assert done.returncode == 2
        assert f"{name!r}, which fits " in done.stderr
        assert fits in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
        assert not (tmp_path / "out").exists()
    rows.write_text("- {bag: first/bag, start: 0, end: 5, goal: Mug}\n")
    arguments = ["--out", tmp_path / "out", "--no-replay", "--episodes", rows]
    done = bag_eval(tmp_path / "bags", *arguments)
    assert done.returncode == 0, done.stderr
    drives = json.loads((tmp_path / "out/metrics.json").read_text())["drives"]
    assert [d["goal"] for d in drives if d["bag"] == "first/bag"] == ["Mug"]
    assert [d["goal"] for d in drives if d["bag"] == "second/bag"] == ["Laptop", "Laptop", "Fridge"]


def test_unrelated_bags_in_one_folder_are_judged_apart(bag: Path, tmp_path: Path) -> None:
    (file,) = bag.glob("*.mcap")
    (tmp_path / "drives").mkdir()
    for name in ("friday", "monday"):
        shutil.copy(file, tmp_path / "drives" / f"{name}.mcap")
    shutil.copytree(bag, tmp_path / "drives/run3")
    out = tmp_path / "out"
    done = bag_eval(tmp_path / "drives", "--out", out, "--no-replay")
    assert done.returncode == 0, done.stderr
    written = json.loads((out / "metrics.json").read_text())
    assert [b["name"] for b in written["bags"]] == ["friday.mcap", "monday.mcap", "run3"]
    assert len(written["drives"]) == 9


def test_what_no_checksum_protects_is_counted_and_told(tmp_path: Path) -> None:
    said = recorded(2.0)
    for variant, share in (("recorded", 0), ("sqlite", 1)):
        path, out = VARIANTS[variant](tmp_path / variant, said), tmp_path / f"{variant}_out"
        done = bag_eval(path, "--out", out, "--no-replay")
        assert done.returncode == 0, done.stderr
        (found,) = json.loads((out / "metrics.json").read_text())["bags"]
        assert found["messages"] > 200
        assert found["unchecked"] == share * found["messages"]
        sentence = f"No checksum protects {found['unchecked']} of the {found['messages']} messages:"
        assert (sentence in (out / "report.html").read_text()) is bool(share)


def test_a_file_within_the_folder_reads_the_same(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    outcomes = [[d.outcome for d in evaluate(path, JudgeOptions()).drives] for path in (file, bag)]
    assert outcomes[0] == outcomes[1]


def test_the_robot_s_parameter_file_tells_how_it_decided(bag: Path, tmp_path: Path) -> None:
    params = tmp_path / "robot.yaml"
    params.write_text("lidar_collision_node: {ros__parameters: {disc: {mount_x: 0.2}}}")
    given = {"replay": False, "robot": "differential", "params": params, "topic": ("odom:=o",)}
    options = options_of(BagEvalConfig((bag,), **given), bag)
    assert options.topics == {"image": "camera/image_raw", "odom": "o"}
    assert (options.lidar.disc.mount_x, options.lidar.disc.radius) == (0.2, 0.2)
    assert options.mount_given
    assert not options.limits.has_tilt
    done = bag_eval(bag, "--no-replay", "--robot", "differential", "--out", tmp_path / "out")
    assert done.returncode == 1
    assert "camera/image_raw that was given for image is not in the bag" in done.stderr
    params.write_text("policy_node: {ros__parameters: {vetoes: 1}}")
    done = bag_eval(bag, "--params", params, "--out", tmp_path / "none")
    assert done.returncode == 2
    assert "There is no parameter 'vetoes'" in done.stderr
    assert not (tmp_path / "none").exists()


def test_what_is_no_bag_ends_with_one_sentence(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cfnav.cli", "bag", "eval", str(tmp_path / "nothing")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("cfnav: ")
    assert "does not exist" in done.stderr


def test_a_bag_has_its_name_only_when_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    left = BagWriter(path, typestore_with([]))
    assert not path.exists()
    del left  # as after a crash: nothing closes it
    with pytest.raises(FileExistsError, match=r"bag\.partial exists already: a recording runs or"):
        BagWriter(path, typestore_with([]))
    shutil.rmtree(tmp_path / "bag.partial")
    writer = BagWriter(path, typestore_with([]))
    writer.close()
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]
    with pytest.raises(FileExistsError, match="exists already"):
        BagWriter(path, typestore_with([]))


def test_what_a_recording_that_is_given_up_holds_can_be_read(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag", typestore_with([]))
    writer.add_topic("/heard", "std_msgs/msg/Empty")
    writer.add_topic("/silent", "std_msgs/msg/Empty")
    for t_ns in range(3):
        writer.write("/heard", t_ns, b"\x00\x01\x00\x00\x00")
    writer.leave()
    with Bag(tmp_path / "bag.partial/bag") as bag:
        assert [(raw.topic.name, raw.log_ns) for raw in bag.messages()] == [
            ("/heard", t_ns) for t_ns in range(3)
        ]
        assert bag.unchecked == 0
    assert any("broke off" in note for note in bag.notes)


def test_an_aborted_bag_leaves_nothing(tmp_path: Path) -> None:
    BagWriter(tmp_path / "bag", typestore_with([])).abort()
    assert list(tmp_path.iterdir()) == []
