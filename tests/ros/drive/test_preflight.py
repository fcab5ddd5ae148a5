"""Who may be driven, and with which message type."""

from functools import partial

import pytest
from cfnav_ros.drive.preflight import (
    STAMPED,
    UNSTAMPED,
    BaseCheck,
    Endpoint,
    InputPublisher,
    check_base,
    check_mux,
    check_recorder,
    explain_silence,
    hidden,
    relatives,
)
from cfnav_ros.robot.speakers import UNKNOWN_NODE

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
    graph = ["/image", "/image/compressed", "/image2", "/odom"]
    assert relatives("/image", graph[1:]) == ["/image/compressed"]
    assert relatives("/image/compressed", graph[:1]) == ["/image"]
    assert explain_silence("/image", IMAGE, [InputPublisher("oakd", COMPRESSED)]) == (
        f"oakd sends {COMPRESSED} on /image, expected {IMAGE}"
    )
    clash = InputPublisher("lidar", IMAGE, "Best effort publisher and reliable subscription.")
    assert explain_silence("/image", IMAGE, [clash]) == (
        "lidar offers /image with other QoS: Best effort publisher and reliable subscription."
    )
    assert explain_silence("/image", IMAGE, [clash, InputPublisher("oakd", IMAGE)]) == ""


def test_a_robot_of_another_namespace_is_named():
    check = check_base("/cmd_vel", [], {}, listened_to=["/turtlebot1/cmd_vel", "/cmd_vel"])
    assert check.waiting == (
        "No robot listens on /cmd_vel, but somebody does on /turtlebot1/cmd_vel: set the namespace."
    )


@pytest.mark.parametrize(
    ("server", "super_client", "sees"),
    [("", "", True), ("10.0.0.2:11811;", "", False), ("10.0.0.2:11811;", "False", False),
     ("10.0.0.2:11811;", "True", True), ("10.0.0.2:11811;", "true", True)],
)  # fmt: skip
def test_a_client_of_a_discovery_server_does_not_see_who_else_drives(server, super_client, sees):
    told = hidden({"ROS_DISCOVERY_SERVER": server, "ROS_SUPER_CLIENT": super_client})
    assert (told == "") is sees
    assert sees or "export ROS_SUPER_CLIENT=True" in told


def test_a_multiplexer_is_driven_once_it_listens_and_publishes():
    mux, onlooker = Endpoint("twist_mux", STAMPED), Endpoint("recorder", STAMPED)
    check = partial(check_mux, "/cmd_vel_cfnav", base_topic="/cmd_vel")
    assert check([mux, onlooker], publishers=["twist_mux"]) == BaseCheck(STAMPED)
    deaf = check([onlooker], publishers=["twist_mux"])
    assert (deaf.waiting, deaf.deaf) == ("No multiplexer listens on /cmd_vel_cfnav.", True)
    assert check([mux], publishers=[]).waiting == "No multiplexer publishes on /cmd_vel."
    unknown = check([Endpoint(UNKNOWN_NODE, STAMPED)], publishers=["twist_mux"])
    assert unknown.waiting == "A listener on /cmd_vel_cfnav has not said its name."
    other = check([mux, Endpoint("other", UNSTAMPED)], publishers=["twist_mux"])
    assert "want different types" in other.fault


def test_a_recorder_that_is_gone_stops_and_one_that_joins_does_not():
    base, check = BaseCheck(STAMPED), partial(check_recorder, topic="/cmd_vel")
    assert check(base, listeners=[MOCK, RECORDER], matched=True) is base
    gone = check(base, listeners=[MOCK], matched=True)
    assert (gone.waiting, gone.deaf) == ("No recorder hears /cmd_vel.", True)
    joins = check(base, listeners=[MOCK, RECORDER], matched=False)
    assert (joins.waiting, joins.deaf) == ("No recorder hears /cmd_vel.", False)


NAV2 = ("collision_monitor", "docking_server")


def test_idle_nodes_of_nav2_are_rivals_unless_they_are_named():
    def check(*allowed):
        return check_base("/cmd_vel", [MOCK], {"/cmd_vel": NAV2}, "auto", False, allowed)

    said = "collision_monitor, docking_server also publishes on /cmd_vel: "
    assert check().fault.startswith(said)
    assert check("docking_server").fault.startswith("collision_monitor also publishes on /cmd_vel")
    assert check(*NAV2).ready
