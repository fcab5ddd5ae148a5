"""The LiDAR collision node as a process: scans in, estimates out, silence and bad scans BLIND."""

import dataclasses
import itertools
import math
import signal
import time
from array import array

import numpy as np
import pytest
from cfnav_ros.lidar.estimate import OTHERS, estimate_collision
from cfnav_ros.lidar.scan_watch import GRAPH_S

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_interfaces.msg import CollisionEstimate  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import TransformStamped  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import LaserScan  # noqa: E402
from tf2_msgs.msg import TFMessage  # noqa: E402

from tests.conftest import DEADLINE_S, wait_until  # noqa: E402
from tests.ros.lidar_scans import TURN_S, behind_posts, noisy, scan_of, wall_ahead  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402
from tests.ros.policy_graph import end, end_with, start_node  # noqa: E402


def room_scan(ahead=2.5):
    """A wall ahead (base frame), 3 m elsewhere, behind the robot's own posts."""
    return behind_posts(scan_of(wall_ahead(ahead)))


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


RNG = np.random.default_rng(0)


def live(ahead=2.5):
    """The room again, with other errors: ranges that stay the same are no sight."""
    return noisy(room_scan(ahead), RNG)


class Lidar(OwnNode):
    """Sends scans and keeps the estimates."""

    def __init__(self, domain):
        super().__init__(domain, "rplidar")
        self.heard, self.told = [], []
        self.scans = self.node.create_publisher(LaserScan, "scan", 10)
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.transforms = self.node.create_publisher(TFMessage, "tf_static", latched)
        self.node.create_subscription(CollisionEstimate, "collision/estimate", self.heard.append, 5)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.told.append, 5)

    def send(self, scan, stamp=None, publisher=None):
        message = LaserScan(range_min=scan.range_min, range_max=scan.range_max)
        message.header.stamp = stamp or self.node.get_clock().now().to_msg()
        message.header.frame_id = scan.frame
        message.angle_min, message.angle_max = scan.angle_min, scan.angle_max
        message.angle_increment, message.scan_time = scan.angle_increment, scan.scan_time
        message.ranges = array("f", scan.ranges.astype(np.float32).tobytes())
        (publisher or self.scans).publish(message)
        return message.header.stamp

    def transform(self, yaw):
        """Says on TF how rplidar_link is turned on base_link."""
        stamped = TransformStamped(child_frame_id="rplidar_link")
        stamped.header.frame_id = "base_link"
        stamped.transform.translation.x = -0.04
        stamped.transform.rotation.z = math.sin(yaw / 2)
        stamped.transform.rotation.w = math.cos(yaw / 2)
        self.transforms.publish(TFMessage(transforms=[stamped]))

    def ask(self, scan):
        """The estimate of one scan, sent again when a busy machine delivers it too late."""
        sent, answers = [], []

        def answered():
            if not sent or time.monotonic() > sent[-1][1] + 3.0:
                sent.append((self.send(scan), time.monotonic()))
            answers[:] = [m for m in self.heard if m.header.stamp == sent[-1][0]]
            return answers

        self.wait(answered, "the estimate of a scan")
        return answers[0]


def start(domain, folder, *parameters):
    program = ("-m", "cfnav_ros.ros.lidar_collision_node")
    return start_node(domain, folder / "log", *parameters, program=program)


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    process, lidar = start(ros_domain_id, tmp_path), Lidar(ros_domain_id)
    try:
        lidar.wait(lambda: lidar.heard and lidar.scans.get_subscription_count(), "the node")
        yield lidar, process, tmp_path / "log"
    finally:
        end(process)
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
        assert [other.motion for other in message.others] == list(OTHERS)
        assert message.others[2].clearance == pytest.approx(expected.others[2].clearance, abs=1e-5)

    for value in (math.inf, math.nan):
        scan = room_scan()
        scan.ranges[:] = value
        message = lidar.ask(scan)
        assert (message.verdict, message.probability) == (CollisionEstimate.BLIND, 1.0)
        assert message.clearance == 0.0
    scan = room_scan()
    empty = dataclasses.replace(scan, ranges=scan.ranges[:0])
    assert lidar.ask(empty).reason == "The scan holds 0 ranges, expected 2 to 20000."
    assert lidar.ask(room_scan()).verdict == CollisionEstimate.GOOD

    # Silence: from 0.4 s on BLIND, ten times a second; a busy machine is late, but not always.
    del lidar.heard[:]

    def told():
        return list(itertools.dropwhile(lambda m: "s old." not in m.reason, lidar.heard))

    def told_in_time():
        stamps = [seconds(m.header.stamp) for m in told()[-6:]]
        return len(stamps) == 6 and np.median(np.diff(stamps)) == pytest.approx(0.1, abs=0.05)

    lidar.wait(told_in_time, "BLIND during silence")
    assert all(m.verdict == CollisionEstimate.BLIND for m in told())
    assert all("s old." in m.reason for m in told())
    assert lidar.ask(live()).verdict == CollisionEstimate.GOOD

    assert end_with(process, signal.SIGINT) == 0
    assert "Traceback" not in log.read_text()


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ("disc.radius:=-1.0", "disc.radius is -1.0, expected 0.01 to 1."),
        ("errors.end:=0.0", "errors.end is 0.0, expected 0.0001 to 0.1."),
        ("stale:=0.0", "stale is 0.0, expected 0.05 to 10."),
        ("stael:=1.0", "There is no parameter 'stael'; there are robot, stale,"),
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


def blind(lidar, because):
    """Sends good scans until the node calls itself blind for this reason."""

    def told():
        answer = lidar.ask(live())
        return because in answer.reason and answer.verdict == CollisionEstimate.BLIND

    lidar.wait(told, f"BLIND: {because}")


def test_who_publishes_and_from_which_frame(graph):
    lidar, *_ = graph
    assert lidar.ask(live()).verdict == CollisionEstimate.GOOD
    stray = dataclasses.replace(room_scan(), frame="oakd_link")
    answer = lidar.ask(stray)
    assert answer.verdict == CollisionEstimate.BLIND
    assert "from frame 'oakd_link'" in answer.reason

    def known_within_two_scans():
        rival, since = lidar.node.create_publisher(LaserScan, "scan", 10), time.time()
        blind(lidar, "2 nodes publish scans")
        trusted = [m for m in lidar.heard if m.verdict == CollisionEstimate.GOOD]
        lidar.node.destroy_publisher(rival)
        lidar.wait(lambda: lidar.ask(live()).verdict == CollisionEstimate.GOOD, "one again")
        return seconds(trusted[-1].header.stamp) - since < GRAPH_S + TURN_S

    # A busy machine is late, but not always.
    wait_until(known_within_two_scans, "a rival that is known in time")


def test_scans_of_one_who_has_left_are_not_believed(graph, ros_domain_id):
    lidar, *_ = graph
    lidar.wait(lambda: lidar.ask(live(0.3)).probability > 0.9, "the wall")
    stranger, told = OwnNode(ros_domain_id, "stranger"), []

    def noticed():
        """One that leaves so soon may be gone before the node has heard of it."""
        forger = stranger.node.create_publisher(LaserScan, "scan", 10)
        lidar.wait(forger.get_subscription_count, "the node to listen")
        lidar.send(live(), publisher=forger)
        stranger.node.destroy_publisher(forger)
        lidar.ask(live(0.3))
        told[:] = [m for m in lidar.heard if "publisher of scans came and went" in m.reason]
        return told

    try:
        del lidar.heard[:]
        lidar.wait(noticed, "one who has left to be noticed")
        assert told[0].verdict == CollisionEstimate.BLIND
        lidar.wait(lambda: lidar.ask(live(0.3)).verdict == CollisionEstimate.GOOD, "one again")
        assert [m for m in lidar.heard if m.probability < 0.5] == []
    finally:
        stranger.close()


def test_a_stranger_on_tf_blinds(graph, ros_domain_id):
    lidar, _, log = graph
    lidar.transform(math.pi / 2)

    def mounted():
        lidar.ask(live())
        return "comes from TF" in log.read_text()

    lidar.wait(mounted, "TF")
    stranger = Lidar(ros_domain_id)
    try:
        stranger.node.destroy_publisher(stranger.scans)
        lidar.wait(lambda: lidar.ask(live()).verdict == CollisionEstimate.GOOD, "sight")
        lidar.wait(stranger.transforms.get_subscription_count, "the node to listen")
        stranger.transform(0.0)
        blind(lidar, "TF")
    finally:
        stranger.close()


def test_a_repeated_stamp_is_told_at_once_and_stamped_now(graph):
    lidar, *_ = graph
    stamp = lidar.ask(live()).header.stamp
    del lidar.heard[:]
    lidar.send(room_scan(), stamp)

    def answers():
        return [m for m in lidar.heard if "repeats" in m.reason]

    lidar.wait(answers, "the answer to a repeated stamp")
    assert answers()[0].verdict == CollisionEstimate.BLIND
    assert answers()[0].header.stamp != stamp


def test_a_stranger_on_tf_is_not_believed_before_the_robots_own_word(tmp_path, ros_domain_id):
    process = start(ros_domain_id, tmp_path, "mount:=tf")
    lidar, stranger = Lidar(ros_domain_id), Lidar(ros_domain_id)
    try:
        stranger.node.destroy_publisher(stranger.scans)
        lidar.wait(lidar.scans.get_subscription_count, "the node to hear scans")
        for who, way in ((lidar, math.pi / 2), (stranger, 0.0)):  # both latched, the last one wins
            lidar.wait(who.transforms.get_subscription_count, "the node to hear TF")
            who.transform(way)
        blind(lidar, "TF has two places for rplidar_link, one of them in tf_static: ")
    finally:
        end(process)
        stranger.close()
        lidar.close()


def test_the_mounting_comes_from_tf_as_soon_as_it_says(graph):
    lidar, _, log = graph
    assert "mask_bearings_deg is empty" not in log.read_text()
    assert lidar.ask(room_scan(0.5)).clearance == pytest.approx(0.5 - 0.185, abs=0.01)
    lidar.wait(lambda: "comes from parameters" in log.read_text(), "the first source in the log")
    lidar.transform(0.0)  # so the wall stands to the right
    lidar.wait(lambda: lidar.ask(live(0.5)).clearance > 1.0, "a way ahead by TF")
    lidar.wait(lambda: "comes from TF: (-0.040, 0.000) m, yaw 0" in log.read_text(), "TF")


def test_diagnostics_each_second(graph):
    lidar, *_ = graph
    lidar.wait(lambda: lidar.told, "diagnostics")
    status = lidar.told[0].status[0]
    assert (status.level, status.message) == (DiagnosticStatus.ERROR, "No scan has arrived.")
    del lidar.told[:]

    def values():
        return {pair.key: pair.value for pair in lidar.told[-1].status[0].values}

    def sees():
        lidar.ask(live())
        if not lidar.told or lidar.told[-1].status[0].level != DiagnosticStatus.OK:
            return False
        return float(values()["scan_age_s"]) < 0.5

    lidar.wait(sees, "diagnostics of a LiDAR that sees")
    values = values()
    assert float(values["probability"]) == pytest.approx(0.007, abs=0.001)
    assert float(values["known_fraction"]) > 0.9
    assert 0 < float(values["processing_p50_ms"]) <= float(values["processing_p99_ms"])
    assert float(values["scan_rate_hz"]) > 0
    assert values["mount"] == "parameters"


def test_a_mounting_by_parameters_needs_no_tf_and_an_empty_mask_is_warned_of(
    tmp_path, ros_domain_id
):
    process = start(ros_domain_id, tmp_path, "mount:=parameters", "disc.mask_bearings_deg:=''")
    lidar = Lidar(ros_domain_id)
    try:
        lidar.wait(lambda: lidar.heard and lidar.told, "the node, a second after its start")
        lidar.wait(lambda: lidar.transforms.get_subscription_count() == 0, "nobody on tf_static")
        lidar.wait(lambda: lidar.node.count_subscribers("tf") == 0, "nobody on tf")
        assert (tmp_path / "log").read_text().count("disc.mask_bearings_deg is empty") == 1
    finally:
        end(process)
        lidar.close()


def test_given_parameters_that_tf_contradicts(tmp_path, ros_domain_id):
    process = start(ros_domain_id, tmp_path, "disc.mount_yaw_deg:=0.0")
    lidar = Lidar(ros_domain_id)
    try:
        lidar.wait(lambda: lidar.heard and lidar.scans.get_subscription_count(), "the node")
        lidar.transform(math.pi / 2)
        blind(lidar, "TF puts the LiDAR at")
    finally:
        end(process)
        lidar.close()
