"""In which order the mock publishes, heard without ROS in between."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from sim_bridge.faults.robot_clock import RobotClock  # noqa: E402
from sim_bridge.faults.schedule import FaultSchedule  # noqa: E402
from sim_bridge.robot.simulator import Simulator  # noqa: E402
from sim_bridge.ros.broadcast import Broadcast  # noqa: E402
from sim_bridge.ros.parameters import MockParameters  # noqa: E402
from sim_bridge.ros.robot_node import CLOCK, SAID  # noqa: E402
from sim_bridge.world.world import World  # noqa: E402

from cfnav_core.robot.robot import Robot  # noqa: E402
from tests.sim.test_simulator import bare_room  # noqa: E402

TRUTH, RIVAL = "the truth", "the rival's scan"
ESTIMATE = "the true estimate"


def test_time_goes_out_before_everything_of_its_moment():
    sent = []

    def ear(name):
        return SimpleNamespace(publish=lambda message: sent.append(name))

    simulator = Simulator(World(bare_room()))
    simulator.place(1.0, 1.0, 0.0)
    stage = SimpleNamespace(
        simulator=simulator,
        noise=simulator.noise,
        goal_visible=lambda: False,
        picture=lambda dt: np.zeros((32, 32, 3), np.uint8),
    )
    robot = SimpleNamespace(out=SAID, say=lambda role, message: not sent.append(role))
    simulator_node = SimpleNamespace(truth=ear(TRUTH), estimate=ear(ESTIMATE))
    clock, parameters = RobotClock(), MockParameters()
    out = Broadcast(robot, simulator_node, stage, clock, FaultSchedule(), parameters, Robot())
    out.rival = SimpleNamespace(out={"scan_rival": ear(RIVAL)})
    heard = set()
    for _ in range(100):
        sent.clear()
        out.publish(simulator.step())
        # Without noise no message is under way for any time.
        assert sent[:1] == [CLOCK] * bool(sent)
        assert sent.count(CLOCK) <= 1
        heard |= set(sent)
    assert heard >= {CLOCK, TRUTH, ESTIMATE, RIVAL, "scan", "odom"}
