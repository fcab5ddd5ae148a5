"""A real MCAP bag written and judged."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cfnav_ros.bag_eval import evaluate_bag, figures
from cfnav_ros.bag_reader import BagError, read_maps, read_pictures
from cfnav_ros.bag_writer import BagWriter, typestore_with

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
    outcomes = [episode.outcome for episode in evaluate_bag(bag)]
    judged = [(o.goal, o.success, o.collisions, o.cf_success, o.steps) for o in outcomes]
    assert judged == [
        ("Laptop", True, 0, True, 6),
        ("Laptop", True, 2, False, 6),
        ("Fridge", False, 0, False, 6),
    ]
    assert [o.path_length_m for o in outcomes] == pytest.approx([1.0, 1.0, 1.0])
    assert figures(outcomes) == pytest.approx(
        {"sr": 2 / 3, "spl": 2 / 3, "cf_sr": 1 / 3, "cf_spl": 1 / 3}
    )


def test_pictures_come_by_stamp_in_rgb_without_padding(bag: Path) -> None:
    pictures = read_pictures(bag, {2 * S, 3 * S, 1})
    assert set(pictures) == {2 * S, 3 * S}
    assert pictures[2 * S].shape == (24, 32, 3)
    assert (pictures[2 * S] == np.array([255, 0, 0])).all()


def test_map_comes_with_its_frame(bag: Path) -> None:
    (room,) = read_maps(bag)
    assert room.occupied.shape == (200, 200)
    assert room.resolution == pytest.approx(0.02)
    assert room.occupied[0].all()
    assert not room.occupied[50, 50]


def test_command_line_prints_and_writes_the_figures(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    command = [sys.executable, "-m", "cfnav_ros.bag_eval", str(bag), "--json", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "kitchen:25" in done.stdout
    written = json.loads(out.read_text())
    assert written["cf_sr"] == pytest.approx(1 / 3)
    assert written["episodes"][1]["collisions"] == 2


def test_a_file_within_the_folder_reads_the_same(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    assert [e.outcome for e in evaluate_bag(file)] == [e.outcome for e in evaluate_bag(bag)]


@pytest.mark.parametrize("damage", ["missing", "truncated", "empty", "noise", "no episode"])
def test_a_bag_that_cannot_be_judged_ends_with_one_sentence(
    bag: Path, tmp_path: Path, damage: str
) -> None:
    (file,) = bag.glob("*.mcap")
    if damage == "missing":
        bag = tmp_path / "nothing"
    elif damage == "truncated":
        file.write_bytes(file.read_bytes()[:5000])
    elif damage == "empty":
        file.write_bytes(b"")
    elif damage == "noise":
        data = bytearray(file.read_bytes())
        data[2000:4000] = bytes(2000)
        file.write_bytes(bytes(data))
    else:
        bag = tmp_path / "other"
        writer = BagWriter(bag, typestore_with([]))
        writer.add_topic("/clock", "rosgraph_msgs/msg/Clock")
        writer.write("/clock", 0, bytes(12))
        writer.close()
    with pytest.raises(BagError, match=str(tmp_path)):
        evaluate_bag(bag)


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
