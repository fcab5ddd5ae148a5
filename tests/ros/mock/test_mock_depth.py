"""The mock's stereo camera, and the LiDAR node that hears it, as processes."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_ros.process.domains import Domain  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image  # noqa: E402
from sim_bridge.robot import stereo  # noqa: E402
from sim_bridge.room.room import generate_room, parse_room  # noqa: E402
from sim_bridge.world.camera import Camera  # noqa: E402
from sim_bridge.world.world import Pose, World  # noqa: E402

from cfnav_core.robot.robot import SHIPPED  # noqa: E402
from cfnav_core.task.camera import CAMERAS  # noqa: E402
from tests.ros.mock_listener import ROOM, Listener, start_mock  # noqa: E402
from tests.ros.policy_graph import end, start_node  # noqa: E402


def test_depth_from_the_camera_to_the_estimate(tmp_path):
    with Domain() as domain:
        mock = start_mock(
            tmp_path / "mock", domain, f"room:={ROOM}", "depth:=true", "depth_down_deg:=65.0"
        )
        listener = Listener(domain)
        pictures, calibrations, told = [], [], []
        node = listener.node
        node.create_subscription(Image, "oakd/stereo/image_raw", pictures.append, 5)
        node.create_subscription(CameraInfo, "oakd/stereo/camera_info", calibrations.append, 5)
        node.create_subscription(DiagnosticArray, "/diagnostics", told.append, 5)
        program = ("-m", "cfnav_ros.ros.lidar_collision_node")
        lidar = start_node(domain, tmp_path / "lidar", "use_sim_time:=true", program=program)
        try:
            mock.wait_for_line("ready")
            listener.wait(lambda: pictures and calibrations, "depth")
            look_at(pictures[-1], calibrations[-1], listener)

            def depth_says(words):
                rows = [row for array in told for row in array.status if "depth" in row.name]
                return rows and words in rows[-1].message

            listener.wait(lambda: depth_says("Depth sees."), "the node that sees by depth")
            assert "Depth sees." in (tmp_path / "lidar").read_text()
        finally:
            end(lidar)
            listener.close()
            mock.end()


def test_the_points_of_a_robot_whose_file_names_points(tmp_path):
    file = tmp_path / "points.yaml"
    shipped = (SHIPPED / "turtlebot4_mast.yaml").read_text()
    file.write_text(f"{shipped}topics: {{depth: depth_camera/points}}")
    with Domain() as domain:
        robot = f"robot:={file}"
        mock = start_mock(
            tmp_path / "mock", domain, f"room:={ROOM}", robot, "depth:=true", "depth_down_deg:=65.0"
        )
        listener = Listener(domain)
        told = []
        listener.node.create_subscription(DiagnosticArray, "/diagnostics", told.append, 5)
        program = ("-m", "cfnav_ros.ros.lidar_collision_node")
        lidar = start_node(domain, tmp_path / "lidar", "use_sim_time:=true", robot, program=program)
        try:
            mock.wait_for_line("ready")

            def sees():
                rows = [row for array in told for row in array.status if "depth" in row.name]
                return rows and rows[-1].message == "Depth sees."

            listener.wait(sees, "the node that sees by points")
        finally:
            end(lidar)
            listener.close()
            mock.end()


def look_at(picture, calibration, listener):
    """A depth picture against the room that it is taken of."""
    assert (picture.encoding, picture.is_bigendian, picture.step) == ("16UC1", 0, 640)
    assert picture.header.frame_id == calibration.header.frame_id
    assert calibration.k[0] == pytest.approx(stereo.FOCAL_PX / 2)
    seen = np.frombuffer(picture.data, "<u2").reshape(200, 320) / 1000
    truth, world = listener.truth, World(generate_room(*parse_room(ROOM)))
    set_up = stereo.set_up_of(CAMERAS["mast"], 65.0)
    with Camera(world, set_up) as camera:
        _, depth = camera.depth(Pose(truth.x, truth.y, truth.yaw, set_up.horizons[0]))
    known = seen > 0
    assert 0.02 < known.mean() < 1.0
    assert np.median(np.abs(seen - depth)[known] / depth[known] ** 2) < 0.02
