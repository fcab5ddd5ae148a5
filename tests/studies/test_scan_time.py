"""The program that times the LiDAR node times estimates, and says so when there are none."""

import numpy as np
import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from studies.deploy import scan_time  # noqa: E402


def test_estimates_are_timed(ros_domain_id):
    found = scan_time.measure(scan_time.TimeConfig(n=40, rooms=1))
    assert (found["n"], found["judged"]) == (40, 1.0)
    assert 0 < found["p50"] <= found["p99"] <= found["max"]


def test_blind_estimates_are_no_measurement(ros_domain_id, monkeypatch):
    dark = [np.full(1080, np.inf, np.float32)] * (scan_time.WARM_UP + 40)
    monkeypatch.setattr(scan_time, "scans", lambda config: dark)
    with pytest.raises(RuntimeError, match="0% of the scans were judged, expected at least 80%"):
        scan_time.measure(scan_time.TimeConfig(n=40))
