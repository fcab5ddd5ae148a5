"""Which files and folders are one bag, and what it is called."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from cfnav_ros.bags.files.finding import BagError, find_bags, unique_names
from cfnav_ros.bags.files.reading import Bag

from studies.bags.bag_files import MCAP, SQLITE, drive, split, write, write_mcap

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


def test_a_bag_counts_once_whichever_links_and_spellings_lead_to_it(tmp_path, monkeypatch):
    bag = write(tmp_path / "store/ab12", DRIVE[:20])
    sets = tmp_path / "sets"
    sets.mkdir()
    (sets / "latest").symlink_to("../store/ab12")
    (sets / "run1").symlink_to(bag)
    (sets / "around").symlink_to(tmp_path)
    file = next(bag.glob("*.mcap"))
    assert find_bags([sets / "run1"]) == [sets / "run1"]
    assert find_bags([sets]) == [sets / "around/store/ab12"]
    assert find_bags([tmp_path]) == [bag]
    (sets / "around").unlink()
    assert find_bags([sets]) == [sets / "latest"]
    assert find_bags([bag, sets, sets / "../store/ab12", file]) == [bag]
    monkeypatch.chdir(bag)
    assert find_bags([Path(), bag]) == [Path()]


def test_files_that_are_links_into_a_cache_are_bags_once(tmp_path):
    whole, blobs = split(tmp_path / "whole", DRIVE), tmp_path / "blobs"
    blobs.mkdir()
    for revision in ("main", "v2"):
        (tmp_path / "snapshots" / revision).mkdir(parents=True)
    for number, file in enumerate(sorted(whole.iterdir())):
        blob = file.rename(blobs / f"{number:02x}")
        for revision in ("main", "v2"):
            (tmp_path / "snapshots" / revision / file.name).symlink_to(blob)
    (found,) = find_bags([tmp_path / "snapshots"])
    assert found == tmp_path / "snapshots/main"
    with Bag(found) as bag:
        assert len(list(bag.messages())) == len(DRIVE)
        assert not bag.notes


def test_a_link_that_leads_nowhere_says_so(tmp_path):
    (tmp_path / "a.mcap").symlink_to("../annex/objects/x")
    with pytest.raises(BagError, match=r"is a link to \.\./annex/objects/x, which is not there\.$"):
        find_bags([tmp_path / "a.mcap"])


def test_copies_are_bags_of_their_own(tmp_path):
    one = write(tmp_path / "one/bag", DRIVE[:20])
    two = Path(shutil.copytree(one, tmp_path / "two/bag"))
    assert find_bags([tmp_path]) == [one, two]


@pytest.mark.parametrize("name", ["Läufe 100% #3 ?x=1 [a] & <i>", "b\udcff\udc80", "-n", "a*b"])
@pytest.mark.parametrize("storage", [MCAP, SQLITE])
def test_bags_of_any_name_are_read(tmp_path, name, storage):
    bag = write(tmp_path / "plain", DRIVE, storage)
    folder = tmp_path / name
    folder.mkdir()
    file = next(path for path in bag.iterdir() if path.suffix != ".yaml")
    odd = Path(shutil.copy(file, folder / f"{name}{file.suffix}"))
    for found in find_bags([folder, odd]):
        with Bag(found) as opened:
            assert len(list(opened.messages())) == len(DRIVE)
