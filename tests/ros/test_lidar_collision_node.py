"""The LiDAR collision node as a process: scans in, estimates out, silence and bad scans BLIND."""

import math
import os
import signal
import subprocess
import sys
import time
from array import array

import numpy as np
import pytest
from cfnav_ros.lidar import Scan, SweptDisc, Verdict, estimate_collision
from cfnav_ros.scan_watch import ScanWatch

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_interfaces.msg import CollisionEstimate  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sensor_msgs.msg import LaserScan  # noqa: E402

DEADLINE_S = 60.0


def room_scan(ahead=3.0):
    """1080 ranges as the A1 driver sends them: a wall ahead (base frame), 3 m elsewhere."""
    angle_min, angle_max = -3.12414, math.pi
    increment = (angle_max - angle_min) / 1079
    bearing = angle_min + (np.arange(360) * 3 + 1) * increment + math.pi / 2
    forward = np.maximum(np.cos(bearing), 0.05)
    ranges = np.minimum((ahead + 0.04) / forward, 3.0 + 0.1 * np.sin(bearing))
    ranges = np.repeat(ranges.astype(np.float32), 3)
    return Scan(ranges, angle_min, angle_max, increment, 0.15, 12.0)


# In time, without ROS


def test_a_fresh_scan_is_judged():
    watch = ScanWatch(0.4, SweptDisc())
    assert watch.scan(10.1, 10.0, room_scan()) == estimate_collision(room_scan())
    assert watch.silence(10.35) is None


def test_silence_is_blind():
    watch = ScanWatch(0.4, SweptDisc())
    assert watch.silence(5.0).reason == "No scan has arrived."
    watch.scan(10.0, 10.0, room_scan())
    blind = watch.silence(10.5)
    assert (blind.verdict, blind.probability, blind.clearance) == (Verdict.BLIND, 1.0, 0.0)
    assert blind.reason == "The newest scan is 0.50 s old."
    assert watch.scan(10.6, 10.55, room_scan()).verdict is Verdict.GOOD
    assert watch.silence(10.7) is None


@pytest.mark.parametrize("late", [0.5, 1.0, 5.0])
def test_a_late_scan_is_blind(late):
    assert ScanWatch(0.4, SweptDisc()).scan(10.0, 10.0 - late, room_scan()).verdict is Verdict.BLIND


def test_a_scan_from_the_future_is_blind():
    watch = ScanWatch(0.4, SweptDisc())
    estimate = watch.scan(10.0, 12.0, room_scan())
    assert estimate.reason == "The scan is stamped 2.0 s in the future."
    assert watch.silence(10.0) is not None  # it does not count as seen


def test_a_repeated_stamp_is_no_new_scan():
    watch = ScanWatch(0.4, SweptDisc())
    watch.scan(10.0, 10.0, room_scan())
    assert watch.scan(10.1, 10.0, room_scan()) is None
    assert watch.scan(10.1, 9.9, room_scan()) is None
    assert watch.silence(10.5) is not None


def test_a_clock_that_starts_again_is_followed():
    watch = ScanWatch(0.4, SweptDisc())
    watch.scan(100.0, 100.0, room_scan())
    assert watch.scan(1.0, 1.0, room_scan()).verdict is Verdict.GOOD


# As a process


class Lidar:
    """Sends scans and keeps the estimates, from another node in the domain."""

    def __init__(self, domain):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node("rplidar", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard = []
        self.scans = self.node.create_publisher(LaserScan, "scan", 10)
        self.node.create_subscription(CollisionEstimate, "collision/estimate", self.heard.append, 5)

    def send(self, scan):
        message = LaserScan(range_min=scan.range_min, range_max=scan.range_max)
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.header.frame_id = "rplidar_link"
        message.angle_min, message.angle_max = scan.angle_min, scan.angle_max
        message.angle_increment = scan.angle_increment
        message.ranges = array("f", scan.ranges.astype(np.float32).tobytes())
        self.scans.publish(message)
        return message.header.stamp

    def wait(self, condition, what):
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, f"waited in vain: {what}"
            self.executor.spin_once(timeout_sec=0.05)

    def ask(self, scan):
        """The estimate of one scan."""
        stamp = self.send(scan)
        answers = lambda: [m for m in self.heard if m.header.stamp == stamp]  # noqa: E731
        self.wait(answers, "the estimate of a scan")
        return answers()[0]

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def start(domain, folder, *parameters):
    command = [sys.executable, "-m", "cfnav_ros.lidar_collision_node", "--ros-args"]
    for parameter in parameters:
        command += ["-p", parameter]
    env = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_PYTHON_CHECK_FIELDS": "1",
    }
    with (folder / "log").open("w") as log:
        return subprocess.Popen(command, env=env, stdout=log, stderr=log)


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    process, lidar = start(ros_domain_id, tmp_path), Lidar(ros_domain_id)
    try:
        lidar.wait(lambda: lidar.heard and lidar.scans.get_subscription_count(), "the node")
        yield lidar, process, tmp_path / "log"
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        lidar.close()


def test_the_node(graph):
    lidar, process, log = graph
    assert lidar.heard[0].verdict == CollisionEstimate.BLIND  # before the first scan
    assert lidar.heard[0].reason == "No scan has arrived."

    for ahead in (0.3, 1.0):
        message, expected = lidar.ask(room_scan(ahead)), estimate_collision(room_scan(ahead))
        assert message.probability == pytest.approx(expected.probability, abs=1e-5)
        assert message.clearance == pytest.approx(expected.clearance, abs=1e-5)
        assert (message.verdict, message.reason) == (CollisionEstimate.GOOD, "")
        assert message.known_fraction == pytest.approx(expected.known_fraction)
        assert message.header.frame_id == "base_link"

    for value in (math.inf, math.nan):
        scan = room_scan()
        scan.ranges[:] = value
        message = lidar.ask(scan)
        assert (message.verdict, message.probability) == (CollisionEstimate.BLIND, 1.0)
        assert message.clearance == 0.0
    scan = room_scan()
    empty = Scan(scan.ranges[:0], *(getattr(scan, f) for f in list(vars(scan))[1:]))
    assert lidar.ask(empty).reason == "The scan holds 0 ranges, expected at least 2."
    assert lidar.ask(room_scan()).verdict == CollisionEstimate.GOOD

    # Silence: from 0.4 s on BLIND, ten times a second.
    del lidar.heard[:]
    lidar.wait(lambda: len(lidar.heard) >= 6, "BLIND during silence")
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in lidar.heard]
    assert all(m.verdict == CollisionEstimate.BLIND for m in lidar.heard)
    assert all("s old." in m.reason for m in lidar.heard)
    assert np.median(np.diff(stamps)) == pytest.approx(0.1, abs=0.05)
    assert lidar.ask(room_scan()).verdict == CollisionEstimate.GOOD

    process.send_signal(signal.SIGINT)
    assert process.wait(DEADLINE_S) == 0
    assert "Traceback" not in log.read_text()


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ("disc.radius:=-1.0", "radius is -1.0, expected a positive number."),
        ("stael:=1.0", "There is no parameter 'stael'; there are stale,"),
    ],
)
def test_a_bad_parameter_gives_one_sentence_and_exit_code_2(
    tmp_path, ros_domain_id, parameter, sentence
):
    process = start(ros_domain_id, tmp_path, parameter)
    assert process.wait(DEADLINE_S) == 2
    lines = (tmp_path / "log").read_text().strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"lidar_collision_node: {sentence}")
