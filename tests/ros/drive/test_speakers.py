"""Who speaks on a topic, without ROS."""

from __future__ import annotations

from cfnav_ros.robot.speakers import OneSpeaker, Speaker

LIDAR, AGAIN = Speaker(b"1", "lidar_collision_node"), Speaker(b"2", "lidar_collision_node")
STRANGER = Speaker(b"3", "stranger")


def test_the_first_that_speaks_alone_is_the_one() -> None:
    one = OneSpeaker("/collision/estimate", "")
    assert [one.look(who) for who in ([], [LIDAR], [LIDAR], [])] == [""] * 4


def test_a_second_one_is_named() -> None:
    one = OneSpeaker("/collision/estimate", "")
    for first in ([], [LIDAR]):
        one.look(first)
        assert one.look([STRANGER, LIDAR]) == (
            "2 nodes publish /collision/estimate (lidar_collision_node, stranger): end all but one."
        )


def test_another_one_of_the_same_name_is_not_the_one() -> None:
    one = OneSpeaker("/odom", "")
    one.look([LIDAR])
    reason = "lidar_collision_node publishes /odom now, in place of another one."
    assert one.look([AGAIN]) == reason
    one.forget()
    assert one.look([AGAIN]) == ""


def test_one_who_came_and_went_is_noticed() -> None:
    one = OneSpeaker("/odom", "")
    assert one.look([LIDAR], met=1) == ""
    gone = "Another publisher of /odom came and went: whose words came meanwhile cannot be told."
    assert one.look([LIDAR], met=2) == gone
    assert one.look([], met=2) == gone
