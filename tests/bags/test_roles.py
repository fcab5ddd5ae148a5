"""Which topic plays which role."""

from __future__ import annotations

import pytest
from cfnav_ros.bags.roles import ROLES, assign, parse_topics
from cfnav_ros.bags.storage import Topic

ODOM, IMAGE = "nav_msgs/msg/Odometry", "sensor_msgs/msg/Image"
JPEG, TF = "sensor_msgs/msg/CompressedImage", "tf2_msgs/msg/TFMessage"
STAMPED, TWIST = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"


def names(*topics: Topic, **named: str) -> dict[str, str]:
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
        Topic("/r1/filtered", ODOM, 900),
        Topic("/r1/odom", ODOM, 10),
        Topic("/r1/tf", TF, 5),
        Topic("/r1/tf_static", TF, 1),
        Topic("/r1/oakd/rgb/preview/image_raw", IMAGE, 7),
        Topic("/r1/oakd/rgb/image_rect", IMAGE, 70),
    )
    assert names(*topics) == {
        "image": "/r1/oakd/rgb/preview/image_raw",
        "odom": "/r1/odom",
        "tf": "/r1/tf",
        "tf_static": "/r1/tf_static",
    }


def test_a_name_that_only_ends_alike_is_not_the_usual_one():
    assert names(Topic("/wheel_odom", ODOM, 1), Topic("/odom", ODOM, 1))["odom"] == "/odom"
    assert names(Topic("/my_tf", TF, 9)) == {}


def test_without_a_usual_name_the_type_tells_and_most_messages_win():
    topics = (Topic("/a", ODOM, 3), Topic("/b", ODOM, 5), Topic("/c", ODOM, 0))
    roles = assign(topics)
    assert roles.topics["odom"].name == "/b"
    assert roles.notes == (
        "For odom /b (Odometry, 5 messages) was chosen, there are also /a (Odometry, 3 messages), "
        "/c (Odometry, 0 messages).",
    )
    assert set(roles.missing) == set(ROLES) - {"odom"}


def test_a_name_without_a_slash_stands_in_any_namespace_unless_it_is_there_exactly():
    topics = (Topic("/r1/wheels", ODOM, 3), Topic("/wheels", ODOM, 1))
    assert names(*topics, odom="wheels") == {"odom": "/wheels"}
    assert names(topics[0], odom="wheels") == {"odom": "/r1/wheels"}
    assert names(topics[0], odom="/wheels") == {}


def test_an_empty_topic_loses_whatever_its_name():
    topics = (Topic("/cmd_vel", STAMPED, 0), Topic("/cmd_vel_unstamped", TWIST, 4))
    assert names(*topics) == {"cmd_vel": "/cmd_vel_unstamped"}
    assert names(Topic("/cmd_vel", STAMPED, 0)) == {"cmd_vel": "/cmd_vel"}


def test_one_name_with_two_types_is_two_topics():
    topics = (Topic("/cmd_vel", TWIST, 4), Topic("/cmd_vel", STAMPED, 4))
    chosen = assign(topics).topics["cmd_vel"]
    assert chosen.type == STAMPED
    assert names(Topic("/camera/image_raw/compressed", JPEG, 4)) == {
        "image": "/camera/image_raw/compressed"
    }


def test_depth_pictures_and_costmaps_are_something_else():
    grid = "nav_msgs/msg/OccupancyGrid"
    topics = (Topic("/stereo/image_raw", IMAGE, 9), Topic("/local_costmap/costmap", grid, 9))
    assert names(*topics) == {}
    assert names(*topics, image="/stereo/image_raw") == {"image": "/stereo/image_raw"}


def test_what_the_user_names_is_taken_or_missing():
    topics = (Topic("/odom", ODOM, 9), Topic("/other", ODOM, 1), Topic("/scan", TWIST, 3))
    assert names(*topics, odom="other")["odom"] == "/other"
    roles = assign(topics, {"odom": "/nowhere", "scan": "/scan"})
    assert {"odom", "scan"} <= set(roles.missing)
    assert roles.notes == (
        "The topic /scan that was given for scan holds geometry_msgs/msg/Twist, expected "
        "sensor_msgs/msg/LaserScan.",
        "The topic /nowhere that was given for odom is not in the bag.",
    )
