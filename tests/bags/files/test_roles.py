"""Which topic plays which role."""

from __future__ import annotations

import pytest
from cfnav_ros.bags.files.roles import ROLES, assign, parse_topics
from cfnav_ros.bags.files.storage import BagTopic

ODOM, IMAGE = "nav_msgs/msg/Odometry", "sensor_msgs/msg/Image"
JPEG, TF = "sensor_msgs/msg/CompressedImage", "tf2_msgs/msg/TFMessage"
STAMPED, TWIST = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"


def names(*topics: BagTopic, **named: str) -> dict[str, str]:
    return {role: topic.name for role, topic in assign(topics, named).topics.items()}


def test_words_of_the_command_line_are_read():
    words = ["image:=/front/image", "odom:=wheels"]
    assert parse_topics(words) == {"image": "/front/image", "odom": "wheels"}
    assert parse_topics([]) == {}


@pytest.mark.parametrize(
    "word", ["", "image", "image=/x", "image:=", "picture:=/x", ":=/x", "a:=b:=c"]
)
def test_a_bad_word_gives_one_sentence_with_the_roles(word):
    with pytest.raises(ValueError, match="expected ROLE:=NAME with ROLE one of image, ") as caught:
        parse_topics([word])
    assert all(role in str(caught.value) for role in ROLES)
    assert "\n" not in str(caught.value)


def test_a_role_given_twice_is_refused():
    with pytest.raises(ValueError, match="odom is given twice, as a and b"):
        parse_topics(["odom:=a", "odom:=b"])


def test_usual_names_win_in_any_namespace():
    topics = (
        BagTopic("/r1/filtered", ODOM, 900),
        BagTopic("/r1/odom", ODOM, 10),
        BagTopic("/r1/tf", TF, 5),
        BagTopic("/r1/tf_static", TF, 1),
        BagTopic("/r1/oakd/rgb/preview/image_raw", IMAGE, 7),
        BagTopic("/r1/oakd/rgb/image_rect", IMAGE, 70),
    )
    assert names(*topics) == {
        "image": "/r1/oakd/rgb/preview/image_raw",
        "odom": "/r1/odom",
        "tf": "/r1/tf",
        "tf_static": "/r1/tf_static",
    }


def test_a_name_that_only_ends_alike_is_not_the_usual_one():
    assert names(BagTopic("/wheel_odom", ODOM, 1), BagTopic("/odom", ODOM, 1))["odom"] == "/odom"
    assert names(BagTopic("/my_tf", TF, 9)) == {}


def test_without_a_usual_name_the_type_tells_and_most_messages_win():
    topics = (BagTopic("/a", ODOM, 3), BagTopic("/b", ODOM, 5), BagTopic("/c", ODOM, 0))
    roles = assign(topics)
    assert roles.topics["odom"].name == "/b"
    assert roles.notes == (
        "For odom /b (Odometry, 5 messages) was chosen, there are also /a (Odometry, 3 messages), "
        "/c (Odometry, 0 messages).",
    )
    assert set(roles.missing) == set(ROLES) - {"odom"}


def test_a_name_without_a_slash_stands_in_any_namespace_unless_it_is_there_exactly():
    topics = (BagTopic("/r1/wheels", ODOM, 3), BagTopic("/wheels", ODOM, 1))
    assert names(*topics, odom="wheels") == {"odom": "/wheels"}
    assert names(topics[0], odom="wheels") == {"odom": "/r1/wheels"}
    assert names(topics[0], odom="/wheels") == {}


def test_an_empty_topic_loses_whatever_its_name():
    topics = (BagTopic("/cmd_vel", STAMPED, 0), BagTopic("/cmd_vel_unstamped", TWIST, 4))
    assert names(*topics) == {"cmd_vel": "/cmd_vel_unstamped"}
    assert names(BagTopic("/cmd_vel", STAMPED, 0)) == {"cmd_vel": "/cmd_vel"}


def test_one_name_with_two_types_is_two_topics():
    topics = (BagTopic("/cmd_vel", TWIST, 4), BagTopic("/cmd_vel", STAMPED, 4))
    chosen = assign(topics).topics["cmd_vel"]
    assert chosen.type == STAMPED
    assert names(BagTopic("/camera/image_raw/compressed", JPEG, 4)) == {
        "image": "/camera/image_raw/compressed"
    }


def test_depth_pictures_and_costmaps_are_something_else():
    grid = "nav_msgs/msg/OccupancyGrid"
    topics = (BagTopic("/stereo/image_raw", IMAGE, 9), BagTopic("/local_costmap/costmap", grid, 9))
    assert names(*topics) == {}
    assert names(*topics, image="/stereo/image_raw") == {"image": "/stereo/image_raw"}


def test_what_the_user_names_is_taken_or_missing():
    topics = (BagTopic("/odom", ODOM, 9), BagTopic("/other", ODOM, 1), BagTopic("/scan", TWIST, 3))
    assert names(*topics, odom="other")["odom"] == "/other"
    roles = assign(topics, {"odom": "/nowhere", "scan": "/scan"})
    assert {"odom", "scan"} <= set(roles.missing)
    assert roles.notes == (
        "The topic /scan that was given for scan holds geometry_msgs/msg/Twist, expected "
        "sensor_msgs/msg/LaserScan.",
        "The topic /nowhere that was given for odom is not in the bag.",
    )


# One robot


SCAN, INFO = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/CameraInfo"


def robot(space, scans=50, poses=160):
    """A robot's topics."""
    return [
        BagTopic(f"{space}/scan", SCAN, scans), BagTopic(f"{space}/odom", ODOM, poses),
        BagTopic(f"{space}/cmd_vel", STAMPED, poses),
    ]  # fmt: skip


def spaces(*topics, namespace="", **named):
    """The namespaces of scan, odom and cmd_vel."""
    chosen = assign(topics, named, namespace=namespace).topics
    return [chosen[role].name.rpartition("/")[0] for role in ("scan", "odom", "cmd_vel")]


TWO = [*robot("/r1", scans=90, poses=10), *robot("/r2", scans=10, poses=90)]


def test_all_roles_are_of_one_robot_and_each_can_be_chosen():
    assert spaces(*TWO) == ["/r1"] * 3
    assert spaces(*TWO, namespace="r2") == spaces(*TWO, namespace="/r2/") == ["/r2"] * 3
    roles = assign(TWO)
    assert roles.notes == ()
    assert roles.about_robots("--namespace {} judges another") == (
        "The bag holds several robots, /r1, /r2: /r1 was chosen, --namespace /r2 judges another.",
    )
    (told,) = assign(TWO, {"odom": "/r2/odom"}).about_robots("--namespace {} judges another")
    assert told.endswith("/r2 was chosen, --namespace /r1 judges another.")
    assert assign(TWO, namespace="r2").about_robots("{}") == ()
    assert assign(robot("/r1")).about_robots("{}") == ()


@pytest.mark.parametrize("role", ["scan", "odom", "cmd_vel"])
@pytest.mark.parametrize("space", ["/r1", "/r2"])
def test_a_named_topic_fixes_the_rest(role, space):
    assert spaces(*TWO, **{role: f"{space}/{role}"}) == [space] * 3
    assert spaces(*TWO, **{role: f"{space[1:]}/{role}"}) == [space] * 3


def test_a_name_that_all_robots_have_is_taken_of_one():
    assert spaces(*TWO, odom="odom") == ["/r1"] * 3
    assert spaces(*TWO, odom="odom", namespace="r2") == ["/r2"] * 3


def test_the_robot_of_which_most_is_recorded_is_chosen():
    more = BagTopic("/r2/oakd/rgb/preview/image_raw", IMAGE, 5)
    assert spaces(*TWO, more) == ["/r2"] * 3
    assert "image" not in assign([*TWO, more], namespace="r1").topics


def test_robots_in_deep_namespaces_and_one_without_are_told_apart():
    fleet = [*robot("/lab/fleet/a"), *robot("/lab/fleet/b", poses=500)]
    assert spaces(*fleet) == ["/lab/fleet/a"] * 3
    both = [*robot(""), *robot("/r2", poses=500)]
    assert assign(both).robots == ("/", "/r2")
    assert spaces(*both) == spaces(*both, namespace="/") == [""] * 3
    assert spaces(*both, namespace="r2") == ["/r2"] * 3
    clock = BagTopic("/clock", "rosgraph_msgs/msg/Clock", 9)
    shared = [clock, BagTopic("/tf", TF, 9), BagTopic("/map", "nav_msgs/msg/OccupancyGrid", 1)]
    assert {"clock", "tf", "map"} <= set(assign([*both, *shared], namespace="r2").topics)


def test_a_robot_without_a_scan_is_not_given_that_of_another():
    lacks = [topic for topic in TWO if topic.name != "/r1/scan"]
    assert "scan" not in assign(lacks, namespace="r1").topics
    common = BagTopic("/scan", SCAN, 3)
    assert assign([*lacks, common], namespace="r1").topics["scan"] == common


def test_parts_of_one_robot_in_namespaces_of_their_own_are_one_robot():
    topics = [
        BagTopic("/front/scan", SCAN, 40), BagTopic("/rear/scan", SCAN, 50),
        BagTopic("/diff_drive_controller/odom", ODOM, 100),
        BagTopic("/diff_drive_controller/cmd_vel_unstamped", TWIST, 100),
        BagTopic("/zed/odom", ODOM, 30), BagTopic("/zed/rgb/image_raw", IMAGE, 30),
    ]  # fmt: skip
    roles = assign(topics)
    assert roles.about_robots("{}") == ()
    assert {role: topic.name for role, topic in roles.topics.items()} == {
        "image": "/zed/rgb/image_raw", "scan": "/rear/scan",
        "odom": "/diff_drive_controller/odom",
        "cmd_vel": "/diff_drive_controller/cmd_vel_unstamped",
    }  # fmt: skip


def test_robots_without_lidar_are_not_mixed_either():
    topics = [
        BagTopic("/r1/odom", ODOM, 10), BagTopic("/r2/odom", ODOM, 90),
        BagTopic("/r1/image_raw", IMAGE, 90), BagTopic("/r2/image_raw", IMAGE, 10),
    ]  # fmt: skip
    assert names(*topics) == {"odom": "/r2/odom", "image": "/r2/image_raw"}
    assert names(*topics, odom="/r1/odom") == {"odom": "/r1/odom", "image": "/r1/image_raw"}


def test_a_namespace_that_is_not_there_gives_a_sentence_and_nothing_else():
    roles = assign(TWO, namespace="r3")
    assert (roles.topics, set(roles.missing)) == ({}, set(ROLES))
    assert roles.notes == ("The bag holds no topic in the namespace /r3, its robots are /r1, /r2.",)


# One camera


def test_the_calibration_is_that_of_the_camera():
    cameras = [
        BagTopic("/left/image_raw", IMAGE, 10), BagTopic("/left/camera_info", INFO, 10),
        BagTopic("/right/image_raw/compressed", JPEG, 90), BagTopic("/right/camera_info", INFO, 90),
    ]  # fmt: skip
    assert names(*cameras) == {"image": "/left/image_raw", "camera_info": "/left/camera_info"}
    right = {"image": "/right/image_raw/compressed", "camera_info": "/right/camera_info"}
    assert names(*cameras, image=right["image"]) == right
    assert names(*cameras[:1], *cameras[2:]) == {"image": "/left/image_raw"}
    alone = BagTopic("/calibration", INFO, 1)
    assert names(cameras[0], alone)["camera_info"] == "/calibration"


def test_without_pictures_the_calibration_is_that_of_the_camera_that_a_robot_names():
    lenses = ("/oakd/left/camera_info", "/oakd/rgb/camera_info", "/oakd/rgb/preview/camera_info")
    topics = [BagTopic(name, INFO, 10) for name in lenses]
    assert names(*topics, image="oakd/rgb/image_raw/compressed") == {"camera_info": lenses[1]}
    usual = {"camera_info": lenses[2]}
    assert names(*topics) == usual, "of the usual picture"
    inside = [BagTopic(f"/robot1{topic.name}", INFO, 10) for topic in topics]
    assert names(*inside, image="oakd/rgb/image_raw") == {"camera_info": f"/robot1{lenses[1]}"}
    assert names(topics[0], image="camera/image") == {"camera_info": lenses[0]}


@pytest.mark.parametrize(
    ("name", "colours"),
    [
        ("/stereo_inertial_publisher/color/image", True),
        ("/depth_camera/rgb/image_raw", True),
        ("/stereo_inertial_publisher/stereo/depth", False),
        ("/camera/aligned_depth_to_color/image_raw", False),
        ("/rgbd/depth/image_raw", False),
        ("/camera/infra1/image_rect_raw", False),
    ],
)
def test_of_the_words_in_a_name_the_last_tells_what_a_picture_shows(name, colours):
    roles = assign([BagTopic(name, IMAGE, 9)])
    assert ("image" in roles.topics) == colours
    assert roles.notes == (() if colours else (
        f"For image nothing was chosen: by its name {name} (Image, 9 messages) is something else; "
        "image:=NAME chooses it all the same.",
    ))  # fmt: skip
