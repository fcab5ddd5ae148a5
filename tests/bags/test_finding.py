"""Which files and folders are one bag, and what it is called."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from cfnav_ros.bags.reading import Bag, BagError, find_bags, unique_names

from tests.bags.bag_files import drive, split, write, write_mcap

DRIVE = drive()


def test_the_bags_in_folders_are_found(tmp_path):
    one = write(tmp_path / "a/drive_10", [])
    two = write(tmp_path / "a/drive_9", [])
    file = write_mcap(tmp_path / "b.mcap", [])
    loose = tmp_path / "c/loose"
    loose.mkdir(parents=True)
    shutil.copy(file, loose / "x.mcap")
    assert find_bags([tmp_path / "a", file, tmp_path / "c", two]) == [two, one, file, loose]
    (tmp_path / "none").mkdir()
    with pytest.raises(BagError, match="is no bag and holds none: expected"):
        find_bags([tmp_path / "none"])
    with pytest.raises(BagError, match="does not exist"):
        find_bags([tmp_path / "nowhere"])
    with pytest.raises(BagError, match="is no bag"):
        find_bags([Path(__file__)])


def test_unrelated_files_in_one_folder_are_bags_of_their_own(tmp_path):
    days = [write_mcap(tmp_path / f"{day}.mcap", DRIVE[:20]) for day in ("friday", "monday")]
    run = write(tmp_path / "run3", DRIVE[:20])
    assert find_bags([tmp_path]) == [*days, run]
    days[1].unlink()
    assert find_bags([tmp_path]) == [days[0], run]
    with Bag(days[0]) as bag:
        assert len(list(bag.messages())) == 20
        assert not bag.notes


def test_the_parts_of_a_split_bag_beside_another_are_one_bag(tmp_path):
    whole = split(tmp_path / "split", DRIVE, parts=11)
    for number, file in enumerate(sorted(whole.glob("*.mcap"), key=lambda p: int(p.stem[5:]))):
        file.rename(whole / f"tour_{number}.mcap")
    (whole / "metadata.yaml").unlink()
    assert find_bags([whole]) == [whole]
    other = write_mcap(whole / "other.mcap", DRIVE[:20])
    packed = whole / "tour_3.mcap.zstd"  # beside what was unpacked from it
    packed.write_bytes(b"")
    tour, _ = found = find_bags([whole])[::-1]
    assert found == [whole / "tour_*.mcap", other]
    with Bag(tour) as bag:
        assert len(list(bag.messages())) == len(DRIVE)
        (note,) = bag.notes
    assert "has no metadata.yaml" in note


def test_bags_of_one_name_are_told_apart_by_their_folders() -> None:
    paths = [Path(p) for p in ("/a/x/bag", "/a/y/bag", "/b/y/bag", "/a/other", "/bag")]
    assert unique_names(paths) == ["x/bag", "a/y/bag", "b/y/bag", "other", "/bag"]
    assert unique_names([Path("out/demo/bag")]) == ["bag"]
