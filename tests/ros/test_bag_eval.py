"""A real MCAP bag written and judged."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from cfnav_ros.bag_writer import BagWriter, typestore_with
from cfnav_ros.bags.evaluation import Options, evaluate

from cfnav_core.actions import Action

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
    outcomes = [drive.outcome for drive in evaluate(bag, Options()).drives]
    judged = [
        (o.goal, o.success.value, o.collisions.value, o.cf_success.value, o.steps) for o in outcomes
    ]
    assert judged == [
        ("Laptop", True, 0, True, 6),
        ("Laptop", True, 2, False, 6),
        ("Fridge", False, 0, False, 6),
    ]
    assert [o.driven_m.value for o in outcomes] == pytest.approx([1.0, 1.0, 1.0])


def test_command_line_prints_the_figures(bag: Path) -> None:
    command = [sys.executable, "-m", "cfnav_ros.bag_eval", str(bag)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    written = json.loads(done.stdout)
    assert written["figures"]["cf_sr"]["value"] == pytest.approx(1 / 3)
    assert written["drives"][1]["collisions"] == 2


def test_a_file_within_the_folder_reads_the_same(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    outcomes = [[d.outcome for d in evaluate(path, Options()).drives] for path in (file, bag)]
    assert outcomes[0] == outcomes[1]


def test_what_is_no_bag_ends_with_one_sentence(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cfnav_ros.bag_eval", str(tmp_path / "nothing")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("bag_eval: ")
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


def test_an_aborted_bag_leaves_nothing(tmp_path: Path) -> None:
    BagWriter(tmp_path / "bag", typestore_with([])).abort()
    assert list(tmp_path.iterdir()) == []
