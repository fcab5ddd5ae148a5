"""A robot's word that is lost on its way: real packets, dropped where a receive buffer is full."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest
from sim_bridge.faults.faults import RESENT_S

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from tests.ros.policy_graph import policy_graph  # noqa: E402

BY_UDP = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <transport_descriptors>
    <transport_descriptor>
      <transport_id>udp</transport_id>
      <type>UDPv4</type>
      <interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>
    </transport_descriptor>
  </transport_descriptors>
  <participant profile_name="by_udp" is_default_profile="true">
    <rtps>
      <userTransports><transport_id>udp</transport_id></userTransports>
      <useBuiltinTransports>false</useBuiltinTransports>
    </rtps>
  </participant>
</profiles>
"""
"""As between two machines; processes of one would share memory."""


def received(pid):
    """What waits in the process's UDP sockets and what they have dropped: bytes, packets."""
    files = [str(f.readlink()) for f in Path(f"/proc/{pid}/fd").iterdir()]
    own = {f.removeprefix("socket:[").rstrip("]") for f in files if f.startswith("socket:[")}
    rows = [line.split() for line in Path(f"/proc/{pid}/net/udp").read_text().splitlines()[1:]]
    return {r[9]: (int(r[4].partition(":")[2], 16), int(r[12])) for r in rows if r[9] in own}


def test_the_only_word_of_a_bump_is_delivered_though_its_packet_is_lost(
    tmp_path, ros_domain_id, make_bundle, monkeypatch
):
    (tmp_path / "udp.xml").write_text(BY_UDP)
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(tmp_path / "udp.xml"))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT")  # or shared memory again
    with policy_graph(tmp_path, ros_domain_id) as start:
        robot, process, _ = start(make_bundle("MoveAhead"))

        def way():
            """What the robot drives with one MoveAhead, m."""
            _, result = robot.result(robot.send(max_steps=1)[1])
            assert result.outcome == "step_limit", result.message
            return result.path_length

        assert way() > 0.1  # and the node hears everything
        process.send_signal(signal.SIGSTOP)
        looked = [received(process.pid)]

        def full():
            """Whether not even the smallest message fits in any more."""
            time.sleep(0.4)
            looked.append(received(process.pid))
            before, now = looked[-2:]
            return any(now[s][0] == before[s][0] and now[s][1] > before[s][1] + 8 for s in now)

        try:
            robot.wait(full, "a receive buffer to be full")
            robot.bumping = True
            robot.wait(lambda: robot.bump_told, "the bump to be told")
            assert full()
        finally:
            process.send_signal(signal.SIGCONT)
        end = time.monotonic() + 2 * RESENT_S
        while (driven := way()) > 0.05 and time.monotonic() < end:
            pass
        assert driven < 0.05  # a pressed bumper forbids it
