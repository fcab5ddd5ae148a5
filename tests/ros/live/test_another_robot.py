"""CONTRIBUTING's recipe "a robot", followed: one file, and everything speaks to that robot."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.bags.evaluation import evaluate  # noqa: E402
from cfnav_ros.process.graph_config import GraphConfig  # noqa: E402
from cfnav_ros.report.bag_eval import BagEvalConfig, options_of  # noqa: E402
from cfnav_ros.ros.graph import RosGraph  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402

from cfnav_core.robot.robot import SHIPPED  # noqa: E402
from cfnav_core.task.camera import MAST  # noqa: E402

OTHER_NAMES = """
  scan: front/laser
  odom: wheels/odometry
  cmd_vel: base/velocity
"""


def test_a_plain_base_under_other_names_drives_and_its_bag_is_judged(
    tmp_path: Path, ros_domain_id: int, eager_bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROS_DOMAIN_ID", "ROS_LOG_DIR"):  # the graph sets them
        monkeypatch.setenv(name, os.environ.get(name, ""))
    robot = tmp_path / "cart.yaml"
    own = (SHIPPED / "differential.yaml").read_text() + OTHER_NAMES
    robot.write_text(own.replace("camera/image_raw", "camera/image_raw/compressed"))
    camera = tmp_path / "camera.json"
    wide = replace(MAST, fov_deg=(2 * math.degrees(math.atan(4 / 3)), 90.0), size=(400, 300))
    camera.write_text(json.dumps(wide.to_json()))
    config = GraphConfig(
        "bathroom:20", tmp_path / "logs", bundle=eager_bundle, domain=ros_domain_id, robot=robot,
        bag=tmp_path / "bag", camera=str(camera),
    )  # fmt: skip
    with RosGraph(config) as graph:
        assert graph.start_episode("bathroom:20", "Sink", 0).ok
        outcome = graph.run_episode("bathroom:20", "Sink")
    assert (outcome.outcome, outcome.path_length_m > 0.1) == ("done", True)

    with AnyReader([config.bag]) as reader:
        found = {c.topic: (c.msgtype, c.msgcount) for c in reader.connections}
    for topic in (
        "camera/image_raw/compressed",
        "camera/camera_info",
        "front/laser",
        "wheels/odometry",
    ):
        assert found[f"/{topic}"][1] > 0
    assert found["/base/velocity"][0] == "geometry_msgs/msg/Twist"
    assert not {"/scan", "/cmd_vel", "/hazard_detection", "/dock_status"} & found.keys()

    robot.unlink()  # the bag has it
    options = options_of(BagEvalConfig((config.bag,), replay=False), config.bag)
    judged = evaluate(config.bag, options)
    assert judged.roles["scan"] == "/front/laser"
    (drive,) = judged.drives
    assert drive.outcome.path_length_m.value == pytest.approx(outcome.path_length_m, abs=0.1)
