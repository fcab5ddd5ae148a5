"""Faults of one running mock: set, announced, felt on the topics, mended."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_interfaces.srv import SetFault, StartEpisode  # noqa: E402
from cfnav_ros.process.domains import Domain  # noqa: E402
from sim_bridge.robot.rplidar import SCAN_PERIOD  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from tests.ros.mock_listener import ROOM, Listener, seconds, start_mock  # noqa: E402

SCHEDULE = "- {fault: joints_silent, at: 1.0, duration: 0.5}\n"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mock")
    (folder / "faults.yaml").write_text(SCHEDULE)
    with Domain() as domain:
        process = start_mock(
            folder / "log", domain, f"room:={ROOM}", f"faults:={folder / 'faults.yaml'}"
        )
        listener = Listener(domain)
        try:
            process.wait_for_line("ready")
            listener.wait_connected()
            listener.wait(lambda: len(listener.faults) >= 2, "the scheduled fault")
            yield listener
            assert process.interrupt() == 0, process.output
            assert "Traceback" not in process.output
        finally:
            listener.close()
            process.end()


@pytest.fixture
def fault(robot):
    """A function that sets a fault, waits until it holds and returns its beginning, s.

    All are mended after the test.
    """

    def set_one(name, **fields):
        heard = len(robot.faults)
        answer = robot.call(SetFault, fault=name, active=True, **fields)
        assert answer.ok, answer.message
        robot.wait(lambda: len(robot.faults) > heard, f"{name} to begin")
        assert (robot.faults[heard].fault, robot.faults[heard].active) == (name, True)
        return seconds(robot.faults[heard].header.stamp)

    yield set_one
    mend_all(robot)


def mend_all(robot):
    """End every fault; the time at which the last ended, s."""
    assert robot.call(SetFault, active=False).ok
    return wait_mended(robot)


def wait_mended(robot):
    robot.wait(lambda: not holding(robot), "every fault to end")
    return seconds(robot.faults[-1].header.stamp)


def holding(robot):
    state = {message.fault: message.active for message in robot.faults}
    return {name for name, active in state.items() if active}


def after(robot, topic, t, count=1):
    """Wait for so many messages that are stamped after t, s, and return all of these.

    Topics are heard one before the other, so only stamps tell what a fault has met.
    """
    robot.wait(lambda: seconds(robot.heard[topic][-count].header.stamp) > t, f"{count} of {topic}")
    return [m for m in robot.heard[topic] if seconds(m.header.stamp) > t]


def stands(robot, t, count):
    """Whether the newest odometry says one time, s, again and again."""
    return robot.stamps("odom")[-count:] == [t] * count


def test_schedule_file_was_followed(robot):
    begin, end = robot.faults[:2]
    assert [(m.fault, m.active) for m in (begin, end)] == [
        ("joints_silent", True),
        ("joints_silent", False),
    ]
    assert (seconds(begin.header.stamp), seconds(end.header.stamp)) == pytest.approx((1.0, 1.5))


def test_request_that_makes_no_sense_says_why(robot):
    answer = robot.call(SetFault, fault="gremlins", active=True)
    assert not answer.ok
    assert "'gremlins' is unknown; known are scan_silent" in answer.message
    answer = robot.call(SetFault, fault="e_stop", active=True, when="flying")
    assert "expected one of now, driving" in answer.message
    assert not robot.call(SetFault, fault="gremlins", active=False).ok


def test_message_fault_is_felt_and_mended(robot, fault):
    began = fault("scan_all_inf")
    assert all(np.isinf(scan.ranges).all() for scan in after(robot, "scan", began, 2))
    ended = mend_all(robot)
    assert np.isfinite(after(robot, "scan", ended)[-1].ranges).any()


def test_silent_report_is_not_heard_and_comes_back(robot, fault):
    began = fault("wheels_silent")
    robot.wait_for(0.5)
    ended = mend_all(robot)
    assert seconds(after(robot, "wheel_status", began)[0].header.stamp) >= ended


def test_fault_waits_for_the_turn_and_mends_itself(robot):
    heard = len(robot.faults)
    assert robot.call(SetFault, fault="odom_silent", active=True, when="turning", duration=0.5).ok
    robot.wait_for(0.5)
    assert len(robot.faults) == heard
    robot.drive(0.0, 0.8, lambda: abs(robot.truth.w) > 0.3, "a turn")
    before, turns = robot.stamps("ground_truth/state")[-2:]
    robot.wait(lambda: len(robot.faults) > heard + 1, "the fault and its end")
    begin, end = (seconds(m.header.stamp) for m in robot.faults[heard : heard + 2])
    assert before <= begin <= turns
    assert end - begin == pytest.approx(0.5)
    robot.wait_rest()


def test_deaf_base_has_no_ears_and_hears_again(robot, fault):
    def ears():
        infos = [
            info
            for topic in ("cmd_vel", "cmd_vel_unstamped")
            for info in robot.node.get_subscriptions_info_by_topic(topic)
        ]
        return sorted((info.node_name, info.topic_type.rpartition("/")[2]) for info in infos)

    robot.wait(lambda: len(ears()) == 2, "both ears")
    fault("cmd_deaf")
    robot.wait(lambda: ears() == [], "no ear")
    mend_all(robot)
    both = [("mock_turtlebot4", "Twist"), ("mock_turtlebot4", "TwistStamped")]
    robot.wait(lambda: ears() == both, "both ears again")
    fault("cmd_type")
    robot.wait(lambda: ears() == [("mock_turtlebot4", "Twist")], "the other type")


def test_rivals_are_another_node(robot, fault):
    infos = robot.node.get_publishers_info_by_topic

    def names(topic):
        return {info.node_name for info in infos(topic)}

    fault("scan_rival")
    robot.wait(lambda: "rival" in names("scan"), "the rival's scan")
    robot.wait(lambda: set(robot.last("scan").ranges) == {3.0}, "a scan of the rival")
    rivals = {bytes(i.endpoint_gid) for i in infos("scan") if i.node_name == "rival"}
    fault("cmd_rival")
    robot.wait(lambda: "rival" in names("cmd_vel"), "the rival on cmd_vel")
    # It stays the same rival, whatever else begins.
    assert len(rivals) == 1
    assert rivals < {bytes(info.endpoint_gid) for info in infos("scan")}
    mend_all(robot)
    robot.wait(lambda: names("scan") == {"mock_turtlebot4"}, "the rival to leave")


def test_cut_network_lets_only_the_truth_through(robot, fault):
    began = fault("network_cut_1")
    ended = wait_mended(robot)
    assert ended - began == pytest.approx(1.0)
    # A scan is stamped with the beginning of its turn.
    made_after = {
        "odom": 0,
        "scan": SCAN_PERIOD,
        "oakd/rgb/preview/image_raw": 0,
        "joint_states": 0,
    }
    for topic, later in made_after.items():
        first = after(robot, topic, began - later)[0]
        assert seconds(first.header.stamp) + later > ended - 0.01, topic
    truth = "ground_truth/state"
    after(robot, truth, ended)
    times = zip(robot.stamps(truth), robot.numbers[truth], strict=True)
    sent = [number for t, number in times if began < t < ended]
    assert sent[-1] - sent[0] > 15


def test_stopped_clock_stops_stamps_but_not_the_truth(robot, fault):
    stood = fault("clock_stop")
    robot.wait(lambda: stands(robot, stood, 8), "odometry of a clock that stands")
    robot.wait(lambda: robot.truth_time() > stood + 0.3, "the truth of later")
    ended = mend_all(robot)
    robot.wait(lambda: robot.now() > stood, "the clock to go on")
    assert robot.now() >= ended


def test_fault_that_is_ordered_again_acts_again(robot, fault):
    first = fault("clock_stop")
    robot.wait(lambda: stands(robot, first, 4), "odometry of a clock that stands")
    robot.wait_for(0.2)
    heard = len(robot.faults)
    assert robot.call(SetFault, fault="clock_stop", active=True).ok
    robot.wait(lambda: len(robot.faults) >= heard + 2, "the fault to end and begin")
    assert [m.active for m in robot.faults[heard:]] == [False, True]
    again = seconds(robot.faults[-1].header.stamp)
    assert again > first + 0.2
    robot.wait(lambda: stands(robot, again, 4), "odometry of a clock that stands later")


@pytest.mark.parametrize(("name", "off"), [("clock_ahead", 10.0), ("clock_back", -10.0)])
def test_jumping_clock_takes_the_stamps_along(robot, fault, name, off):
    robot.wait_for(max(0.0, 12.0 - robot.truth_time()))
    began = fault(name)
    robot.wait(lambda: abs(robot.now() - off - began) < 5.0, "the clock to jump")
    robot.wait(lambda: abs(robot.odometry_time() - off - began) < 5.0, "odometry to jump")
    # Both are sent at the same moments, 0.05 s apart.
    apart = robot.odometry_time() - off - robot.truth_time()
    assert math.remainder(apart, 0.05) == pytest.approx(0.0, abs=1e-6)


def test_bumper_that_sticks_is_reported_without_a_collision(robot, fault):
    room_pose = robot.truth
    assert robot.call(StartEpisode, room=ROOM, start=[room_pose.x, room_pose.y, room_pose.yaw]).ok
    fault("bumper_stuck")
    robot.wait(robot.bumps, "a bump")
    assert robot.bumps() == ["bump_front_center"]
    assert robot.truth.collisions == 0


@pytest.mark.parametrize("name", ["camera_start_hangs", "camera_start_fails"])
def test_camera_that_cannot_be_started_sends_nothing_until_it_is_mended(robot, fault, name):
    picture, start = "oakd/rgb/preview/image_raw", Trigger.Request()
    client = robot.node.create_client(Trigger, "oakd/start_camera")
    robot.wait(client.service_is_ready, "the service of the camera")
    began = fault(name)
    answer = client.call_async(start)
    robot.wait_for(1.0)
    if name.endswith("hangs"):
        assert not answer.done()
    else:
        robot.wait(answer.done, "an answer")
        told = answer.result()
        assert (told.success, told.message) == (False, "No device was found.")
    ended = mend_all(robot)
    robot.wait(client.service_is_ready, "the service of the camera again")
    answer = client.call_async(start)
    robot.wait(answer.done, "an answer")
    assert answer.result().success
    assert seconds(after(robot, picture, began)[0].header.stamp) >= ended - 0.01
