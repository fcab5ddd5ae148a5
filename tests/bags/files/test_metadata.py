"""metadata.yaml is advice: it may be missing, damaged or wrong, and what the files hold counts."""

from __future__ import annotations

import shutil
import sqlite3

import pytest
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.roles import assign
from rosbags.rosbag2 import StoragePlugin
from ruamel.yaml import YAML

from studies.bags.bag_files import (
    SQLITE,
    VARIANTS,
    ZERO_NS,
    Message,
    S,
    drive,
    odometry,
    split,
    write,
    write_mcap,
)
from studies.bags.fuzz import read

DRIVE = drive()
ODOM = "nav_msgs/msg/Odometry"


def changed_metadata(bag, change):
    """Change what the metadata of a bag says."""
    yaml = YAML(typ="safe", pure=True)
    said = yaml.load((bag / "metadata.yaml").read_text())
    change(said["rosbag2_bagfile_information"])
    with (bag / "metadata.yaml").open("w") as file:
        yaml.dump(said, file)


def count_as(count, *names):
    """Make the metadata count so many messages of topics, of all when none is named."""

    def change(said):
        for entry in said["topics_with_message_count"]:
            if not names or entry["topic_metadata"]["name"] in names:
                entry["message_count"] = count

    return change


@pytest.mark.parametrize("variant", [name for name in VARIANTS if "mcap chunks" not in name])
def test_a_bag_without_metadata_reads_the_same(tmp_path, expected, variant):
    bag = VARIANTS[variant](tmp_path / "bag", DRIVE)
    if bag.is_dir():
        (bag / "metadata.yaml").unlink()
        events, notes = read(bag)
        assert events == expected
        assert notes == [
            f"{bag} has no metadata.yaml: the recording broke off or was copied in part."
        ]
        with Bag(bag) as opened:
            counts = {topic.name: topic.count for topic in opened.topics}
        assert counts["/scan"] == 20


def test_parts_without_metadata_come_in_the_order_of_their_times(tmp_path, expected):
    bag = split(tmp_path / "bag", DRIVE)
    (bag / "metadata.yaml").unlink()
    for old, new in (("part_0", "z"), ("part_2", "a")):
        (bag / f"{old}.mcap").rename(bag / f"{new}.mcap")
    assert read(bag)[0] == expected


def test_a_part_that_is_missing_is_named(tmp_path, expected):
    bag = split(tmp_path / "bag", DRIVE)
    (bag / "part_1.mcap").unlink()
    events, notes = read(bag)
    assert set(events) < set(expected)
    assert any("lacks part_1.mcap" in note for note in notes)
    assert any("of 20 messages of /scan could be read" in note for note in notes)


@pytest.mark.parametrize("text", ["", ":", "a: [", "{}", "rosbag2_bagfile_information: 3", "\0"])
def test_damaged_metadata_is_named_and_not_needed(tmp_path, expected, text):
    bag = write(tmp_path / "bag", DRIVE)
    (bag / "metadata.yaml").write_text(text)
    events, notes = read(bag)
    assert events == expected
    assert len(notes) == 1
    assert "metadata.yaml cannot be read" in notes[0]
    assert "\n" not in notes[0]


@pytest.mark.parametrize("variant", [name for name in VARIANTS if "mcap chunks" not in name])
def test_metadata_that_counts_nothing_is_not_believed(tmp_path, expected, variant):
    bag = VARIANTS[variant](tmp_path / "bag", DRIVE)
    if bag.is_dir():
        changed_metadata(bag, count_as(0))
    assert read(bag) == (expected, [])
    with Bag(bag) as opened:
        assert {topic.name: topic.count for topic in opened.topics}["/scan"] == 20


@pytest.mark.parametrize("variant", ["mcap", "sqlite", "mcap split", "sqlite split"])
@pytest.mark.parametrize("count", [0, 3])
def test_metadata_that_counts_too_little_of_one_topic_is_not_believed(
    tmp_path, expected, variant, count
):
    bag = VARIANTS[variant](tmp_path / "bag", DRIVE)
    changed_metadata(bag, count_as(count, "/scan"))
    assert read(bag) == (expected, [])
    with Bag(bag) as opened:
        assert {topic.name: topic.count for topic in opened.topics}["/scan"] == 20


def test_metadata_that_counts_more_than_the_files_hold_tells_of_a_loss(tmp_path, expected):
    bag = write(tmp_path / "bag", DRIVE)
    changed_metadata(bag, count_as(23, "/scan"))
    assert read(bag) == (expected, ["20 of 23 messages of /scan could be read."])


def test_files_that_do_not_count_are_taken_to_be_as_the_metadata_says(tmp_path, expected):
    bag = VARIANTS["mcap zstd file"](tmp_path / "bag", DRIVE)
    changed_metadata(bag, count_as(0, "/scan"))
    assert read(bag) == (expected, ["/scan holds 20 messages, none by metadata.yaml."])


def test_a_part_that_the_metadata_does_not_list_is_read_another_bag_is_not(tmp_path, expected):
    bag = split(tmp_path / "bag", DRIVE)
    changed_metadata(bag, lambda said: said["relative_file_paths"].remove("part_2.mcap"))
    shutil.copy(bag / "part_0.mcap", bag / "copy.mcap")
    events, notes = read(bag)
    assert events == expected
    assert notes == [f"{bag} holds copy.mcap, which its metadata.yaml does not list: left out."]


@pytest.mark.parametrize(
    "name", ["nav_msgs/Odometry", "nav_msgs::msg::Odometry", "nav_msgs::msg::dds_::Odometry_"]
)
@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, SQLITE])
def test_types_are_understood_however_they_are_named(tmp_path, storage, name):
    said = [Message("/odom", ODOM, ZERO_NS + n, odometry(S + n, float(n))) for n in range(3)]
    bag = write(tmp_path / "bag", said, storage)
    if storage is SQLITE:
        base = sqlite3.connect(bag / "bag.db3")
        base.execute("UPDATE topics SET type = ?", (name,))
        base.execute("UPDATE message_definitions SET topic_type = ?", (name,))
        base.commit()
        base.close()
    else:
        write_mcap(bag / "bag.mcap", said, names={ODOM: name})
    changed_metadata(
        bag, lambda told: told["topics_with_message_count"][0]["topic_metadata"].update(type=name)
    )
    with Bag(bag) as opened:
        assert [topic.type for topic in opened.topics] == [ODOM]
        assert [e.x for e in opened.events(assign(opened.topics))] == [0.0, 1.0, 2.0]
        assert list(opened.notes) == []
