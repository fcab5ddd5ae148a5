"""A bag says which robot drove and how, and is judged, played and learnt from as that one's."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.recorded_robot import (
    FILE,
    NAME,
    PARAMETERS,
    recorded_robot,
    robot_for,
    said_of,
    told_of,
)
from cfnav_ros.bags.files.writer import BagWriter, typestore_with
from cfnav_ros.report import bag_eval
from cfnav_ros.report.bag_eval import BagEvalConfig, options_of

from cfnav_core.policy.bundle import shipped_bundle
from cfnav_core.robot.robot import SHIPPED, load_robot


def bag_of(path: Path, custom: dict[str, str]) -> Path:
    writer = BagWriter(path, typestore_with([]), custom)
    writer.add_topic("/scan", "sensor_msgs/msg/LaserScan")
    writer.close()
    return path


def test_a_robot_of_one_s_own_is_known_where_its_file_is_not(tmp_path: Path) -> None:
    file = tmp_path / "cart.yaml"
    file.write_text((SHIPPED / "differential.yaml").read_text() + "  scan: front/laser\n")
    robot = load_robot(file)
    bag = bag_of(tmp_path / "bag", said_of(robot))
    file.unlink()
    assert recorded_robot(bag) == robot
    assert recorded_robot(bag).name == "cart"
    with Bag(bag) as opened:
        assert robot_for(opened, "") == robot
        assert robot_for(opened, "turtlebot4").name == "turtlebot4"

    options = options_of(BagEvalConfig((bag,), replay=False, topic=("odom:=o",)), bag)
    assert (options.robot, options.mount_given) == (robot, True)
    assert options.topics == {"image": "camera/image_raw", "scan": "front/laser", "odom": "o"}
    assert options.lidar.disc.radius == robot.radius


def test_the_bundle_of_the_robot_that_drove_is_replayed(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", said_of(load_robot("turtlebot4")))
    options = options_of(BagEvalConfig((bag,)), bag)
    assert options.bundles == {"turtlebot4": "turtlebot4"}
    named = options_of(BagEvalConfig((bag,), robot="turtlebot4_mast"), bag)
    assert (named.bundles, named.robot.name) == ({"default": "default"}, "turtlebot4_mast")


def test_a_drive_is_judged_by_what_its_nodes_were_told(tmp_path: Path) -> None:
    told = {
        "policy_node": {
            "bundle": "boxes", "detections.labels": "voc", "episode.p_hat": "lidar",
            "room_type": "kitchen", "wings": 2,  # of a newer cfnav, and nothing to judge by
        },
        "lidar_collision_node": {"stale": 0.6},
    }  # fmt: skip
    bag = bag_of(tmp_path / "bag", said_of(load_robot("turtlebot4")) | told_of(told))
    options = options_of(BagEvalConfig((bag,)), bag)
    assert (options.bundles, options.robot.name) == ({"boxes": "boxes"}, "turtlebot4")
    assert (options.detections.labels, options.room_type) == ("voc", "kitchen")
    assert options.lidar.stale == 0.6
    # what is given goes before all of it
    file = tmp_path / "robot.yaml"
    file.write_text("policy_node: {ros__parameters: {detections: {labels: coco_ids}}}")
    given = options_of(BagEvalConfig((bag,), params=file), bag)
    assert (given.detections.labels, given.room_type) == ("coco_ids", "")
    robot = options_of(BagEvalConfig((bag,), robot="turtlebot4"), bag)
    assert (robot.bundles, robot.detections.labels) == ({"turtlebot4": "turtlebot4"}, "coco")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("policy_node: {ros__parameters: {episode: {wings: 2}}}", "episode.wings"),
        ("[", "cannot be read"), ("none", "holds no ROS parameters"),
    ],
)  # fmt: skip
def test_parameters_in_a_bag_that_are_of_no_use_are_one_sentence(tmp_path, text, said) -> None:
    bag = bag_of(tmp_path / "bag", {PARAMETERS: text})
    with pytest.raises(ValueError, match=rf"nodes of .*bag were told .*{said}.*; name the robot"):
        options_of(BagEvalConfig((bag,)), bag)
    assert options_of(BagEvalConfig((bag,), robot="turtlebot4"), bag).robot.name == "turtlebot4"


def test_a_bag_of_another_recorder_says_nothing(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", {"recorder": "another"})
    assert recorded_robot(bag) is None
    assert robot_for(bag, "").name == "turtlebot4_mast"
    assert not options_of(BagEvalConfig((bag,), replay=False), bag).mount_given


def test_where_the_lidar_sat_is_said_by_a_robot_and_not_by_what_its_node_was_told(
    tmp_path: Path,
) -> None:
    told = told_of({"lidar_collision_node": {"disc.mount_x": -0.04}})
    bare = BagEvalConfig((), replay=False)
    assert not options_of(bare, bag_of(tmp_path / "bag", told)).mount_given
    named = bag_of(tmp_path / "named", told | said_of(load_robot("turtlebot4")))
    assert options_of(bare, named).mount_given


def test_bundles_of_several_bags_have_names_that_tell_them_apart(tmp_path: Path) -> None:
    folders = [tmp_path / side / "bundle" for side in "ab"]
    for folder in folders:
        shutil.copytree(shipped_bundle(), folder)
    told = [told_of({"policy_node": {"bundle": str(of)}}) for of in (*folders, "default", "gone")]
    bags = [bag_of(tmp_path / f"bag{k}", of) for k, of in enumerate(told)]
    options, unable, (lacking,) = bag_eval._options(BagEvalConfig(()), bags)
    assert not unable
    assert [[*of.bundles] for of in options.values()] == [
        ["a/bundle"], ["b/bundle"], ["bundles/default"], []
    ]  # fmt: skip
    assert "bag3 is judged without a replay: found no" in lacking


def test_labels_that_are_not_here_leave_a_bag_without_a_replay(tmp_path: Path) -> None:
    told = {"bundle": "boxes", "detections.labels": "/gone/labels.txt"}
    bag = bag_of(
        tmp_path / "bag", said_of(load_robot("turtlebot4")) | told_of({"policy_node": told})
    )
    options, unable, (lacking,) = bag_eval._options(BagEvalConfig(()), [bag])
    assert (options[bag].bundles, unable) == ({}, [])
    assert "labels" in lacking


@pytest.mark.parametrize("said", ["", "camera: [", "- 1", "height: high"])
def test_a_robot_s_file_that_is_of_no_use_is_one_sentence(tmp_path: Path, said: str) -> None:
    bag = bag_of(tmp_path / "bag", {NAME: "cart", FILE: said})
    with pytest.raises(ValueError, match=r"bag was recorded on the robot cart, whose file in "):
        robot_for(bag, "")
    assert robot_for(bag, "turtlebot4").name == "turtlebot4"
    named = BagEvalConfig((bag,), robot="turtlebot4", replay=False)
    assert options_of(named, bag).robot.name == "turtlebot4"


def test_one_bag_that_cannot_be_judged_leaves_the_others_whole(
    tmp_path: Path,
) -> None:
    bag_of(tmp_path / "newer", {NAME: "cart", FILE: "height: high"})
    text = (SHIPPED / "turtlebot4.yaml").read_text()
    moved = {NAME: "cart", FILE: text.replace("bundle: turtlebot4", "bundle: bundles/mine")}
    assert moved[FILE] != text
    bag_of(tmp_path / "moved", moved)
    options, unable, lacking = bag_eval._options(
        BagEvalConfig(()), [tmp_path / "newer", tmp_path / "moved"]
    )
    assert [*options] == [tmp_path / "moved"]
    assert not options[tmp_path / "moved"].bundles
    assert "newer was recorded on the robot cart, whose file in the bag is of no use" in unable[0]
    assert "moved is judged without a replay: found no" in lacking[0]
