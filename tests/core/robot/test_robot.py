"""A robot is what its file says; a bad file is one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.lidar.scan_watch import LidarParameters

from cfnav_core.robot.robot import SHIPPED, load_robot, robots
from cfnav_core.robot.topics import COMPRESSED, RAW, TOPICS, UNSTAMPED, camera_info
from tests.conftest import ROOT

PLAIN = (SHIPPED / "differential.yaml").read_text()


def test_the_paper_s_robot_is_what_the_nodes_are_for_unless_told_otherwise() -> None:
    robot = load_robot()
    assert robot.topics == TOPICS
    assert PolicyParameters.of(robot) == PolicyParameters()
    assert LidarParameters.of(robot) == LidarParameters()


@pytest.mark.parametrize("name", robots())
def test_every_robot_that_is_shipped_can_be_driven(name: str) -> None:
    robot = load_robot(name)
    assert robot.name == name
    assert PolicyParameters.of(robot).episode.has_tilt is (name == "turtlebot4_mast")
    assert LidarParameters.of(robot).disc.radius == robot.radius
    assert ("tilt_command" in robot.topics) is robot.tilts


def test_a_plain_base_has_neither_bumper_nor_dock_and_takes_twist() -> None:
    robot = load_robot("differential")
    lacking = {"hazards", "dock_status", "wheel_status", "tilt_command", "depth", "depth_info"}
    assert not lacking & robot.topics.keys()
    velocity = robot.topics["cmd_vel"]
    assert (velocity.type, velocity.other_type) == (UNSTAMPED, "")
    assert robot.topics["camera_info"].name == "camera/camera_info"
    assert camera_info("image") == "camera_info"
    assert robot.topics["image"].type == RAW
    assert robot.topics["estimate"] == TOPICS["estimate"]


def read(folder: Path, *changes: tuple[str, str]) -> None:
    text = PLAIN
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    (folder / "mine.yaml").write_text(text)
    load_robot(folder / "mine.yaml")


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        (PLAIN, "[1, 2", "cannot be read: "),
        (PLAIN, "7", "it describes no robot, expected names and values."),
        ("radius: 0.2 ", "# ", "it does not say radius: add that."),
        ("mount: tf ", "mount: auto ", "it does not say lidar.x, lidar.y, lidar.yaw_deg: add that"),
        ("mount: tf ", "mount: glue ", "lidar.mount is 'glue', expected auto, tf, parameters."),
        ("unstamped ", "both ", "cmd_vel_type is 'both', expected auto, stamped, unstamped."),
        ("radius: 0.2 ", "radius: 7.0 ", "radius is 7.0, expected 0.01 to 1."),
        ("radius: 0.2 ", "radius: wide ", "radius is 'wide', expected float, such as 0.175."),
        ("mast_height", "mast_hight", "There is no parameter 'mast_hight'; there are bundle,"),
        ("  hazards: null ", "  hazard: null ", "topics has 'hazard', expected roles: image, "),
        ("  hazards: null ", "  hazards: 3 ", "topics.hazards is 3, expected a name, or null"),
        ("image: camera/image_raw ", "scan: null ", "topics.scan is null, but nothing can be"),
    ],
)
def test_a_file_of_no_use_is_one_sentence(
    tmp_path: Path, before: str, after: str, sentence: str
) -> None:
    with pytest.raises(ValueError, match=r"mine\.yaml") as caught:
        read(tmp_path, (before, after))
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_pictures_are_compressed_where_their_topic_says_so(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    text = (SHIPPED / "differential.yaml").read_text()
    file.write_text(text.replace("camera/image_raw", "camera/image_raw/compressed"))
    topics = load_robot(file).topics
    assert topics["image"].type == COMPRESSED
    assert topics["camera_info"].name == "camera/camera_info"


def test_a_camera_that_tilts_needs_somebody_who_measures_it(tmp_path: Path) -> None:
    tilting = ('tilt_joint: "" ', "tilt_joint: neck\n# ")
    read(tmp_path, tilting)
    with pytest.raises(ValueError, match=r"topics\.joint_states is null, but nothing can be"):
        read(tmp_path, tilting, ("  hazards: null ", "  joint_states: null "))


def test_the_calibration_of_depth_lies_beside_its_pictures(tmp_path: Path) -> None:
    read(tmp_path, ("  depth: null ", "  depth: front/depth/image_rect "))
    robot = load_robot(tmp_path / "mine.yaml")
    assert robot.topics["depth"].name == "front/depth/image_rect"
    assert robot.topics["depth_info"].name == "front/depth/camera_info"
    assert LidarParameters.of(robot).depth.mast_height == 0.0


def test_a_robot_that_is_not_there_is_one_sentence() -> None:
    with pytest.raises(ValueError, match="robot is 'tank', expected a file or one of differ"):
        load_robot("tank")


def test_the_page_of_interfaces_names_every_topic() -> None:
    text = (ROOT / "docs/interfaces.md").read_text().partition("## Topics")[2].partition("\n## ")[0]
    unnamed = {topic.name for topic in TOPICS.values() if f"`{topic.name}`" not in text}
    assert unnamed == {"/rosout", "oakd/rgb/preview/camera_info"}  # everybody's; `.../camera_info`
