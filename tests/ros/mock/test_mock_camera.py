"""Which camera the mock has."""

from dataclasses import replace
from pathlib import Path

import pytest
from cfnav_ros.drive.camera_watch import fitting
from sim_bridge.ros.parameters import MockParameters

from cfnav_core.policy.bundle import BundleHead, find_bundle
from cfnav_core.robot.robot import load_robot, robots
from cfnav_core.task.camera import CAMERAS, CameraSetUp
from cfnav_core.task.pinhole import Pinhole


@pytest.mark.parametrize("name", robots())
def test_a_robot_has_a_camera_that_its_bundle_can_drive_by(name: str) -> None:
    head = BundleHead.load(find_bundle(load_robot(name).bundle))
    camera = MockParameters(robot=name).set_up
    assert camera == CameraSetUp.read(load_robot(name).camera)
    assert head.camera
    assert fitting(head.camera, Pinhole.of(camera))


def test_the_camera_can_be_chosen(tmp_path: Path) -> None:
    assert MockParameters(robot="turtlebot4", camera="mast").set_up == CAMERAS["mast"]
    chosen = MockParameters(robot="turtlebot4_mast", camera_size=150)
    assert chosen.set_up == replace(CAMERAS["mast"], size=(150, 150))
    file = tmp_path / "mine.yaml"
    file.write_text(Path("cfnav_core/robot/robots/differential.yaml").read_text().replace(
        "camera: mast", "camera: periscope"
    ))  # fmt: skip
    with pytest.raises(ValueError, match="expected mast, stock_preview"):
        MockParameters(robot=str(file))
