"""Who may be driven, and with which message type."""

import pytest
from cfnav_ros.preflight import (
    STAMPED,
    UNKNOWN_NODE,
    UNSTAMPED,
    Endpoint,
    Source,
    check_base,
    explain_silence,
)

MOCK = Endpoint("mock_turtlebot4", STAMPED)
RECORDER = Endpoint("recorder", STAMPED)
TURTLEBOT = Endpoint("create3_repub", STAMPED)


@pytest.mark.parametrize("listeners", [[MOCK], [MOCK, RECORDER], [RECORDER, MOCK]])
def test_the_mock_may_be_driven(listeners):
    check = check_base("/cmd_vel", listeners, {})
    assert check.ready
    assert check.type == STAMPED


def test_a_real_robot_needs_leave():
    check = check_base("/cmd_vel", [TURTLEBOT], {})
    assert not check.ready
    assert check.fault == (
        "create3_repub listens on /cmd_vel and may be a real robot: set allow_robot to drive it."
    )
    assert check_base("/cmd_vel", [TURTLEBOT], {}, allow_robot=True).type == STAMPED


def test_a_real_robot_beside_the_mock_is_not_driven():
    assert "create3_repub" in check_base("/cmd_vel", [MOCK, TURTLEBOT], {}).fault


@pytest.mark.parametrize("listeners", [[], [RECORDER]])
def test_nobody_to_drive_is_waited_for(listeners):
    check = check_base("/cmd_vel", listeners, {})
    assert (check.waiting, check.deaf) == ("No robot listens on /cmd_vel.", True)
    assert not check.ready
    assert not check.fault


def test_a_listener_without_a_name_is_waited_for():
    check = check_base("/cmd_vel", [Endpoint(UNKNOWN_NODE, STAMPED)], {}, allow_robot=True)
    assert check.waiting
    assert not check.ready


def test_the_type_is_the_listeners():
    assert check_base("/cmd_vel", [Endpoint("mock_turtlebot4", UNSTAMPED)], {}).type == UNSTAMPED
    wrong = check_base("/cmd_vel", [Endpoint("mock_turtlebot4", UNSTAMPED)], {}, "stamped")
    assert wrong.fault.startswith("cmd_vel_type is stamped, but the listener on /cmd_vel wants")
    both = check_base("/cmd_vel", [MOCK, Endpoint("mock_turtlebot4", UNSTAMPED)], {})
    assert "different types" in both.fault
    other = check_base("/cmd_vel", [Endpoint("mock_turtlebot4", "std_msgs/msg/String")], {})
    assert "std_msgs/msg/String" in other.fault


def test_a_second_publisher_forbids_driving_unless_named():
    check = check_base("/cmd_vel", [MOCK], {"/cmd_vel": ["teleop"]})
    assert check.fault == "teleop also publishes on /cmd_vel: stop it, one node must drive."
    assert check_base(
        "/cmd_vel", [MOCK], {"/cmd_vel": ["teleop"]}, other_publishers_allowed=("teleop",)
    ).ready
    assert not check_base(
        "/cmd_vel", [MOCK], {"/cmd_vel": ["teleop", "x"]}, other_publishers_allowed=("teleop",)
    ).ready
    nameless = check_base("/cmd_vel", [MOCK], {"/cmd_vel": [UNKNOWN_NODE]})
    assert nameless.deaf
    assert nameless.waiting == "A publisher on /cmd_vel has not said its name."
    beside = {"/cmd_vel": [], "/cmd_vel_unstamped": ["nav"]}
    check = check_base("/cmd_vel", [MOCK], beside)
    assert check.fault.startswith("nav also publishes on /cmd_vel_unstamped: ")
    assert check_base("/cmd_vel", [MOCK], beside, other_publishers_allowed=("nav",)).ready


@pytest.mark.parametrize("name", ["recorder", "foxglove_bridge", "_ros2cli_4711"])
def test_onlookers_are_no_base(name):
    onlooker = Endpoint(name, UNSTAMPED)
    assert check_base("/cmd_vel", [MOCK, onlooker], {}).type == STAMPED
    assert check_base("/cmd_vel", [onlooker], {}, allow_robot=True).deaf


IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"


def test_an_input_that_does_not_come_is_explained():
    assert explain_silence("/image", IMAGE, []) == "nobody publishes /image"
    assert explain_silence("/image", IMAGE, [], ["/image/compressed"]) == (
        "nobody publishes /image, only /image/compressed"
    )
    assert explain_silence("/image", IMAGE, [Source("oakd", COMPRESSED)]) == (
        f"oakd sends {COMPRESSED} on /image, expected {IMAGE}"
    )
    clash = Source("lidar", IMAGE, "Best effort publisher and reliable subscription.")
    assert explain_silence("/image", IMAGE, [clash]) == (
        "lidar offers /image with other QoS: Best effort publisher and reliable subscription."
    )
    assert explain_silence("/image", IMAGE, [clash, Source("oakd", IMAGE)]) == ""
