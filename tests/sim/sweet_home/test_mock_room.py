"""The mock's parameter ``room`` takes rooms with models."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")

from sim_bridge.ros.parameters import MockParameters
from sim_bridge.ros.stage import SimulatorStage

from tests.sim.sweet_home.rooms import little_home  # noqa: F401  (a fixture)

pytestmark = pytest.mark.ros
ROOM = "sweet_home.kitchen:300"


@pytest.mark.usefixtures("little_home")
def test_a_robot_stands_in_a_room_of_models_and_sees_it():
    stage = SimulatorStage(MockParameters(room=ROOM, depth=False))
    try:
        stage.put_robot()
        assert stage.world.room.name == ROOM
        assert stage.world.room.placed
        assert stage.picture(0.1).std() > 5
    finally:
        stage.close()


def test_a_room_of_what_comes_with_cfnav_needs_no_furniture(monkeypatch, tmp_path):
    monkeypatch.setenv("CFNAV_SWEET_HOME", str(tmp_path))
    stage = SimulatorStage(MockParameters(room="cc0.kitchen:25", depth=False))
    try:
        assert stage.world.room.placed
    finally:
        stage.close()


def test_without_the_furniture_the_mock_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setenv("CFNAV_SWEET_HOME", str(tmp_path))
    with pytest.raises(ValueError, match="apt install sweethome3d-furniture"):
        SimulatorStage(MockParameters(room=ROOM))
