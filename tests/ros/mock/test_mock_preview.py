"""The mock with the camera that a TurtleBot 4 is sold with, and with noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_ros.process.domains import Domain  # noqa: E402
from sim_bridge.room.room import generate_room, parse_room  # noqa: E402
from sim_bridge.world.camera import Camera  # noqa: E402
from sim_bridge.world.world import Pose, World  # noqa: E402

from cfnav_core.task.camera import CAMERAS  # noqa: E402
from tests.ros.mock_listener import ROOM, Listener, start_mock  # noqa: E402

IMAGE, INFO = "oakd/rgb/preview/image_raw", "oakd/rgb/preview/camera_info"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    with Domain() as domain:
        log = tmp_path_factory.mktemp("mock") / "log"
        process = start_mock(log, domain, f"room:={ROOM}", "camera:=stock_preview", "seed:=1")
        listener = Listener(domain)
        try:
            process.wait_for_line("ready")
            listener.wait_connected(tilt=False)
            listener.wait(lambda: len(listener.heard["scan"]) > 20, "scans")
            yield listener
        finally:
            listener.close()
            process.end()


def test_picture_and_its_intrinsics(robot):
    image, info = robot.last(IMAGE), robot.last(INFO)
    assert (image.encoding, image.is_bigendian, image.width, image.height) == ("bgr8", 1, 250, 250)
    assert math.degrees(2 * math.atan(info.width / 2 / info.k[0])) == pytest.approx(40.0)
    assert (info.k[2], info.k[5]) == (124.5, 124.5)


def test_picture_is_taken_from_the_bracket_and_noisy(robot):
    truth = robot.truth
    set_up = CAMERAS["stock_preview"]
    world = World(generate_room(*parse_room(ROOM)))
    with Camera(world, set_up) as camera:
        rgb = camera.rgb(Pose(truth.x, truth.y, truth.yaw)).astype(float)
    seen = np.frombuffer(robot.last(IMAGE).data, np.uint8).reshape(250, 250, 3)[..., ::-1]
    gain = (seen * rgb).sum() / (rgb * rgb).sum()
    assert gain == pytest.approx(1.0, abs=0.15)
    assert 0.8 < np.abs(seen - gain * rgb).mean() < 4
    others = [np.frombuffer(m.data, np.uint8) for m in robot.heard[IMAGE][-5:]]
    assert len({other.tobytes() for other in others}) == 5


def test_camera_does_not_tilt(robot):
    assert "camera_tilt" not in robot.last("joint_states").name
    assert robot.node.count_subscribers("camera_tilt/command") == 0
    children = {t.child_frame_id: t for t in robot.last("tf_static").transforms}
    assert "oakd_link" not in {t.child_frame_id for t in robot.last("tf").transforms}
    mount, shell = children["oakd_link"], children["shell_link"]
    assert mount.header.frame_id == "shell_link"
    height = mount.transform.translation.z + shell.transform.translation.z
    assert (mount.transform.translation.x, height) == pytest.approx((-0.06, 0.244))


def test_ranges_are_noisy_within_the_data_sheet(robot):
    scans = np.stack([np.array(m.ranges) for m in robot.heard["scan"][-10:]])
    returned = np.isfinite(scans).all(0)
    share = (scans[:, returned] / np.median(scans[:, returned], 0) - 1).std(0)
    assert np.median(share) == pytest.approx(0.003, rel=0.3)
