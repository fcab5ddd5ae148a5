"""A robot's parameter file, read without ROS."""

from __future__ import annotations

from pathlib import Path

import pytest
from cfnav_ros.bags.files.parameters_file import ParametersError, RobotParameters, read_parameters
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.lidar.scan_watch import LidarParameters

from tests.conftest import ROOT

CONFIG = ROOT / "ros_ws/src/cfnav_bringup/config"


def read(folder: Path, text: str) -> RobotParameters:
    path = folder / "robot.yaml"
    path.write_text(text)
    return read_parameters(path)


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_file_that_is_shipped_is_understood(path: Path) -> None:
    assert isinstance(read_parameters(path), RobotParameters)


def test_values_reach_their_places(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        "/**/policy_node:\n"
        "  ros__parameters:\n"
        "    robot: turtlebot4_lite\n"
        "    tilt_joint: neck\n"
        "    episode: {veto_probability: 0.25, ages: {frame: 2}}\n"
        "lidar_collision_node:\n"
        "  ros__parameters:\n"
        "    frame: ''\n"
        "    disc.radius: 0.3\n"
        "nobody: 7\n",
    )
    assert (found.robot.name, found.policy.tilt_joint) == ("turtlebot4_lite", "neck")
    assert not found.policy.episode.has_tilt
    assert found.policy.episode.veto_probability == 0.25
    assert found.policy.episode.ages.frame == 2.0
    assert found.policy.episode.max_steps == PolicyParameters().episode.max_steps
    assert (found.lidar.frame, found.lidar.disc.radius) == ("", 0.3)
    assert (found.lidar.disc.mount_x, found.mount_given) == (0.0039, True)


def test_without_a_file_the_robot_tells_and_it_outdoes_the_file(tmp_path: Path) -> None:
    assert read_parameters(None).policy == PolicyParameters()
    assert not read_parameters(None).mount_given
    assert read_parameters(None, "differential").lidar.mount == "tf"
    path = tmp_path / "robot.yaml"
    path.write_text(
        "/**: {ros__parameters: {robot: turtlebot4}}\npolicy_node: {ros__parameters: {}}"
    )
    assert read_parameters(path).robot.name == "turtlebot4"
    assert read_parameters(path, "turtlebot4_mast").policy.episode.has_tilt


def test_a_mounting_counts_as_given(tmp_path: Path) -> None:
    text = "/r1/lidar_collision_node: {ros__parameters: {disc: {mount_yaw_deg: 90.0}}}"
    found = read(tmp_path, text)
    assert found.mount_given
    assert found.policy == PolicyParameters()


def test_what_holds_for_every_node_holds_and_may_be_strange(tmp_path: Path) -> None:
    text = "/**: {ros__parameters: {use_sim_time: true, stale: 0.7, of_another_node: 3}}"
    found = read(tmp_path, text)
    assert found.lidar == LidarParameters(stale=0.7)
    text += "\n/**/lidar_collision_node: {ros__parameters: {stale: 0.9}}"
    assert read(tmp_path, text).lidar.stale == 0.9


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "holds no ROS parameters, expected names of nodes"),
        ("[1, 2", "cannot be read: "),
        ("other_node: {ros__parameters: {a: 1}}", "has no parameters of policy_node or lidar_"),
        ("policy_node: {veto: 1}", "policy_node has no ros__parameters below it"),
        ("policy_node: {ros__parameters: {vetoes: 1}}", "There is no parameter 'vetoes'"),
        ("policy_node: {ros__parameters: {rate: fast}}", "rate is 'fast', expected float"),
        ("policy_node: {ros__parameters: {rate: 900}}", "rate is 900.0, expected 4 to 100"),
        ("lidar_collision_node: {ros__parameters: {mount: glue}}", "mount is 'glue', expected"),
        (
            "policy_node: {ros__parameters: {robot: tank}}",
            "robot is 'tank', expected a file or one",
        ),
        (
            "policy_node: {ros__parameters: {robot: a}}\n"
            "lidar_collision_node: {ros__parameters: {robot: b}}",
            "it names two robots (a, b)",
        ),
        (
            "/a/policy_node: {ros__parameters: {}}\n/b/policy_node: {ros__parameters: {}}",
            "has parameters of 2 nodes (/a/policy_node, /b/policy_node)",
        ),
    ],
)
def test_a_file_of_no_use_gives_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(ParametersError) as caught:
        read(tmp_path, text)
    assert sentence in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "robot.yaml"))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_missing_gives_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ParametersError, match=r"cannot be read: .*No such file"):
        read_parameters(tmp_path / "none.yaml")
