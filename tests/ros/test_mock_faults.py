"""Faults of one running mock: set, announced, felt on the topics, mended."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_interfaces.srv import SetFault, StartEpisode  # noqa: E402
from sim_bridge.rplidar import SCAN_PERIOD  # noqa: E402

from .mock_listener import ROOM, Listener, locked_domain, seconds, start_mock  # noqa: E402

SCHEDULE = "- {fault: joints_silent, at: 1.0, duration: 0.5}\n"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mock")
    (folder / "faults.yaml").write_text(SCHEDULE)
    with locked_domain() as domain:
        process = start_mock(
            folder / "log", domain, f"room:={ROOM}", f"faults:={folder / 'faults.yaml'}"
        )
        listener = Listener(domain)
        try:
            process.wait_for_line("ready")
            listener.wait_connected()
            yield listener
            assert process.interrupt() == 0, process.output
            assert "Traceback" not in process.output
        finally:
            listener.close()
            process.end()


@pytest.fixture
def fault(robot):
    """A function that sets a fault and waits until it holds; all are mended after the test."""

    def set_one(name, **fields):
        heard = len(robot.faults)
        answer = robot.call(SetFault, fault=name, active=True, **fields)
        assert answer.ok, answer.message
        robot.wait(lambda: len(robot.faults) > heard, f"{name} to begin")
        assert (robot.faults[heard].fault, robot.faults[heard].active) == (name, True)

    yield set_one
    mend_all(robot)


def mend_all(robot):
    assert robot.call(SetFault, active=False).ok
    robot.wait(lambda: not holding(robot), "every fault to end")


def holding(robot):
    state = {message.fault: message.active for message in robot.faults}
    return {name for name, active in state.items() if active}


def newer(robot, topic, count=1):
    """Wait for so many new messages and return them."""
    before = len(robot.heard[topic])
    robot.wait(lambda: len(robot.heard[topic]) >= before + count, f"{count} of {topic}")
    return robot.heard[topic][before:]


def truth_time(robot):
    return seconds(robot.last("ground_truth/state").header.stamp)


def test_schedule_file_was_followed(robot):
    robot.wait(lambda: len(robot.faults) >= 2, "the scheduled fault")
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
    fault("scan_all_inf")
    assert np.isinf(newer(robot, "scan", 2)[-1].ranges).all()
    mend_all(robot)
    assert np.isfinite(newer(robot, "scan", 3)[-1].ranges).any()


@pytest.mark.parametrize(
    ("name", "topic"), [("hazards_silent", "hazard_detection"), ("wheels_silent", "wheel_status")]
)
def test_silent_report_is_not_heard_and_comes_back(robot, fault, name, topic):
    fault(name)
    began = seconds(robot.faults[-1].header.stamp)
    robot.wait_for(0.5)
    assert not [m for m in robot.heard[topic] if seconds(m.header.stamp) > began]
    mend_all(robot)
    newer(robot, topic)


def test_fault_waits_for_the_turn_and_mends_itself(robot):
    heard = len(robot.faults)
    assert robot.call(SetFault, fault="odom_silent", active=True, when="turning", duration=0.5).ok
    robot.wait_for(0.5)
    assert len(robot.faults) == heard
    robot.drive(0.0, 0.8, lambda: len(robot.faults) > heard, "the fault")
    truth = next(m for m in robot.heard["ground_truth/state"] if abs(m.w) > 0.3)
    assert 0 <= seconds(truth.header.stamp) - seconds(robot.faults[heard].header.stamp) <= 0.051
    robot.wait(lambda: len(robot.faults) > heard + 1, "the end of the fault")
    begin, end = (seconds(m.header.stamp) for m in robot.faults[heard : heard + 2])
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
    fault("network_cut_1")
    began = seconds(robot.faults[-1].header.stamp)
    robot.wait(lambda: not holding(robot), "the end of the cut")
    newer(robot, "odom", 2)
    # A scan is stamped with the beginning of its turn.
    made_after = {
        "odom": 0,
        "scan": SCAN_PERIOD,
        "oakd/rgb/preview/image_raw": 0,
        "joint_states": 0,
    }
    for topic, later in made_after.items():
        stamps = [seconds(m.header.stamp) + later for m in robot.heard[topic]]
        assert not [s for s in stamps if began < s < began + 0.99], topic
    truths = [seconds(m.header.stamp) for m in robot.heard["ground_truth/state"]]
    assert len([s for s in truths if began < s < began + 0.99]) > 15


def test_stopped_clock_stops_stamps_but_not_the_truth(robot, fault):
    fault("clock_stop")
    robot.wait_for(0.2)
    ticks = len(robot.heard["/clock"])
    before = truth_time(robot)
    stamps = {seconds(m.header.stamp) for m in newer(robot, "odom", 8)}
    assert len(stamps) == 1
    assert len(robot.heard["/clock"]) == ticks
    assert truth_time(robot) > before + 0.3


def test_fault_that_is_ordered_again_acts_again(robot, fault):
    fault("clock_stop")
    first = seconds(newer(robot, "odom", 4)[-1].header.stamp)
    robot.wait_for(0.2)
    heard = len(robot.faults)
    assert robot.call(SetFault, fault="clock_stop", active=True).ok
    robot.wait(lambda: len(robot.faults) >= heard + 2, "the fault to end and begin")
    assert [m.active for m in robot.faults[heard:]] == [False, True]
    robot.wait(lambda: seconds(robot.last("odom").header.stamp) > first + 0.2, "a later stamp")
    assert len({seconds(m.header.stamp) for m in newer(robot, "odom", 4)}) == 1


@pytest.mark.parametrize(("name", "off"), [("clock_ahead", 10.0), ("clock_back", -10.0)])
def test_jumping_clock_takes_the_stamps_along(robot, fault, name, off):
    robot.wait_for(max(0.0, 12.0 - truth_time(robot)))
    fault(name)
    odometry = newer(robot, "odom", 4)[-1]
    newer(robot, "ground_truth/state", 2)
    truths = [seconds(m.header.stamp) for m in robot.heard["ground_truth/state"][-40:]]
    shown = seconds(odometry.header.stamp) - off
    assert min(abs(t - shown) for t in truths) < 1e-6
    assert (
        abs(robot.now() - off - truth_time(robot)) < 5.0
    )  # a busy machine hears the one later than the other


def test_bumper_that_sticks_is_reported_without_a_collision(robot, fault):
    room_pose = robot.last("ground_truth/state")
    assert robot.call(StartEpisode, room=ROOM, start=[room_pose.x, room_pose.y, room_pose.yaw]).ok
    fault("bumper_stuck")
    robot.wait(robot.bumps, "a bump")
    assert robot.bumps() == ["bump_front_center"]
    assert robot.last("ground_truth/state").collisions == 0
