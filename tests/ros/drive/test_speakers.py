"""Who speaks on a topic, without ROS."""

from __future__ import annotations

from cfnav_ros.robot.speakers import UNKNOWN_NODE, OneSpeaker, Speaker

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


def test_another_name_does_not_stand_in_for_one_that_was_trusted() -> None:
    one = OneSpeaker("/collision/estimate", "")
    one.look([LIDAR])
    one.forget()
    assert one.look([STRANGER]) == ""  # nobody has driven by the other's word
    one.forget()
    one.look([LIDAR])
    one.trust()
    one.forget()
    reason = (
        "stranger publishes /collision/estimate now, lidar_collision_node did in the drive before: "
        "end it, or start the policy node again if that is meant."
    )
    assert one.look([STRANGER]) == reason
    assert one.look([STRANGER]) == reason
    assert one.look([AGAIN]) == ""  # the node has started anew


def test_a_name_that_is_not_discovered_yet_is_waited_for() -> None:
    one = OneSpeaker("/scan", "")
    one.look([Speaker(b"1", UNKNOWN_NODE)])
    one.trust()
    one.forget()
    assert one.look([STRANGER]) == ""  # nobody's name was trusted
    one.trust()
    one.forget()
    assert one.look([Speaker(b"4", UNKNOWN_NODE)]) == "A publisher on /scan has not said its name."
    assert one.look([Speaker(b"4", "lidar")]).startswith("lidar publishes /scan now, stranger did")
    assert one.look([Speaker(b"5", "stranger")]) == ""


def test_a_name_that_comes_in_the_drive_is_trusted_from_the_next_on() -> None:
    one = OneSpeaker("/scan", "")
    one.look([Speaker(b"1", UNKNOWN_NODE)])
    one.trust()
    assert one.look([Speaker(b"1", "lidar")]) == ""
    one.trust()
    one.forget()
    assert one.look([STRANGER]).startswith("stranger publishes /scan now, lidar did")


def test_one_who_came_and_went_is_noticed() -> None:
    one = OneSpeaker("/odom", "")
    assert one.look([LIDAR], met=1) == ""
    gone = "Another publisher of /odom came and went: whose words came meanwhile cannot be told."
    assert one.look([LIDAR], met=2) == gone
    assert one.look([], met=2) == gone
